"""Trackers that speak the SlimeVR protocol, as its firmware documents it: tests send their packets through a real socket."""

import socket
import struct
from collections.abc import Sequence

MAC = bytes.fromhex("a4cf12000007")


def handshake(mac: bytes = MAC, firmware: bytes = b"0.5.0") -> bytes:
    body = struct.pack(">7I", 1, 2, 3, 0, 0, 0, 20) + bytes([len(firmware)]) + firmware + mac
    return struct.pack(">IQ", 3, 0) + body + b"\0"


def sensor_info(number: int, sensor: int, position: int) -> bytes:
    return struct.pack(">IQBBBHBB", 15, number, sensor, 1, 4, 0, 1, position) + b"\0" * 9


def rotation(sensor: int, q: Sequence[float]) -> bytes:
    """Fields of a rotation packet; q is w, x, y, z."""
    w, x, y, z = q
    return struct.pack(">BB4fB", sensor, 1, x, y, z, w, 0)


def packet(kind: int, number: int, body: bytes) -> bytes:
    return struct.pack(">IQ", kind, number) + body


def bundle(number: int, parts: Sequence[tuple[int, bytes]]) -> bytes:
    inner = (struct.pack(">I", kind) + body for kind, body in parts)
    return packet(100, number, b"".join(struct.pack(">H", len(p)) + p for p in inner))


def compact_bundle(number: int, parts: Sequence[tuple[int, bytes]]) -> bytes:
    inner = (bytes([kind]) + body for kind, body in parts)
    return packet(101, number, b"".join(bytes([len(p)]) + p for p in inner))


def tracker_socket() -> socket.socket:
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    found.bind(("127.0.0.1", 0))
    found.settimeout(5.0)
    return found
