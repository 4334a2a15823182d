"""Lines of the audit trail to a place outside of the database as they are written, so that an end that was cut off is found.

`file:PATH`           JSON lines appended to a file
`syslog:HOST[:PORT]`  RFC 5424 over UDP (514), facility log audit (13), the line as JSON

A copy that cannot be made is logged and stops nobody's work: `handscope audit verify --copy FILE` finds what the database lacks.
"""

import json
import logging
import os
import socket
from collections.abc import Iterator, Mapping
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sqlalchemy import event
from sqlalchemy.orm import Session, sessionmaker

from handscope.estimators.errors import InputError

log = logging.getLogger(__name__)
PRIORITY = 13 * 8 + 5  # facility log audit, severity notice
SYSLOG_PORT = 514
WAITING = "audit_copies"  # lines of a transaction, in its session's info


def enable(database: sessionmaker[Session], target: str) -> None:
    """From now on lines go there once they are committed, nowhere where it is ""; InputError where it is no place."""
    if not target:
        event.listen(database, "after_commit", _discard)
        return
    kind, _, place = target.partition(":")
    if kind not in ("file", "syslog") or not place:
        raise InputError(
            f"{target!r} is no place for the audit trail; file:PATH or syslog:HOST:PORT"
        )
    send = _append_to_file if kind == "file" else _send_to_syslog

    def copy(db: Session) -> None:
        for row in db.info.pop(WAITING, ()):
            try:
                send(place, as_json(row))
            except OSError as problem:
                log.error(
                    "line %s of the audit trail was not copied: %s", row["id"], problem.strerror
                )

    event.listen(database, "after_commit", copy)
    event.listen(database, "after_rollback", _discard)


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
        raise InputError(f"{file} cannot be read: {problem.strerror}") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{file} is no copy of the audit trail") from None


def _append_to_file(place: str, line: str) -> None:
    file = os.open(place, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
    try:
        os.write(file, line.encode() + b"\n")
    finally:
        os.close(file)


def _send_to_syslog(place: str, line: str) -> None:
    host, _, port = place.rpartition(":")
    address = (host, int(port)) if host and port.isdecimal() else (place, SYSLOG_PORT)
    moment = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    head = f"<{PRIORITY}>1 {moment} {socket.gethostname()} handscope {os.getpid()} audit - "
    family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
    with closing(socket.socket(family, socket.SOCK_DGRAM)) as sender:
        sender.sendto((head + line).encode(), address)
