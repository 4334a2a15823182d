"""Messages of the wire protocol as values, and their payload bytes. Little-endian throughout; docs/wire-protocol.md is the same in prose.

Device to host: Identity, Strip, StreamInfo, Samples, Status, Reply, Pong, StripCalibration, Plate, ForceSensorCalibration. Host to device: the commands.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.data.samples import (
    ACC,
    FORCE,
    GYR,
    MAG,
    ORIENTATION,
    TORQUE,
    TRACKED_POINTS,
)
from handscope.sessions.wire.force_calibration import (
    ForceSensorCalibration,
    read_force,
    write_force,
)
from handscope.sessions.wire.plate_payload import read_plate, write_plate

VERSION = 1
QUANTITIES = (GYR, ACC, MAG, FORCE, TORQUE, ORIENTATION)  # bit k of the quantity mask
HAND_CODES = {0: None, 1: "left", 2: "right"}
ALL_SLOTS = 255


class Format(IntEnum):
    """How sample values travel."""

    INT16 = 0  # the sensor's own counts, times the stream's scale
    FLOAT32 = 1  # SI units


class ReplyCode(IntEnum):
    """What a device answers to a command."""

    OK = 0
    UNKNOWN_COMMAND = 1
    BAD_ARGUMENT = 2
    BUSY = 3


@dataclass(frozen=True)
class Identity:
    """Who the device is; sent on request, at start and every second."""

    device_id: int
    boot_id: int  # drawn at power-up: a new one means that clocks and counters began again
    hand: str | None
    name: str
    firmware: str
    version: int = VERSION


@dataclass(frozen=True)
class Strip:
    """A strip at a connector (slot): its sensors by tracked point, or that it was pulled."""

    slot: int
    attached: bool
    strip_id: int
    points: tuple[str, ...]
    # nominal q_BS of each sensor, 4 numbers each; empty = axes along the segment's
    mounting: tuple[float, ...] = ()
    raw: bool = False  # samples are as the sensors read; the host corrects them by the StripCalibration of each


@dataclass(frozen=True)
class StreamInfo:
    """How to read the samples of a stream."""

    stream: int
    slot: int
    clock: int  # 0 is the base unit's; every other is a sensor's own
    quantities: tuple[str, ...]
    format: Format
    rate: float  # Hz
    scale: tuple[float, ...]  # SI units per count, by quantity
    # largest value of the sensor in SI units, by quantity; 0 = unknown
    full_scale: tuple[float, ...]


@dataclass(frozen=True)
class Samples:
    """A burst of consecutive samples of one stream."""

    stream: int
    index: int  # of the first sample since start, modulo 2**32
    t_first: int  # ns on the stream's clock
    t_sent: int  # ns on the base unit's clock
    count: int
    data: bytes  # count x sensors x the components of each quantity


@dataclass(frozen=True)
class Status:
    """How a device is: samples lost, battery in percent, temperature in deg C."""

    t: int  # ns on the base unit's clock
    overruns: int  # frames that the device had to drop since power-up because nobody took the bytes
    battery_percent: int  # 255 = on USB power
    temperature: float  # deg C


@dataclass(frozen=True)
class Reply:
    """A device's answer to a command."""

    command: int  # type byte of the command answered
    code: ReplyCode
    text: str = ""


@dataclass(frozen=True)
class Pong:
    """Answer to `Ping`, with the device's time in s."""

    token: int
    t: int  # ns on the base unit's clock


@dataclass(frozen=True)
class Mark:
    """An event of the device: its button was pressed, or a replayed recording has an event here."""

    t: int  # ns on the base unit's clock, the onset
    duration: int  # ns
    trial_type: str
    details: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class StripCalibration:
    """What a strip's flash says of one sensor: per quantity (gyr, acc, mag) bias (3,) and correction matrix (3, 3): y = M (x - bias)."""

    slot: int
    sensor: int
    bias: tuple[float, ...] = (0.0,) * 9
    matrix: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0) * 3


@dataclass(frozen=True)
class Identify:
    """Ask a device who it is."""


@dataclass(frozen=True)
class Configure:
    """Rates and ranges of a slot (ALL_SLOTS for every one); 0 keeps what is set."""

    slot: int = ALL_SLOTS
    rate: float = 0.0  # Hz of gyroscope and accelerometer
    mag_rate: float = 0.0  # Hz, at most 100
    gyr_range: float = 0.0  # rad/s
    acc_range: float = 0.0  # m/s^2
    format: Format = Format.INT16


@dataclass(frozen=True)
class Start:
    """Ask a device to send samples."""


@dataclass(frozen=True)
class Stop:
    """Ask a device to stop sending samples."""


@dataclass(frozen=True)
class Ping:
    """Ask a device for its time."""

    token: int


@dataclass(frozen=True)
class Cue:
    """Tells the wearer what to do next (a lamp, a sound; the virtual patient does it); a device may ignore it."""

    task: str
    details: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class ReadCalibration:
    """Ask a device for the calibration stored in a strip."""

    slot: int


@dataclass(frozen=True)
class WriteCalibration:
    """Keep this in the strip's flash."""

    calibration: StripCalibration


Message = (
    Identity
    | Strip
    | StreamInfo
    | Samples
    | Status
    | Reply
    | Pong
    | Mark
    | StripCalibration
    | Plate
    | ForceSensorCalibration
    | Identify
    | Configure
    | Start
    | Stop
    | Ping
    | Cue
    | ReadCalibration
    | WriteCalibration
)


class BadPayloadError(Exception):
    """The bytes of a frame do not make the message that its type announces."""


def encode(message: Message) -> tuple[int, bytes]:
    """Type byte and payload of a message."""
    code, write, _ = _CODECS[type(message)]
    return code, write(message)


def decode(code: int, payload: bytes) -> Message:
    """The message of a payload; BadPayloadError where the bytes do not fit, also for a type that this version does not know."""
    reader = _BY_CODE.get(code)
    if reader is None:
        raise BadPayloadError(f"unknown type {code:#x}")
    try:
        message: Message = reader(payload)
        return message
    except (struct.error, UnicodeDecodeError, IndexError, ValueError, KeyError) as problem:
        raise BadPayloadError(str(problem)) from None


def _text(value: str, limit: int = 255) -> bytes:
    data = value.encode()[:limit].decode(errors="ignore").encode()  # no letter cut in two
    return bytes([len(data)]) + data


def _read_text(payload: bytes, at: int) -> tuple[str, int]:
    end = at + 1 + payload[at]
    if end > len(payload):
        raise ValueError("text runs past the end")
    return payload[at + 1 : end].decode(), end


def _read_identity(p: bytes) -> Identity:
    version, device_id, boot_id, hand = struct.unpack_from("<HQIB", p)
    name, at = _read_text(p, 15)
    firmware, _ = _read_text(p, at)
    return Identity(device_id, boot_id, HAND_CODES[hand], name, firmware, version)


def _write_identity(m: Identity) -> bytes:
    hand = next(code for code, name in HAND_CODES.items() if name == m.hand)
    return (
        struct.pack("<HQIB", m.version, m.device_id, m.boot_id, hand)
        + _text(m.name)
        + _text(m.firmware)
    )


def _read_strip(p: bytes) -> Strip:
    slot, attached, strip_id, count = struct.unpack_from("<BBQB", p)
    points = tuple(TRACKED_POINTS[code] for code in struct.unpack_from(f"<{count}B", p, 11))
    mounting = struct.unpack(f"<{4 * count}f", p[11 + count :]) if len(p) > 11 + count else ()
    if not all(
        0.99 < np.linalg.norm(mounting[k : k + 4]) < 1.01 for k in range(0, len(mounting), 4)
    ):
        raise ValueError("a mounting is no unit quaternion")
    return Strip(slot, bool(attached & 1), strip_id, points, mounting, bool(attached & 2))


def _write_strip(m: Strip) -> bytes:
    head = struct.pack("<BBQB", m.slot, m.attached | 2 * m.raw, m.strip_id, len(m.points))
    return (
        head
        + bytes(TRACKED_POINTS.index(point) for point in m.points)
        + struct.pack(f"<{len(m.mounting)}f", *m.mounting)
    )


def _read_stream(p: bytes) -> StreamInfo:
    stream, slot, clock, mask, kind, rate = struct.unpack_from("<BBBBBd", p)
    quantities = tuple(q for k, q in enumerate(QUANTITIES) if mask >> k & 1)
    numbers = struct.unpack_from(f"<{2 * len(quantities)}f", p, 13)
    if ORIENTATION in quantities and len(quantities) > 1:
        raise ValueError(f"stream {stream} has orientations beside other quantities")
    if not (0 < rate <= 10_000) or not 0 < mask < 1 << len(QUANTITIES):
        raise ValueError(f"stream {stream} states {rate:g} Hz and quantities {mask:#x}")
    if not np.isfinite(numbers).all():
        raise ValueError(f"scale or full scale of {numbers}")
    return StreamInfo(
        stream,
        slot,
        clock,
        quantities,
        Format(kind),
        rate,
        numbers[: len(quantities)],
        numbers[len(quantities) :],
    )


def _write_stream(m: StreamInfo) -> bytes:
    mask = sum(1 << QUANTITIES.index(q) for q in m.quantities)
    return struct.pack("<BBBBBd", m.stream, m.slot, m.clock, mask, m.format, m.rate) + struct.pack(
        f"<{2 * len(m.quantities)}f", *m.scale, *m.full_scale
    )


def _read_samples(p: bytes) -> Samples:
    stream, index, t_first, t_sent, count = struct.unpack_from("<BIQQB", p)
    return Samples(stream, index, t_first, t_sent, count, p[22:])


def _write_samples(m: Samples) -> bytes:
    return struct.pack("<BIQQB", m.stream, m.index % 2**32, m.t_first, m.t_sent, m.count) + m.data


def _read_status(p: bytes) -> Status:
    return Status(*struct.unpack("<QIBf", p))


def _write_status(m: Status) -> bytes:
    return struct.pack("<QIBf", m.t, m.overruns, m.battery_percent, m.temperature)


def _read_reply(p: bytes) -> Reply:
    return Reply(p[0], ReplyCode(p[1]), _read_text(p, 2)[0])


def _write_reply(m: Reply) -> bytes:
    return bytes([m.command, m.code]) + _text(m.text)


def _read_calibration(p: bytes) -> StripCalibration:
    slot, sensor, *numbers = struct.unpack("<BB36f", p)
    if not np.isfinite(numbers).all():
        raise ValueError(f"calibration of {numbers}")
    return StripCalibration(slot, sensor, tuple(numbers[:9]), tuple(numbers[9:]))


def _write_calibration(m: StripCalibration) -> bytes:
    return struct.pack("<BB36f", m.slot, m.sensor, *m.bias, *m.matrix)


def _read_configure(p: bytes) -> Configure:
    slot, rate, mag_rate, gyr, acc, kind = struct.unpack("<BddffB", p)
    return Configure(slot, rate, mag_rate, gyr, acc, Format(kind))


def _write_configure(m: Configure) -> bytes:
    return struct.pack("<BddffB", m.slot, m.rate, m.mag_rate, m.gyr_range, m.acc_range, m.format)


def _read_cue(p: bytes) -> Cue:
    task, at = _read_text(p, 0)
    return Cue(task, _read_pairs(p, at))


def _write_cue(m: Cue) -> bytes:
    return _text(m.task) + _pairs(m.details)


def _read_mark(p: bytes) -> Mark:
    t, duration = struct.unpack_from("<QQ", p)
    trial_type, at = _read_text(p, 16)
    return Mark(t, duration, trial_type, _read_pairs(p, at))


def _write_mark(m: Mark) -> bytes:
    return struct.pack("<QQ", m.t, m.duration) + _text(m.trial_type) + _pairs(m.details)


def _pairs(details: dict[str, str]) -> bytes:
    return b"".join(_text(key) + _text(value) for key, value in details.items())


def _read_pairs(p: bytes, at: int) -> dict[str, str]:
    details = {}
    while at < len(p):
        key, at = _read_text(p, at)
        details[key], at = _read_text(p, at)
    return details


_CODECS: dict[type, tuple[int, Callable[[Any], bytes], Callable[[bytes], Any]]] = {
    Identity: (0x01, _write_identity, _read_identity),
    Strip: (0x02, _write_strip, _read_strip),
    StreamInfo: (0x03, _write_stream, _read_stream),
    Samples: (0x04, _write_samples, _read_samples),
    Status: (0x05, _write_status, _read_status),
    Reply: (0x06, _write_reply, _read_reply),
    Pong: (
        0x07,
        lambda m: struct.pack("<QQ", m.token, m.t),
        lambda p: Pong(*struct.unpack("<QQ", p)),
    ),
    StripCalibration: (0x08, _write_calibration, _read_calibration),
    Mark: (0x09, _write_mark, _read_mark),
    Plate: (0x0A, write_plate, read_plate),
    ForceSensorCalibration: (0x0B, write_force, read_force),
    Identify: (0x81, lambda m: b"", lambda p: Identify()),
    Configure: (0x82, _write_configure, _read_configure),
    Start: (0x83, lambda m: b"", lambda p: Start()),
    Stop: (0x84, lambda m: b"", lambda p: Stop()),
    Ping: (0x85, lambda m: struct.pack("<Q", m.token), lambda p: Ping(*struct.unpack("<Q", p))),
    Cue: (0x86, _write_cue, _read_cue),
    ReadCalibration: (0x87, lambda m: bytes([m.slot]), lambda p: ReadCalibration(p[0])),
    WriteCalibration: (
        0x88,
        lambda m: _write_calibration(m.calibration),
        lambda p: WriteCalibration(_read_calibration(p)),
    ),
}
_BY_CODE = {code: read for code, _, read in _CODECS.values()}
