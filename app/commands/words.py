"""Arguments that several verbs share, and what they print."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from tqdm import tqdm

from app.options import help_text, parse, with_options
from estimators.errors import InputError
from estimators.hand_anatomy import HANDS
from estimators.methods import METHODS


def say(text: str) -> None:
    """To standard output."""
    print(text, flush=True)  # noqa: T201  the command's answer


def add_recording(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path, help="a Motion-BIDS folder or zip, or a native recording")
    parser.add_argument("--hand", choices=HANDS, help="the hand measured, where the recording does not say")


def add_method(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--method", default="m2", metavar="NAME", help=f"one of {', '.join(METHODS)} (default m2)")
    parser.add_argument(
        "--option", action="append", default=[], metavar="KEY=VALUE", help="an option of the method, see below; may be repeated"
    )
    parser.add_argument("--calibration", type=Path, metavar="RECORDING", help="take the calibration events from another recording")
    parser.epilog = "methods and their options:\n" + "\n".join(f"\n{name}: {m.TITLE}\n{help_text(m.Params)}" for name, m in METHODS.items())


def method_of(arguments: argparse.Namespace) -> tuple[ModuleType, Any]:
    """The method named and its parameters."""
    if arguments.method not in METHODS:
        raise InputError(f"there is no method {arguments.method!r}; methods are {', '.join(METHODS)}")
    module = METHODS[arguments.method]
    return module, with_options(module.Params, parse(arguments.option))


def progress_bar(what: str) -> tuple[Callable[[float], None], Callable[[], None]]:
    """A progress bar on a terminal: a function that hears the share done, and one that closes it."""
    bar = tqdm(
        total=100, desc=what, unit="%", disable=not sys.stderr.isatty(), leave=False, bar_format="{l_bar}{bar}| {n:.0f} % [{elapsed}]"
    )

    def hear(share: float) -> None:
        bar.update(100 * share - bar.n)

    return hear, bar.close


def output_folder(path: Path) -> Path:
    """A folder to write to; InputError where that cannot be."""
    if path.exists() and not path.is_dir():
        raise InputError(f"{path} is a file; --out names a folder")
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InputError(f"{path} cannot be made: {problem.strerror}") from None
    return path
