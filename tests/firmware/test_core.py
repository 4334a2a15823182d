"""The core's own tests, under the address and undefined-behaviour sanitizers."""

import subprocess

import pytest

from tests.firmware.conftest import FIRMWARE, Make

NAMES = sorted(path.stem for path in (FIRMWARE / "tests").glob("test_*.c"))


@pytest.mark.parametrize("name", NAMES)
def test_the_core_passes_under_sanitizers(make: Make, name: str) -> None:
    build = make(name.removeprefix("test_"))
    environment = {"ASAN_OPTIONS": "detect_leaks=0"}
    done = subprocess.run(
        [build / name], cwd=FIRMWARE, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "checks passed" in done.stdout


def test_random_commands_leave_a_glove_that_answers(make: Make) -> None:
    build = make("random")
    done = subprocess.run(
        [build / "random", "1"], cwd=FIRMWARE, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[0]) > 50


def test_the_arduino_library_compiles_against_its_interface(make: Make) -> None:
    library = make("arduino") / "arduino" / "Handscope"
    assert {path.name for path in library.iterdir()} == {
        "examples",
        "library.json",
        "library.properties",
        "src",
    }
