"""The firmware, built once a run, and gloves of it that serve."""

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FIRMWARE = ROOT / "firmware"
HANDSCOPE = Path(sys.executable).parent / "handscope"
Make = Callable[[str], Path]


@pytest.fixture(scope="session")
def make(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """Makes a target of the firmware's Makefile; gives the folder with what was built."""
    if shutil.which("cc") is None or shutil.which("make") is None:
        pytest.skip("there is no C compiler here")
    build = tmp_path_factory.mktemp("firmware")

    def made(target: str) -> Path:
        words = ["make", "--silent", "-C", str(FIRMWARE), f"BUILD={build}", target]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return build

    return made


def run_handscope(*words: str) -> str:
    """Standard output of the program, which must end well."""
    done = subprocess.run([str(HANDSCOPE), *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
