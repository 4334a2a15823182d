"""What all verbs share: words for the terminal, where data is kept, places to write to. No numerics: `login` and its like begin at once."""

import argparse
import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe

FOLDER = "handscope-data"  # in the user's home


def add_store(parser: argparse.ArgumentParser) -> None:
    """Declare where a server's data are, for verbs that read or write them beside it."""
    parser.add_argument(
        "--data",
        type=Path,
        default=default_data(),
        metavar="DIR",
        help="the server's data folder (%(default)s)",
    )
    parser.add_argument(
        "--database",
        default=database_url(),
        metavar="URL",
        help="the server's database, where it is not SQLite in the data folder",
    )


def say(text: str) -> None:
    """To standard output."""
    print(text, flush=True)  # noqa: T201  the command's answer


def program() -> str:
    """How a shell finds this program: by its name, or as it was started where the name is not on PATH or is another's."""
    started = Path(sys.argv[0])
    if started.stem != "handscope":  # a module, or a test
        return "handscope"
    found = shutil.which("handscope")
    is_found = found is not None and os.path.realpath(found) == os.path.realpath(started)
    return "handscope" if is_found else str(started)


def default_data(folder: str = FOLDER) -> Path:
    """Where data is kept when nobody says: HANDSCOPE_DATA, or a folder in the user's home."""
    return Path(os.environ.get("HANDSCOPE_DATA") or Path.home() / folder)


def database_url() -> str | None:
    """The database where nobody says: HANDSCOPE_DATABASE (a password on the command line is seen by every user of the machine), or none."""
    return os.environ.get("HANDSCOPE_DATABASE") or None


def seed(word: str) -> int:
    """A seed: a whole number from 0 on."""
    if not word.isdecimal():
        raise argparse.ArgumentTypeError(f"{word} is no whole number from 0 on")
    return int(word)


def progress_bar(what: str) -> tuple[Callable[[float], None], Callable[[], None]]:
    """A progress bar on a terminal: a function that hears the share done, and one that closes it."""
    if not sys.stderr.isatty():
        return lambda share: None, lambda: None
    from tqdm import tqdm  # 0.04 s of every start

    bar = tqdm(
        total=100,
        desc=what,
        unit="%",
        leave=False,
        bar_format="{l_bar}{bar}| {n:.0f} % [{elapsed}]",
    )

    def hear(share: float) -> None:
        bar.update(100 * share - bar.n)

    return hear, bar.close


def counted(n: int, what: str) -> str:
    """A number of things in words: 1 figure, 2 figures."""
    return f"{n} {what}{'' if n == 1 else 's'}"


def read_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file."""
    try:
        value = json.loads(path.read_text("utf-8"))
        if not isinstance(value, dict):
            raise ValueError("it holds no object")
    except (OSError, ValueError) as problem:
        raise InputError("command.json_unreadable", path=str(path), problem=str(problem)) from None
    return value


def output_folder(path: Path) -> Path:
    """A folder to write to, made where it is missing; InputError where that cannot be."""
    require_folder(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InputError(
            "command.folder_cannot_be_made", path=str(path), strerror=describe(problem)
        ) from None
    return path


def require_folder(path: Path) -> None:
    """InputError where no folder can be made or written to; makes nothing, so that a command can ask before it computes."""
    if path.exists() and not path.is_dir():
        raise InputError("command.file_in_place_of_folder", path=str(path))
    above = next(p for p in (path, *path.absolute().parents) if p.exists())
    if not above.is_dir():
        raise InputError("command.folder_over_file", path=str(path), above=str(above))
    if not os.access(above, os.W_OK):
        raise InputError("command.no_permission_folder", path=str(path), above=str(above))


def require_file(path: Path, made: Path | None = None) -> None:
    """InputError where no file can be written; makes nothing. `made`: a folder that will be there by then."""
    if path.is_dir():
        raise InputError("command.folder_in_place_of_file", path=str(path))
    folder = path.absolute().parent
    if made is not None and folder == made.absolute():
        return
    if not folder.is_dir():
        raise InputError("command.folder_missing", parent=str(path.parent), name=path.name)
    if not os.access(folder, os.W_OK):
        raise InputError("command.no_permission_file", path=str(path), parent=str(path.parent))


def add_actions(
    parser: argparse.ArgumentParser, actions: Mapping[str, str]
) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Declare what a verb does to named things of a server's data; each action but `list` takes a name."""
    subparsers = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    for action, meaning in actions.items():
        sub = subparsers.add_parser(action, help=meaning, description=meaning)
        add_store(sub)
        if action != "list":
            sub.add_argument("name", metavar="NAME")
        yield action, sub
