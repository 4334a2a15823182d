"""The whole-hand glove as ARM code on an emulated Cortex-M3, its UART a pseudo-terminal, recorded as any glove is."""

import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.firmware.conftest import FIRMWARE, Make
from tests.firmware.recorded import (
    SAMPLES,
    assert_fists_are_measured,
    assert_nothing_is_lost,
    record,
)

EMULATOR, COMPILER = "qemu-system-arm", "arm-none-eabi-gcc"
BOARD = [
    "-M",
    "mps2-an385",
    "-display",
    "none",
    "-monitor",
    "none",
    "-semihosting-config",
    f"enable=on,target=native,arg=glove,arg={SAMPLES:.0f}",
]
CLOCK = [
    "-icount",
    "shift=3",
]  # 8 ns an instruction, as a Cortex-M3 at 125 MHz: its time waits for a busy host, as no real board's must
MOST_WORK = 40e6  # instructions a second: a third of a Cortex-M3 at 120 MHz
needs_tools = pytest.mark.skipif(
    not (shutil.which(EMULATOR) and shutil.which(COMPILER)),
    reason=f"{EMULATOR} or {COMPILER} is missing",
)


@contextmanager
def emulated(program: Path) -> Iterator[str]:
    """The glove that runs; the path of its port."""
    with subprocess.Popen(
        [EMULATOR, *BOARD, *CLOCK, "-kernel", program, "-serial", "pty"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as board:
        assert board.stdout is not None
        try:
            line = board.stdout.readline()
            found = re.search(r"redirected to (\S+)", line)
            assert found is not None, line
            yield found.group(1)
        finally:
            board.kill()


@pytest.fixture(scope="module")
def build(make: Make) -> Path:
    return make("elf")


@pytest.fixture(scope="module")
def recorded(build: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    with emulated(build / "glove.elf") as port:
        return record(port, tmp_path_factory.mktemp("qemu"))


@needs_tools
def test_ten_seconds_at_200_hz_are_recorded_without_loss(recorded: Path) -> None:
    assert_nothing_is_lost(recorded)


@pytest.mark.slow
@needs_tools
def test_the_recording_is_assessed(recorded: Path, tmp_path: Path) -> None:
    assert_fists_are_measured(recorded, tmp_path / "assessed")


@pytest.mark.slow
@needs_tools
def test_the_loop_leaves_most_of_a_small_processor_free(build: Path) -> None:
    words = [
        EMULATOR,
        *BOARD,
        "-kernel",
        str(build / "count.elf"),
        "-serial",
        "null",
        "-icount",
        "shift=0",
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=300)
    found = re.search(
        r"work in a second of 17 sensors at 200 Hz, instructions: (\d+)", done.stdout + done.stderr
    )
    assert found is not None, done.stdout + done.stderr
    assert 1e6 < int(found.group(1)) < MOST_WORK


@needs_tools
def test_there_is_no_heap(build: Path) -> None:
    symbols = subprocess.run(
        ["arm-none-eabi-nm", build / "glove.elf"], capture_output=True, text=True, check=True
    ).stdout
    assert "hs_glove_poll" in symbols
    assert not re.search(r"\b(malloc|calloc|realloc|_sbrk|_malloc_r)\b", symbols)


def test_the_makefile_says_what_is_missing_where_there_is_no_cross_compiler(tmp_path: Path) -> None:
    if shutil.which("make") is None:
        pytest.skip("there is no make here")
    words = [
        "make",
        "--silent",
        "-C",
        str(FIRMWARE),
        f"BUILD={tmp_path}",
        "ARM=no-such-",
        "QEMU=true",
        "elf",
        "size",
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "gcc-arm-none-eabi" in done.stdout
