"""`handscope audit`: read the audit trail, and verify that nobody changed it. Exit code 1 where it does not hold."""

import argparse
import getpass
import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path

from sqlalchemy.orm import Session

from handscope.app.commands.words import add_store, say
from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit
from handscope.sessions.clinic.audit_copy import read_head, read_heads
from handscope.sessions.db.tables import AuditLine
from handscope.sessions.store import backup
from handscope.sessions.store.database import FILE, open_database
from handscope.sessions.store.sealed_files import unsealed

BROKEN = 1  # exit code


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    verify = actions.add_parser(
        "verify", help="go along the chain of hashes from the first line to the last"
    )
    verify.add_argument(
        "--against",
        action="append",
        default=[],
        type=_parse_noted,
        metavar="NUMBER:HASH",
        help="a last line that was noted before, elsewhere",
    )
    verify.add_argument(
        "--backup",
        action="append",
        default=[],
        type=Path,
        metavar="FILE",
        help="a backup of this server: its note of the last line counts",
    )
    verify.add_argument(
        "--key",
        action="append",
        default=[],
        type=Path,
        metavar="KEYFILE",
        help="the key of an encrypted backup",
    )
    verify.add_argument(
        "--copy",
        action="append",
        default=[],
        type=Path,
        metavar="FILE",
        help="a copy of the trail (HANDSCOPE_AUDIT_COPY=file:FILE): all its lines count",
    )
    verify.add_argument(
        "--head",
        action="append",
        default=[],
        type=Path,
        metavar="FILE",
        help="the newest line's note (HANDSCOPE_AUDIT_COPY=head:FILE)",
    )
    listed = actions.add_parser("list", help="lines, the newest first")
    listed.add_argument("--who", default="", metavar="NAME", help="of one account")
    listed.add_argument(
        "--what",
        default="",
        metavar="WORD",
        help="viewed, created, changed, exported, erased, refused, ...",
    )
    listed.add_argument(
        "--patient",
        type=int,
        metavar="NUMBER",
        help="about one patient, by the number in the page's address",
    )
    listed.add_argument(
        "--most", type=int, default=100, metavar="N", help="so many lines (%(default)s)"
    )
    for sub in (verify, listed):
        add_store(sub)


def _head_of(file: Path, keys: list[Path]) -> tuple[int, str]:
    """The last line that a backup notes."""
    with unsealed(file, keys) as plain:
        return backup.read_audit_head(plain)


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    if not arguments.database and not (arguments.data / FILE).is_file():
        raise InputError("command.no_database", data=arguments.data)
    noted = (
        [
            *arguments.against,
            *(_head_of(file, arguments.key) for file in arguments.backup),
            *chain.from_iterable(map(read_heads, arguments.copy)),
            *map(read_head, arguments.head),
        ]
        if arguments.action == "verify"
        else []
    )
    with open_audited(arguments.data, arguments.database) as db:
        if arguments.action == "list":
            for line in audit.list_lines(
                db, arguments.who, arguments.what, arguments.patient, limit=arguments.most
            ):
                say(_line_words(line))
            return 0
        found = audit.verify(db, noted)
    if found.broken:
        say(f"The audit trail does not hold: {found.broken}. The {found.lines} lines before hold.")
        return BROKEN
    if found.back:
        say(
            f"Line {found.back} is of an earlier time than line {found.back - 1}: was this machine's clock set back then?"
        )
    if found.unguarded:
        say(
            f"The triggers {', '.join(found.unguarded)} are gone or changed, which refuse changes of the trail: who did that? The chain of its {found.lines} lines holds, up to {found.lines}:{found.last}."
        )
        return BROKEN
    say(
        f"The audit trail holds: {found.lines} lines. Note the last one elsewhere, to verify against it: {found.lines}:{found.last}"
    )
    return 0


@contextmanager
def open_audited(folder: Path, url: str | None) -> Iterator[Session]:
    """The database of a data folder, also of a server that runs, in the name of who types the command."""
    if not folder.is_dir():
        raise InputError("command.no_data_folder", folder=str(folder))
    database = open_database(folder, url)
    with database() as db:
        audit.set_actor(db, f"command line: {_user_name()}"[:64], "")
        yield db
    database.kw["bind"].dispose()


def _user_name() -> str:
    """Of who types the command; the number where the system has no name for it, as in a container of any user."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # until and since Python 3.13
        return str(os.getuid())


def _line_words(line: AuditLine) -> str:
    about = " ".join(word for word in (line.what, line.kind, line.ref) if word)
    whose = (
        f" of patient {line.patient}" if line.patient is not None and line.kind != "patient" else ""
    )
    more = "".join(f" {name}={value}" for name, value in line.counts.items())
    return f"{line.id:6} {line.at:%Y-%m-%d %H:%M:%S} {line.who or '-':16} {line.address or '-':15} {about}{whose}{more}"


def _parse_noted(word: str) -> tuple[int, str]:
    number, _, total = word.partition(":")
    if not number.isdecimal() or len(total) != len(audit.NOTHING):
        raise argparse.ArgumentTypeError(f"{word!r} is not of the form NUMBER:HASH")
    return int(number), total
