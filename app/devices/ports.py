"""Serial ports: which there are, and one opened. Real gloves and virtual ones behind pseudo-terminals are opened by the same code."""

import errno
from dataclasses import dataclass

import serialx

from handscope.estimators.errors import InputError

BAUD = 115200  # ignored by USB; a value that every driver takes
READ_WAIT = 0.1  # s that a read waits for the first byte


@dataclass(frozen=True)
class PortInfo:
    path: str
    description: str


def available() -> list[PortInfo]:
    """The machine's serial ports with what they say of themselves."""
    found = []
    for port in serialx.list_serial_ports():
        words = [str(w) for w in (port.manufacturer, port.product, port.serial_number) if w]
        found.append(PortInfo(str(port.device), " ".join(words) or "serial port"))
    return found


def open_port(path: str) -> serialx.Serial:
    """Open a port for us alone; InputError says why it cannot be opened."""
    try:
        port = serialx.Serial(path, baudrate=BAUD, read_timeout=READ_WAIT, write_timeout=2.0)
        if not port.is_open:
            port.open()
    except FileNotFoundError:
        raise InputError(f"there is no port {path}; is the glove plugged in?") from None
    except PermissionError:
        raise InputError(
            f"no permission to open {path}; add your user to the group that owns it (often dialout), then log in again"
        ) from None
    except OSError as problem:
        if problem.errno in (errno.EBUSY, errno.EACCES):
            raise InputError(
                f"{path} is in use by another program; close it and try again"
            ) from None
        raise InputError(
            f"{path} cannot be opened as a serial port ({problem.strerror or problem})"
        ) from None
    return port
