"""A UDP socket whose datagrams keep the time at which they came, however late they are read.

In      an address to listen at
Out     each datagram, who sent it, and how long it has waited here (ns)
Source  Linux, socket(7): SO_TIMESTAMPNS, SO_RCVBUF
Limits  other systems do not say when a datagram came: there none has waited
"""

import socket
import struct
import sys
import time
from contextlib import suppress

from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe

DATAGRAM = 1472  # bytes, what an Ethernet packet holds
BUFFER = 2**22  # bytes that may wait; the system gives what its administrator allows
SO_TIMESTAMPNS = 35  # of Linux; Python has no name for it
TIMESPEC = struct.Struct("@ll")
LONGEST_WAIT = 60 * 10**9  # ns; more is a clock that was set meanwhile
HAS_TIMES = sys.platform == "linux"


def listen(host: str, port: int) -> socket.socket:
    """A socket at an address, which does not block; InputError where it is taken."""
    found = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        found.bind((host, port))
    except OSError as problem:
        found.close()
        raise InputError(
            "device.udp_port_cannot_open", port=port, problem=describe(problem)
        ) from None
    found.setblocking(False)
    with suppress(OSError):
        found.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
    if HAS_TIMES:
        with suppress(OSError):
            found.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    return found


def receive(open_socket: socket.socket) -> tuple[bytes, tuple[str, int], int]:
    """The next datagram, its sender, and how long it has waited, ns; BlockingIOError where there is none."""
    if not HAS_TIMES:
        data, sender = open_socket.recvfrom(DATAGRAM)
        return data, sender[:2], 0
    data, about, _, sender = open_socket.recvmsg(DATAGRAM, socket.CMSG_SPACE(TIMESPEC.size))
    waited = 0
    for level, kind, content in about:
        if (level, kind) == (socket.SOL_SOCKET, SO_TIMESTAMPNS) and len(content) >= TIMESPEC.size:
            seconds, ns = TIMESPEC.unpack_from(content)
            waited = time.time_ns() - (seconds * 10**9 + ns)
    return data, sender[:2], waited if 0 <= waited < LONGEST_WAIT else 0
