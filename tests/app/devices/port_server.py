"""A serial port that another machine serves: pyserial's own RFC 2217 server before a glove that listens on TCP, for tests."""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

rfc2217 = pytest.importorskip("serial.rfc2217")
serial = pytest.importorskip("serial")
POLL = 0.02  # s


class _Connection:
    """Where the server's own replies go; samples are written between them."""

    def __init__(self, host: socket.socket) -> None:
        self._host, self._lock = host, threading.Lock()

    def write(self, data: bytes) -> None:
        with self._lock:
            self._host.sendall(data)


@contextmanager
def port_server(glove: str) -> Iterator[str]:
    """The rfc2217 address of a server for the glove at socket://HOST:PORT; it serves one host after another."""
    listener = socket.create_server(("127.0.0.1", 0))
    listener.settimeout(POLL)
    stop = threading.Event()
    thread = threading.Thread(target=_serve, args=(listener, glove, stop.is_set), daemon=True)
    thread.start()
    try:
        yield f"rfc2217://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        stop.set()
        thread.join(10)
        listener.close()


def _serve(listener: socket.socket, glove: str, stopped: Callable[[], bool]) -> None:
    while not stopped():
        try:
            host, _ = listener.accept()
        except TimeoutError:
            continue
        with host, serial.serial_for_url(glove, timeout=POLL) as port:
            host.settimeout(10)
            try:
                _bridge(host, port, stopped)
            except OSError:
                pass  # the host has gone


def _bridge(host: socket.socket, port: Any, stopped: Callable[[], bool]) -> None:
    connection = _Connection(host)
    manager = rfc2217.PortManager(port, connection)
    threading.Thread(target=_to_glove, args=(host, port, manager), daemon=True).start()
    while not stopped():
        if data := port.read(4096):
            connection.write(b"".join(manager.escape(data)))


def _to_glove(host: socket.socket, port: Any, manager: Any) -> None:
    try:
        while data := host.recv(4096):
            port.write(b"".join(manager.filter(data)))
    except (OSError, serial.SerialException):
        pass
