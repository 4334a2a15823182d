"""Frames that both sides must agree on to the byte: `python -m tests.firmware.golden` writes them to firmware/tests/golden_frames.txt."""

from collections.abc import Sequence
from pathlib import Path

from handscope.estimators.data.magnet_declaration import Plate
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.framing import Encoder

FILE = Path(__file__).parents[2] / "firmware" / "tests" / "golden_frames.txt"
INDEX = ("index_proximal", "index_middle", "index_distal")
CALIBRATION = wire.StripCalibration(
    2, 1, tuple(0.5 * k - 1 for k in range(9)), tuple(0.25 * k for k in range(27))
)
MOUNTING = (0.5, -0.5, 0.5, -0.5) * 3
GLOVE: dict[str, wire.Message] = {
    "identity": wire.Identity(0x5C09E, 0x12345678, "left", "Test glove", "1.0 \u00e9"),
    "strip": wire.Strip(2, True, 0xA0B0C0D0E0F00102, INDEX, MOUNTING, raw=True),
    "strip_pulled": wire.Strip(2, False, 0xA0B0C0D0E0F00102, INDEX, raw=True),
    "stream_info": wire.StreamInfo(
        4, 2, 0, ("gyr", "acc"), wire.Format.INT16, 200.5, (0.001953125, 0.0078125), (35.0, 156.5)
    ),
    "samples": wire.Samples(4, 2**32 - 1, 2**40, 2**40 + 5, 2, bytes(range(72))),
    "status": wire.Status(123456789012345, 7, 255, 31.5),
    "reply": wire.Reply(0x82, wire.ReplyCode.BAD_ARGUMENT, "no"),
    "pong": wire.Pong(2**64 - 1, 2**33),
    "calibration": CALIBRATION,
    "mark": wire.Mark(2**40, 2**32, "task", {"task_name": "tapping", "side": "left"}),
    "plate": Plate(
        {"trunk_mag_1": (0.0, 0.25, 0.5), "trunk_mag_2": (1.0, 1.25, 1.5)},
        (0.0, 0.0, 0.75),
        (0.5, 0.0, 0.0),
        0.5,
        None,
    ),
}
COMMANDS: dict[str, wire.Message] = {
    "identify": wire.Identify(),
    "configure": wire.Configure(255, 119.5, 50.0, 8.5, 40.0, wire.Format.FLOAT32),
    "start": wire.Start(),
    "stop": wire.Stop(),
    "ping": wire.Ping(0x0102030405060708),
    "cue": wire.Cue("tapping", {"seconds": "10"}),
    "read_calibration": wire.ReadCalibration(2),
    "write_calibration": wire.WriteCalibration(CALIBRATION),
}


def lines() -> list[str]:
    """One frame a line: its name, its bytes with the zero byte; each direction numbers its own frames from 0."""
    return [*_numbered(list(GLOVE.items())), *_numbered(list(COMMANDS.items()))]


def _numbered(messages: Sequence[tuple[str, wire.Message]]) -> list[str]:
    encoder = Encoder()
    return [f"{name} {encoder.frame(message).hex()}" for name, message in messages]


if __name__ == "__main__":
    FILE.write_text("\n".join(lines()) + "\n")
