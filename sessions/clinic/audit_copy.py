"""Lines of the audit trail to a place outside of the database as they are written, so that an end that was cut off is found.

`file:PATH`           JSON lines appended to a file
`tcp:HOST:PORT`       JSON lines to a collector, over one connection
`unix:PATH`           the same to a socket of this machine
`syslog:HOST[:PORT]`  RFC 5424 over UDP (514), facility log audit (13), the line as JSON
`head:PATH`           number and hash of the newest line alone, in a file that is replaced

Several have spaces between. A collector that cannot be reached is tried again after RETRY, and meanwhile holds nobody up. A copy that cannot be made is logged and stops nobody's work: `handscope audit verify --copy FILE` finds what the database lacks.
"""

import json
import logging
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sqlalchemy import event
from sqlalchemy.orm import Session, sessionmaker

from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe

log = logging.getLogger(__name__)
PRIORITY = 13 * 8 + 5  # facility log audit, severity notice
SYSLOG_PORT = 514
PATIENCE, RETRY = 1.0, 10.0  # s: for a collector, and until one that failed is tried again
Send = Callable[[Mapping[str, Any]], None]  # a line
WAITING = "audit_copies"  # lines of a transaction, in its session's info


def enable(database: sessionmaker[Session], targets: str) -> None:
    """From now on lines go there once they are committed, nowhere where it is ""; InputError where one is no place."""
    places = [_open_place(word) for word in targets.split()]

    def copy(db: Session) -> None:
        for row in db.info.pop(WAITING, ()):
            for send in places:
                try:
                    send(row)
                except OSError as problem:
                    log.error("line %s of the audit trail was not copied: %s", row["id"], problem.strerror or problem)  # fmt: skip

    event.listen(database, "after_commit", copy)
    event.listen(database, "after_rollback", _discard)


def _open_place(word: str) -> Send:
    kind, _, place = word.partition(":")
    if kind not in KINDS or not place or (kind == "tcp" and not _has_port(place)):
        raise InputError("clinic.audit_copy_place", target=word)
    return KINDS[kind](place)


def _discard(db: Session) -> None:
    db.info.pop(WAITING, None)


def add_waiting(db: Session, rows: list[dict[str, Any]]) -> None:
    """Lines that were written and are copied with their commit."""
    db.info.setdefault(WAITING, []).extend(rows)


def as_json(row: Mapping[str, Any]) -> str:
    """One line of the trail as one line of JSON, its hash among it."""
    at: datetime = row["at"]
    return json.dumps({**row, "at": at.astimezone(UTC).isoformat(timespec="microseconds")})


def read_heads(file: Path) -> Iterator[tuple[int, str]]:
    """Number and hash of each line of a copy; InputError where it is none."""
    try:
        with file.open(encoding="utf-8") as lines:
            for line in lines:
                row = json.loads(line)
                yield int(row["id"]), str(row["hash"])
    except OSError as problem:
        raise InputError("file.cannot_read", name=str(file), problem=describe(problem)) from None
    except (ValueError, KeyError, TypeError):
        raise InputError("clinic.not_an_audit_copy", file=str(file)) from None


def read_head(file: Path) -> tuple[int, str]:
    """Number and hash that `head:PATH` wrote; InputError where it is none."""
    try:
        number, _, digest = file.read_text("utf-8").strip().partition(":")
        return int(number), digest
    except OSError as problem:
        raise InputError("file.cannot_read", name=str(file), problem=describe(problem)) from None
    except ValueError:
        raise InputError("clinic.not_an_audit_head", file=str(file)) from None


def _append_to_file(place: str) -> Send:
    def send(row: Mapping[str, Any]) -> None:
        file = os.open(place, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
        try:
            os.write(file, as_json(row).encode() + b"\n")
        finally:
            os.close(file)

    return send


def _replace_head(place: str) -> Send:
    def send(row: Mapping[str, Any]) -> None:
        half = f"{place}.{os.getpid()}.{threading.get_ident()}"
        Path(half).write_text(f"{row['id']}:{row['hash']}\n", "utf-8")
        os.replace(half, place)

    return send


def _send_to_syslog(place: str) -> Send:
    host, port = _split_address(place) if _has_port(place) else (place, SYSLOG_PORT)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET

    def send(row: Mapping[str, Any]) -> None:
        moment = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        head = f"<{PRIORITY}>1 {moment} {socket.gethostname()} handscope {os.getpid()} audit - "
        with closing(socket.socket(family, socket.SOCK_DGRAM)) as sender:
            sender.sendto((head + as_json(row)).encode(), (host, port))

    return send


def _send_to_host(place: str) -> Send:
    return _Collector(lambda: socket.create_connection(_split_address(place), PATIENCE)).send


def _send_to_socket(place: str) -> Send:
    def connect() -> socket.socket:
        made = socket.socket(socket.AF_UNIX)
        made.settimeout(PATIENCE)
        made.connect(place)
        return made

    return _Collector(connect).send


class _Collector:
    """A connection that is made when a line is there, and again after it broke."""

    def __init__(self, connect: Callable[[], socket.socket]) -> None:
        self._connect, self._socket = connect, None
        self._lock, self._not_before = threading.Lock(), 0.0

    _socket: socket.socket | None

    def send(self, row: Mapping[str, Any]) -> None:
        with self._lock:
            if time.monotonic() < self._not_before:
                raise OSError("the collector could not be reached just now")
            try:
                if self._socket is None:
                    self._socket = self._connect()
                self._socket.sendall(as_json(row).encode() + b"\n")
            except OSError:
                if self._socket is not None:
                    self._socket.close()
                self._socket, self._not_before = None, time.monotonic() + RETRY
                raise


KINDS: Mapping[str, Callable[[str], Send]] = {
    "file": _append_to_file,
    "tcp": _send_to_host,
    "unix": _send_to_socket,
    "syslog": _send_to_syslog,
    "head": _replace_head,
}


def _has_port(place: str) -> bool:
    host, _, port = place.rpartition(":")
    return bool(host) and port.isdecimal()


def _split_address(place: str) -> tuple[str, int]:
    host, _, port = place.rpartition(":")
    return host.strip("[]"), int(port)
