"""Arguments that several verbs share, and what they print."""

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from tqdm import tqdm

from app.options import help_text, parse, with_options
from app.time_limit import LIMIT, within
from estimators.errors import InputError
from estimators.hand_anatomy import HANDS
from estimators.methods import ALL_METHODS
from estimators.processing import Processed, process
from sessions import calibration_result, formats
from sessions.recording import LoadedRecording


def say(text: str) -> None:
    """To standard output."""
    print(text, flush=True)  # noqa: T201  the command's answer


def add_recording(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", type=Path, help="a Motion-BIDS folder or zip, or a native recording")
    parser.add_argument("--hand", choices=HANDS, help="the hand measured, where the recording does not say")


def add_method(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--method", default="m2", metavar="NAME", help=f"one of {', '.join(ALL_METHODS)} (default m2)")
    parser.add_argument(
        "--option", action="append", default=[], metavar="KEY=VALUE", help="an option of the method, see below; may be repeated"
    )
    parser.add_argument(
        "--calibration",
        type=Path,
        metavar="RECORDING",
        help="take the calibration events from another recording, or what `map` found from its ..._calibration.json",
    )
    parser.epilog = "methods and their options:\n" + "\n".join(
        f"\n{name}: {m.TITLE}\n{help_text(m.Params)}" for name, m in ALL_METHODS.items()
    )


def seed(word: str) -> int:
    """A seed: a whole number from 0 on."""
    if not word.isdecimal():
        raise argparse.ArgumentTypeError(f"{word} is no whole number from 0 on")
    return int(word)


def method_of(arguments: argparse.Namespace) -> tuple[ModuleType, Any]:
    """The method named and its parameters."""
    if arguments.method not in ALL_METHODS:
        raise InputError(f"there is no method {arguments.method!r}; methods are {', '.join(ALL_METHODS)}")
    module = ALL_METHODS[arguments.method]
    return module, with_options(module.Params, parse(arguments.option))


def processed_by(method: ModuleType, params: Any, arguments: argparse.Namespace, limit: float = LIMIT) -> tuple[LoadedRecording, Processed]:
    """The recording that the arguments name, and what the method makes of it within so many s; a bar shows how far it is."""
    recording = formats.load(arguments.recording, arguments.hand)
    found = arguments.calibration is not None and arguments.calibration.suffix == ".json"
    known = calibration_result.read(arguments.calibration) if found else None
    if known is not None and not method.NEEDS_POSE:
        raise InputError(f"method {arguments.method} does not use an earlier calibration; m1, m2 and ekf do")
    other = formats.load(arguments.calibration, arguments.hand) if arguments.calibration and not found else None
    hear, close = progress_bar("processing")
    try:
        return recording, process(method, params, recording, other, within(limit, hear), known)
    finally:
        close()


def progress_bar(what: str) -> tuple[Callable[[float], None], Callable[[], None]]:
    """A progress bar on a terminal: a function that hears the share done, and one that closes it."""
    bar = tqdm(
        total=100, desc=what, unit="%", disable=not sys.stderr.isatty(), leave=False, bar_format="{l_bar}{bar}| {n:.0f} % [{elapsed}]"
    )

    def hear(share: float) -> None:
        bar.update(100 * share - bar.n)

    return hear, bar.close


def counted(n: int, what: str) -> str:
    """A number of things in words: 1 figure, 2 figures."""
    return f"{n} {what}{'' if n == 1 else 's'}"


def output_folder(path: Path) -> Path:
    """A folder to write to, made where it is missing; InputError where that cannot be."""
    require_folder(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InputError(f"{path} cannot be made: {problem.strerror}") from None
    return path


def require_folder(path: Path) -> None:
    """InputError where no folder can be made or written to; makes nothing, so that a command can ask before it computes."""
    if path.exists() and not path.is_dir():
        raise InputError(f"{path} is a file; --out names a folder")
    above = next(p for p in (path, *path.absolute().parents) if p.exists())
    if not above.is_dir():
        raise InputError(f"{path} cannot be made: {above} is a file")
    if not os.access(above, os.W_OK):
        raise InputError(f"{path} cannot be written to: no permission for {above}")


def require_file(path: Path, made: Path | None = None) -> None:
    """InputError where no file can be written; makes nothing. `made`: a folder that will be there by then."""
    if path.is_dir():
        raise InputError(f"{path} is a folder; name a file in it")
    folder = path.absolute().parent
    if made is not None and folder == made.absolute():
        return
    if not folder.is_dir():
        raise InputError(f"there is no folder {path.parent} for {path.name}; make it first or choose another place")
    if not os.access(folder, os.W_OK):
        raise InputError(f"{path} cannot be written: no permission for {path.parent}")
