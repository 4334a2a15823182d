"""A virtual glove's line behind a pseudo-terminal: any serial program opens it as it opens a real glove."""

import os
import select
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from handscope.estimators.errors import InputError

HANG_UP_WAIT = 0.02  # s until it is looked again whether a host has opened the port


def require_free(path: Path) -> None:
    """InputError where something else than an old link is there already."""
    if path.exists() and not path.is_symlink():
        raise InputError("device.pty_exists", path=str(path))


@contextmanager
def plug(path: Path) -> Iterator["Terminal"]:
    """While the cable is plugged in, `path` is a link to the pseudo-terminal."""
    master, slave = os.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    if path.is_symlink():
        path.unlink()
    path.symlink_to(os.ttyname(slave))
    os.close(slave)
    try:
        yield Terminal(master)
    finally:
        with suppress(FileNotFoundError):
            path.unlink()
        os.close(master)


class Terminal:
    """A `session.Line` over the master's side of a pseudo-terminal."""

    def __init__(self, master: int) -> None:
        self._master = master
        self._poll = select.poll()
        self._poll.register(master, select.POLLIN)

    def read(self, wait: float) -> bytes | None:
        """What the host sent; None while no host has the port open."""
        events = self._poll.poll(wait * 1000)
        if any(kind & select.POLLIN for _, kind in events):
            with suppress(OSError):
                return os.read(self._master, 65536)
        if any(kind & select.POLLHUP for _, kind in events):
            time.sleep(HANG_UP_WAIT)
            return None
        return b""

    def write(self, data: bytes) -> bytes:
        """Send what fits; gives back the rest."""
        try:
            return data[os.write(self._master, data) :] if data else data
        except BlockingIOError:
            return data
        except OSError:
            return b""
