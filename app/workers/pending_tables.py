"""Tables of other loggers that were uploaded and are being mapped: each waits in a folder of its own until it is imported, or given up.

Only the login that sent a table has access to it. The newest MOST of a login are there, for LIFETIME; a server that starts anew has none.
"""

import re
import shutil
import threading
import time
import uuid
from dataclasses import dataclass, field
from pathlib import Path

from handscope.estimators.errors import InputError

MOST = 3  # of a login
LIFETIME = 4 * 3600.0  # s
LONGEST = 120  # characters of a name
UNSAFE = re.compile(r"[^\w .()+-]+")


def safe_name(name: str) -> str:
    """The last part of a name without what a file system may not take; its ending stays."""
    path = Path(UNSAFE.sub("_", re.split(r"[/\\]", name)[-1]))
    stem = path.stem.lstrip(".")[:LONGEST] or "table"
    return stem + path.suffix[:16]


@dataclass(frozen=True)
class PendingTable:
    """A table that is being mapped."""

    number: str
    patient: int
    login: int
    path: Path  # its name is the file's own, as far as it is safe
    since: float = field(default_factory=time.monotonic)


class PendingTables:
    """By their numbers; any thread may call."""

    def __init__(self) -> None:
        self._tables: dict[str, PendingTable] = {}
        self._lock = threading.Lock()

    def add(self, folder: Path, patient: int, login: int, name: str) -> PendingTable:
        """A place for a table in a new folder within `folder`; those that are too old or too many make room."""
        number = uuid.uuid4().hex
        (folder / number).mkdir(mode=0o700)
        table = PendingTable(number, patient, login, folder / number / safe_name(name))
        with self._lock:
            old = [t for t in self._tables.values() if time.monotonic() - t.since > LIFETIME]
            own = [t for t in self._tables.values() if t.login == login and t not in old]
            for one in (*old, *own[: max(0, len(own) - MOST + 1)]):
                self._remove(one)
            self._tables[number] = table
        return table

    def get(self, number: str, patient: int, login: int) -> PendingTable:
        """InputError where there is none that this login sent for this patient."""
        with self._lock:
            table = self._tables.get(number)
        if table is None or (table.patient, table.login) != (patient, login):
            raise InputError("import.no_pending_table")
        return table

    def remove(self, table: PendingTable) -> None:
        """Remove it with its file."""
        with self._lock:
            self._remove(table)

    def _remove(self, table: PendingTable) -> None:
        self._tables.pop(table.number, None)
        shutil.rmtree(table.path.parent, ignore_errors=True)
