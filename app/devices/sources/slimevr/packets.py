"""Datagrams of SlimeVR trackers as values, and the answers that keep a tracker connected.

In      a datagram: packet type u32, number u64, then the packet's fields, big-endian; bundles hold several
Out     packets; what is cut short or not known is left out and counted by who asks
Source  SlimeVR-Tracker-ESP, src/network/packets.h and connection.cpp; SlimeVR-Server, UDPPacket.kt and UDPProtocolParser.kt
"""

import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

HEARTBEAT, HANDSHAKE, ACCELERATION, PING = 0, 3, 4, 10
BATTERY, TAP, SENSOR_INFO, ROTATION_DATA = 12, 13, 15, 17
SIGNAL, FEATURES, ROTATION_AND_ACCELERATION = 19, 22, 23
BUNDLE, COMPACT_BUNDLE, INSPECTION = 100, 101, 105
HEAD = struct.Struct(">IQ")
HELLO = (b"\x03Hey OVR =D 5").ljust(64, b"\0")  # what a server answers a handshake
BUNDLES_READ = b"\x03"  # both kinds: bits of the server's features
RAW_IMU, AS_FLOATS = 1, 2  # of an inspection packet
NORMAL = 1  # of rotation data: not the magnetometer's correction


class CutShortError(Exception):
    """A packet that ends before its fields do."""


@dataclass(frozen=True)
class Handshake:
    """What a tracker says of itself when it searches a server."""

    mac: str
    firmware: str


@dataclass(frozen=True)
class Rotation:
    """Orientation of the sensor in a frame whose z is up."""

    sensor: int
    q: tuple[float, float, float, float]  # w, x, y, z


@dataclass(frozen=True)
class Raw:
    """Inertial samples in the firmware's own units."""

    sensor: int
    gyr: tuple[float, ...]
    acc: tuple[float, ...]
    mag: tuple[float, ...]


@dataclass(frozen=True)
class SensorInfo:
    """A sensor of a tracker, and whether it works."""

    sensor: int
    status: int  # 1: works
    position: int | None  # where the firmware was built to sit


@dataclass(frozen=True)
class BatteryLevel:
    """The state of a tracker's battery."""

    volts: float
    share: float  # 0 to 1


@dataclass(frozen=True)
class Tap:
    """Somebody tapped a tracker."""

    sensor: int
    value: int


@dataclass(frozen=True)
class Signal:
    """Strength of a tracker's radio signal, dBm."""

    dbm: int


@dataclass(frozen=True)
class Asked:
    """A packet without values of interest: heartbeat, features."""

    kind: int


Packet = Handshake | Rotation | Raw | SensorInfo | BatteryLevel | Tap | Signal | Asked


def number_of(datagram: bytes) -> int:
    """The datagram's number; CutShortError where it has none."""
    if len(datagram) < HEAD.size:
        raise CutShortError
    return int(HEAD.unpack_from(datagram)[1])


def packets_of(datagram: bytes) -> Iterator[Packet]:
    """The packets of a datagram; unknown ones are passed over. CutShortError where fields are missing."""
    number_of(datagram)
    kind, body = HEAD.unpack_from(datagram)[0], datagram[HEAD.size :]
    if kind == BUNDLE:
        yield from _inner_packets(body, ">H", ">I")
    elif kind == COMPACT_BUNDLE:
        yield from _inner_packets(body, ">B", ">B")
    else:
        yield from _packet(kind, body)


def _inner_packets(body: bytes, size_format: str, kind_format: str) -> Iterator[Packet]:
    """Inner packets: a size, a type, fields."""
    head, inner = struct.Struct(size_format), struct.Struct(kind_format)
    at = 0
    while at + head.size <= len(body):
        size = head.unpack_from(body, at)[0]
        part = body[at + head.size : at + head.size + size]
        at += head.size + size
        if size == 0:
            continue
        if len(part) < max(size, inner.size):
            raise CutShortError
        yield from _packet(inner.unpack_from(part)[0], part[inner.size :])


def _packet(kind: int, body: bytes) -> Iterator[Packet]:
    read = _READERS.get(kind)
    if read is None:
        return
    try:
        found = read(body)
    except (struct.error, IndexError):
        raise CutShortError from None
    if found is not None:
        yield found


def _handshake(body: bytes) -> Handshake:
    # behind seven words: board, sensor, chip, three, version
    size = body[28] if len(body) > 28 else 0
    firmware = body[29 : 29 + size].split(b"\0")[0].decode("ascii", "replace")
    mac = body[29 + size : 35 + size]
    return Handshake(":".join(f"{b:02X}" for b in mac) if len(mac) == 6 else "", firmware)


def _rotation_data(body: bytes) -> Rotation | None:
    sensor, kind, x, y, z, w = struct.unpack_from(">BB4f", body)
    return Rotation(sensor, (w, x, y, z)) if kind == NORMAL else None


def _rotation_and_acceleration(body: bytes) -> Rotation:
    sensor, x, y, z, w = struct.unpack_from(">B4h", body)
    return Rotation(sensor, (w / 32768, x / 32768, y / 32768, z / 32768))


def _raw(body: bytes) -> Raw | None:
    kind, sensor, numbers = struct.unpack_from(">3B", body)
    if kind != RAW_IMU or numbers != AS_FLOATS:
        return None  # counts of the chip, whose scale nobody says
    gyr, acc, mag = (struct.unpack_from(">3f", body, 3 + 13 * k) for k in range(3))
    return Raw(sensor, gyr, acc, mag)


def _sensor_info(body: bytes) -> SensorInfo:
    return SensorInfo(body[0], body[1], body[6] if len(body) > 6 else None)


def _battery(body: bytes) -> BatteryLevel:
    return BatteryLevel(*struct.unpack_from(">2f", body))


_READERS: Mapping[int, Callable[[bytes], Packet | None]] = {
    HEARTBEAT: lambda body: Asked(HEARTBEAT),
    FEATURES: lambda body: Asked(FEATURES),
    HANDSHAKE: _handshake,
    ROTATION_DATA: _rotation_data,
    ROTATION_AND_ACCELERATION: _rotation_and_acceleration,
    INSPECTION: _raw,
    SENSOR_INFO: _sensor_info,
    BATTERY: _battery,
    TAP: lambda body: Tap(*struct.unpack_from(">2B", body)),
    SIGNAL: lambda body: Signal(*struct.unpack_from(">Bb", body)[1:]),
}


def heartbeat() -> bytes:
    """What a server sends to say that it is there."""
    return HEAD.pack(1, 0)


def features() -> bytes:
    """What the server can read."""
    return HEAD.pack(FEATURES, 0) + BUNDLES_READ


def sensor_known(info: SensorInfo) -> bytes:
    """The answer to a sensor's description."""
    return struct.pack(">IBB", SENSOR_INFO, info.sensor, info.status)
