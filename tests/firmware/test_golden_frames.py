"""Frames of the firmware and of the program are the same, both ways, from one file."""

import subprocess

from handscope.sessions.wire.framing import Decoder
from tests.firmware import golden
from tests.firmware.conftest import FIRMWARE, Make


def test_the_file_is_what_the_encoder_writes() -> None:
    assert golden.FILE.read_text().splitlines() == golden.lines()


def test_the_firmware_reads_commands_and_writes_messages_to_the_byte(make: Make) -> None:
    program = make_golden(make)
    assert (
        "checks passed"
        in subprocess.run(
            [program], cwd=FIRMWARE, capture_output=True, text=True, check=True
        ).stdout
    )


def test_what_the_firmware_writes_is_read_as_the_same_messages(make: Make) -> None:
    printed = subprocess.run(
        [make_golden(make), "--print"], cwd=FIRMWARE, capture_output=True, text=True, check=True
    ).stdout
    decoder = Decoder()
    read = {
        line.split()[0]: list(decoder.feed(bytes.fromhex(line.split()[1])))
        for line in printed.splitlines()
    }
    assert read == {name: [message] for name, message in golden.GLOVE.items()}
    assert decoder.counters.lost == decoder.counters.corrupt == decoder.counters.malformed == 0


def make_golden(make: Make) -> str:
    """The test program that compares with the file."""
    build = make("golden")
    return str(build / "test_golden")
