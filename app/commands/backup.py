"""`handscope backup`: everything in the data folder as one checked file, while the server runs."""

import argparse
import os
from pathlib import Path

from handscope.app.commands.words import add_store, counted, require_file, say
from handscope.app.version import software_version

RECIPIENTS = "HANDSCOPE_BACKUP_RECIPIENTS"


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "file",
        type=Path,
        metavar="FILE.zip",
        help="the backup to make; not inside the data folder, not there yet",
    )
    parser.add_argument(
        "--recipient",
        action="append",
        default=[],
        metavar="age1...",
        help="encrypt it for the key of which this is the public part (HANDSCOPE_BACKUP_RECIPIENTS, several with spaces between; handscope backup-key make)",
    )
    add_store(parser)


def run(arguments: argparse.Namespace) -> int:
    """0 where all is in; 1 where a recording was missing or damaged on the disk: it is named, everything else is in."""
    from handscope.sessions.store import backup  # here: not for --help

    require_file(arguments.file)
    recipients = arguments.recipient or os.environ.get(RECIPIENTS, "").split()
    made = backup.write(
        arguments.data, arguments.database, arguments.file, software_version(), recipients
    )
    for problem in made.problems:
        say(f"PROBLEM: {problem}")
    say(
        f"{counted(len(made.files), 'file')}, {made.bytes / 1e6:.1f} MB of {arguments.data}: {arguments.file}"
    )
    if made.audit:
        say(f"The audit trail's last line in it: {made.audit[0]}:{made.audit[1]}")
    return 1 if made.problems else 0
