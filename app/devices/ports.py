"""Where a glove's bytes come from: the machine's serial ports, and addresses in the network. Virtual gloves are opened by the same code."""

import errno
import os
import re
import socket
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import serialx
from serialx.platforms.serial_rfc2217 import RFC2217Serial

from handscope.app.devices.sources.addresses import (
    SOURCES,
    is_source,
    open_source,
    parse_source,
)
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.messages.system import describe

if TYPE_CHECKING:
    from handscope.app.devices.sources.translated import TranslatedPort

BAUD = 115200  # ignored by USB; a value that every driver takes
READ_WAIT = 0.1  # s that a read waits for the first byte
CONNECT_WAIT = 3.0  # s until a host that does not answer is given up, for this try
RELAY = "relay://"  # the port of the browser that begins the session; then the session's number
SERIAL = re.compile(
    r"/dev/(tty[A-Za-z]\w*|(tty|cu)\.[\w.-]+|rfcomm\d+|pts/\d+)|(\\\\\.\\)?COM\d+"
)  # names of serial ports and pseudo-terminals on Linux, macOS and Windows
NETWORK = {
    "socket": "the wire protocol over TCP",
    "rfc2217": "the wire protocol over a serial port that another machine serves (RFC 2217)",
}  # schemes of addresses, all opened by serialx


@dataclass(frozen=True)
class PortInfo:
    """A serial port of this machine, or an address, as it is offered."""

    path: str
    description: str


def available() -> list[PortInfo]:
    """The machine's serial ports with what they say of themselves."""
    found = []
    for port in serialx.list_serial_ports():
        words = [str(w) for w in (port.manufacturer, port.product, port.serial_number) if w]
        found.append(PortInfo(str(port.device), " ".join(words) or phrase("device.serial_port")))
    return found


def is_relay(port: str) -> bool:
    """Whether a port is one of a clinician's own browser."""
    return port.startswith(RELAY)


def is_serial(port: str) -> bool:
    """Whether a name is one of a serial port or pseudo-terminal, plugged in or not, a link to one, or among those that the machine lists."""
    if port.startswith("\\\\") and not port.startswith("\\\\.\\"):
        return False  # another machine's
    names = (port, os.path.realpath(port))
    return any(map(SERIAL.fullmatch, names)) or any(p.path == port for p in available())


def is_network(port: str) -> bool:
    """Whether a port is an address, not a serial port of this machine."""
    return "://" in port


def require_allowed(port: str, patterns: Sequence[str]) -> None:
    """Refuse what is no serial port of this machine and what no pattern of the administrator allows, before any name is looked up.

    Patterns are shell patterns over the whole address (`socket://10.1.2.*:4000`) or path. Whether a
    path exists changes nothing. Raises InputError.
    """
    if not is_network(port):
        if not is_serial(port) and not any(fnmatchcase(port, pattern) for pattern in patterns):
            raise InputError("device.not_a_local_port", port=port or '""')
        return
    if port == RELAY:
        return
    require_address(port)
    if not any(fnmatchcase(port, pattern) for pattern in patterns):
        raise InputError("device.port_not_allowed", port=port)


def require_address(url: str) -> None:
    """Refuse what is not exactly SCHEME://HOST:PORT, so that patterns match what is opened; InputError."""
    if is_source(url):
        parse_source(url)
        return
    try:
        parts = urlsplit(url)
        host, number = parts.hostname, parts.port
    except ValueError:
        parts, host, number = urlsplit(""), None, None
    if parts.scheme not in NETWORK:
        forms = [f"{scheme}://HOST:PORT" for scheme in NETWORK]
        known = ", ".join([*forms, *(form for _, form in SOURCES.values())])
        raise InputError("device.address_unknown", url=url, known=known)
    if not host or not number or parts.netloc.rsplit(":", 1)[0].strip("[]").lower() != host:
        raise InputError("device.address_form", url=url, scheme=parts.scheme)
    if parts.path or parts.query or parts.fragment:
        raise InputError("device.address_without_path", url=url, scheme=parts.scheme)


def open_port(path: str) -> "serialx.BaseSerial | TranslatedPort":
    """Open a port or an address for us alone; InputError says why it cannot be opened."""
    if is_source(path):
        return open_source(path)
    if is_relay(path):
        raise InputError("device.relay_without_page")
    return _open_address(path) if is_network(path) else _open_serial(path)


def _open_address(url: str) -> serialx.BaseSerial:
    require_address(url)
    try:
        port = serialx.serial_for_url(
            url,
            baudrate=BAUD,
            read_timeout=READ_WAIT,
            write_timeout=2.0,
            connect_timeout=CONNECT_WAIT,
        )
        if isinstance(port, RFC2217Serial):  # a glove has no modem lines: no news of them
            port._engine.build_state_mask_commands = tuple  # pyserial's servers never answer it
        if not port.is_open:
            port.open()
    except ConnectionRefusedError:
        raise InputError("device.nothing_listens", url=url) from None
    except TimeoutError:
        raise InputError("device.address_silent", url=url) from None
    except socket.gaierror:
        raise InputError("device.host_unknown", url=url) from None
    except OSError as problem:
        raise InputError("device.address_cannot_open", url=url, what=describe(problem)) from None
    return port


def _open_serial(path: str) -> serialx.BaseSerial:
    try:
        port = serialx.Serial(path, baudrate=BAUD, read_timeout=READ_WAIT, write_timeout=2.0)
        if not port.is_open:
            port.open()
    except FileNotFoundError:
        raise InputError("device.port_missing", port=path) from None
    except PermissionError:
        raise InputError("device.port_no_permission", port=path) from None
    except OSError as problem:
        if problem.errno in (errno.EBUSY, errno.EACCES):
            raise InputError("device.port_in_use", port=path) from None
        raise InputError("device.port_cannot_open", port=path, what=describe(problem)) from None
    return port
