"""`handscope data-key`: make the key that seals a data folder, seal the files that are not, change the key."""

import argparse
import os
from base64 import b64decode, b64encode
from collections.abc import Callable
from pathlib import Path

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from handscope.app.commands.words import add_store, counted, say
from handscope.estimators.errors import InputError
from handscope.sessions.db.tables import HandPhotograph
from handscope.sessions.files.recorder import is_being_written
from handscope.sessions.sealing import rotation
from handscope.sessions.sealing.keys import VARIABLE, keys_of_this_process, make_key, read_key
from handscope.sessions.sealing.stored import is_sealed, is_sealed_data, seal_bytes
from handscope.sessions.store.store import store_at


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    make = actions.add_parser("make", help="a new key")
    make.add_argument("key", type=Path, metavar="KEYFILE", help="the file to make; keep a copy elsewhere")  # fmt: skip
    seal = actions.add_parser("seal", help=f"seal what lies in a data folder plain, by the key of {VARIABLE}")  # fmt: skip
    add_store(seal)
    change = actions.add_parser("change", help="another key for what is sealed in a data folder")
    change.add_argument("--key", type=Path, action="append", required=True, metavar="KEYFILE", help="that opens it now; may be given more than once")  # fmt: skip
    change.add_argument("--new", type=Path, required=True, metavar="KEYFILE", help="that alone opens it from now on")  # fmt: skip
    add_store(change)


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code, 1 where files could not be sealed yet."""
    if arguments.action == "make":
        make_key(arguments.key)
        say(
            f"{arguments.key} is the key: without it nothing that it seals opens; keep a copy away from the server.\n"
            f"Start the server, and every command on its data folder, with {VARIABLE}={arguments.key}"
        )
        return 0
    if not arguments.data.is_dir():
        raise InputError("command.no_data_folder", folder=str(arguments.data))
    return _seal(arguments) if arguments.action == "seal" else _change(arguments)


def _seal(arguments: argparse.Namespace) -> int:
    if not keys_of_this_process():
        raise InputError("sealing.no_key_named", variable=VARIABLE)
    files = list(rotation.stored_files(arguments.data))
    being_written = [path for path in files if not is_sealed(path) and is_being_written(path)]
    sealed = sum(rotation.seal_file(path) for path in files if path not in being_written)
    sealed += _change_pictures(arguments, lambda data: data if is_sealed_data(data) else seal_bytes(data))  # fmt: skip
    say(f"{counted(sealed, 'file')} sealed, {len(files) - sealed - len(being_written)} were")
    return _report_left(being_written, "is being recorded: once more when its session is finished")


def _change(arguments: argparse.Namespace) -> int:
    keys, new = [read_key(file) for file in arguments.key], read_key(arguments.new)
    files = [path for path in rotation.stored_files(arguments.data) if is_sealed(path)]
    changed = sum(rotation.change_key(path, keys, new) for path in files)
    changed += _change_pictures(arguments, lambda data: rotation.change_key_of_bytes(data, keys, new) if is_sealed_data(data) else data)  # fmt: skip
    say(
        f"{counted(changed, 'file')} of another key before, all {len(files)} sealed ones open by {arguments.new} alone.\n"
        f"Set {VARIABLE} to it; backups and files in an object storage need the earlier key still."
    )
    return 0


def _change_pictures(arguments: argparse.Namespace, change: Callable[[bytes], bytes]) -> int:
    """Change the photographs, which are stored in the database; returns how many were changed."""
    store, changed = store_at(arguments.data, arguments.database), 0
    with store.database() as db:
        kept = select(HandPhotograph.id, HandPhotograph.picture)
        for number, picture in [(n, p) for n, p in db.execute(kept) if p is not None]:
            before = b64decode(picture)
            if (after := change(before)) != before:
                _put(db, number, after)
                changed += 1
        db.commit()
    store.close()
    return changed


def _put(db: Session, number: int, picture: bytes) -> None:
    text = b64encode(picture).decode()
    db.execute(update(HandPhotograph).where(HandPhotograph.id == number).values(picture=text))


def _report_left(paths: list[Path], why: str) -> int:
    """Name the files that were left, and why; returns the exit code."""
    for path in paths:
        say(f"{os.path.basename(path)} {why}")
    return 1 if paths else 0
