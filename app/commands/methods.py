"""What verbs share that run a method over a recording: their arguments, and the recording processed."""

import argparse
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from handscope.app.commands.words import progress_bar
from handscope.app.options import help_text, parse, with_options
from handscope.app.workers.deadline import LIMIT, limit_time
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS
from handscope.estimators.methods import ALL_METHODS, DEFAULT
from handscope.estimators.pipeline.method import AnyMethod
from handscope.estimators.pipeline.process import Processed, process
from handscope.estimators.recording_checks.check import check_processed
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.tables_io import calibration_result


def add_recording(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that say what recording is meant."""
    parser.add_argument(
        "recording", type=Path, help="a Motion-BIDS folder or zip, or a native recording"
    )
    parser.add_argument(
        "--hand", choices=HANDS, help="the hand measured, where the recording does not say"
    )


def add_method(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that choose a method and its options."""
    parser.add_argument(
        "--method",
        default=DEFAULT,
        metavar="NAME",
        help=f"one of {', '.join(ALL_METHODS)} (default {DEFAULT})",
    )
    parser.add_argument(
        "--option",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="an option of the method, see below; may be repeated",
    )
    parser.add_argument(
        "--calibration",
        type=Path,
        metavar="RECORDING",
        help="take the calibration events from another recording, or what `map` found from its ..._calibration.json",
    )
    parser.epilog_for = _options_help  # type: ignore[attr-defined]  # a Parser of cli.py


def _options_help(given: Sequence[str]) -> str:
    """The methods, and the options of the one among the words given, or of the default."""
    words = [part for word in given for part in word.split("=", 1)]
    asked = next((b for a, b in pairwise(words) if a == "--method" and b in ALL_METHODS), DEFAULT)
    titles = "\n".join(f"  {name}: {m.TITLE}" for name, m in ALL_METHODS.items())
    options = help_text(ALL_METHODS[asked].Params)
    return f"methods (--method NAME --help lists the options of another):\n{titles}\n\noptions of {asked}:\n{options}"


def method_of(arguments: argparse.Namespace) -> tuple[AnyMethod[Any], Any]:
    """The method named and its parameters."""
    if arguments.method not in ALL_METHODS:
        raise InputError(
            "analysis.no_method", name=arguments.method, methods=", ".join(ALL_METHODS)
        )
    module = ALL_METHODS[arguments.method]
    return module, with_options(module.Params, parse(arguments.option))


def processed_by(
    method: AnyMethod[Any], params: Any, arguments: argparse.Namespace, limit: float = LIMIT
) -> tuple[LoadedRecording, Processed]:
    """The recording that the arguments name, and what the method makes of it within so many s; a bar shows how far it is."""
    recording = formats_recordings.load(arguments.recording, arguments.hand)
    found = arguments.calibration is not None and arguments.calibration.suffix == ".json"
    known = calibration_result.read(arguments.calibration) if found else None
    if known is not None and not method.CAPABILITIES.needs_pose:
        raise InputError("command.method_does_not_use", method=arguments.method)
    other = (
        formats_recordings.load(arguments.calibration, arguments.hand)
        if arguments.calibration and not found
        else None
    )
    on_progress, close = progress_bar("processing")
    try:
        made = process(method, params, recording, other, limit_time(limit, on_progress), known)
        return recording, check_processed(made, recording)
    finally:
        close()
