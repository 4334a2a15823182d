"""`handscope restore`: put a backup into an empty data folder."""

import argparse
from pathlib import Path
from typing import Any

from handscope.app.commands.words import counted, database_url, progress_bar, say
from handscope.estimators.errors import InputError


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "file", type=Path, metavar="FILE.zip", help="a backup made by handscope backup"
    )
    parser.add_argument(
        "--data",
        type=Path,
        metavar="DIR",
        help="the folder to restore into: empty, or not there yet",
    )
    parser.add_argument(
        "--database",
        default=database_url(),
        metavar="URL",
        help="restore rows into this empty database instead of SQLite in the folder",
    )
    parser.add_argument(
        "--key",
        type=Path,
        action="append",
        default=[],
        metavar="KEYFILE",
        help="the key of an encrypted backup",
    )
    parser.add_argument(
        "--check", action="store_true", help="only read the backup and compare every checksum"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    from handscope.sessions.store import backup  # here: not for --help
    from handscope.sessions.store.sealed_files import unsealed

    if arguments.check:
        with unsealed(arguments.file, arguments.key) as plain:
            manifest = backup.check(plain)
        say(f"{arguments.file} is whole: {_manifest_words(manifest)}")
        return 0
    if arguments.data is None:
        raise InputError("command.restore_where")
    hear, close = progress_bar("restoring")
    beside = arguments.data.absolute().parent
    beside.mkdir(parents=True, exist_ok=True)
    try:
        with unsealed(arguments.file, arguments.key, beside) as plain:
            manifest = backup.restore(plain, arguments.data, arguments.database, hear)
    finally:
        close()
    say(
        f"{_manifest_words(manifest)}\nStart it with: handscope serve --data {arguments.data}{' --database ...' if arguments.database else ''}"
    )
    return 0


def _manifest_words(manifest: dict[str, Any]) -> str:
    return f"{counted(len(manifest['files']), 'file')} of {manifest['made']}, made by version {manifest['software']}"
