"""A virtual glove's line over TCP: one host at a time, on any system."""

import select
import socket
from collections.abc import Iterator
from contextlib import contextmanager

from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe

IDLE_WAIT = 0.05  # s that a host is waited for before the clock is looked at again


def listen(host: str, port: int) -> socket.socket:
    """A socket that waits for hosts; port 0 takes a free one. InputError where the address is taken."""
    try:
        return socket.create_server((host, port))
    except OSError as problem:
        raise InputError(
            "device.cannot_listen", host=host, port=port, strerror=describe(problem)
        ) from None


@contextmanager
def plug(listener: socket.socket) -> Iterator["Connection"]:
    """While the cable is plugged in hosts may connect; whoever is connected is cut off at its end."""
    line = Connection(listener)
    try:
        yield line
    finally:
        line.hang_up()


class Connection:
    """A `session.Line` to whoever connected last."""

    def __init__(self, listener: socket.socket) -> None:
        self._listener = listener
        self._host: socket.socket | None = None

    def read(self, wait: float) -> bytes | None:
        """What the host sent; None while nobody is connected."""
        if self._host is None:
            return self._accept()
        try:
            if not select.select([self._host], [], [], wait)[0]:
                return b""
            data = self._host.recv(65536)
        except OSError:
            data = b""
        if not data:
            self.hang_up()
            return None
        return data

    def _accept(self) -> bytes | None:
        if not select.select([self._listener], [], [], IDLE_WAIT)[0]:
            return None
        self._host, _ = self._listener.accept()
        self._host.setblocking(False)
        self._host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return b""

    def write(self, data: bytes) -> bytes:
        """Send what fits; gives back the rest."""
        if self._host is None or not data:
            return b""
        try:
            return data[self._host.send(data) :]
        except BlockingIOError:
            return data
        except OSError:
            self.hang_up()
            return b""

    def hang_up(self) -> None:
        """Close the connection, if there is one."""
        host, self._host = self._host, None
        if host is not None:
            host.close()
