"""`handscope backup-key`: make the key for encrypted backups, and seal backups for another one."""

import argparse
from pathlib import Path

from handscope.app.commands.words import say
from handscope.sessions.store import sealed_files


def add(parser: argparse.ArgumentParser) -> None:
    """Its options."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    make = actions.add_parser("make", help="a new key; prints the recipient that backups name")
    make.add_argument(
        "key", type=Path, metavar="KEYFILE", help="the file to make; keep it elsewhere"
    )
    change = actions.add_parser("change", help="seal backups for another key, in their place")
    change.add_argument("files", type=Path, nargs="+", metavar="FILE.zip.age")
    change.add_argument("--key", type=Path, action="append", required=True, metavar="KEYFILE", help="that opens them now")  # fmt: skip
    change.add_argument("--recipient", action="append", required=True, metavar="age1...", help="whose key opens them from now on; may be given more than once")  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Do it; 0."""
    if arguments.action == "make":
        recipient = sealed_files.make_key(arguments.key)
        say(
            f"{arguments.key} is the key: without it no backup opens; keep it, and a copy, away from the server.\n"
            f"Backups are sealed for it with: handscope backup FILE.zip.age --recipient {recipient}"
        )
        return 0
    for file in arguments.files:
        sealed_files.reseal(file, arguments.key, arguments.recipient)
        say(f"{file} is sealed anew")
    return 0
