"""What verbs share that run a method over a recording: the recording processed by what their arguments name."""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handscope.app.commands.words import progress_bar
from handscope.app.options import parse, with_options
from handscope.app.workers.deadline import LIMIT, limit_time
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.methods import ALL_METHODS, DEFAULT, default_for
from handscope.estimators.pipeline.method import AnyMethod
from handscope.estimators.pipeline.process import Processed, process
from handscope.estimators.recording_checks.check import check_processed
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.tables_io import calibration_result


def method_of(arguments: argparse.Namespace) -> tuple[AnyMethod[Any], Any]:
    """The method named, or the default, and its parameters."""
    name = arguments.method or DEFAULT
    if name not in ALL_METHODS:
        raise InputError("analysis.unknown_method", name=name, methods=", ".join(ALL_METHODS))
    module = ALL_METHODS[name]
    return module, with_options(module.Params, parse(arguments.option))


@dataclass(frozen=True)
class MethodRun:
    """What a method made of a recording, and by what."""

    recording: LoadedRecording
    processed: Processed
    method: str
    params: Any


MISMOUNTED = ("turned", "swapped")  # kinds of findings (estimators/alignment/mounting_checks.py)


def exit_code(verb: str, processed: Processed, out: Path) -> int:
    """2 with a line to standard error where a sensor is mounted otherwise than the recording says, though all was written; 0 else.

    Other faults, which may make a sensor look turned, are reported by warnings, flags and grades alone.
    """
    faulty = (s for s in processed.suspicions if s.message.severity == "fault")
    otherwise = {sensor for s in faulty for sensor in s.sensors}
    found = (f.sensor for f in processed.findings if f.kind in MISMOUNTED)
    wrong = dict.fromkeys(sensor for sensor in found if sensor not in otherwise)
    if not wrong:
        return 0
    line = phrase("command.at_fault", sensors=", ".join(wrong), out=str(out))
    print(f"handscope {verb}: {line}", file=sys.stderr)  # noqa: T201  the user's answer
    return 2


def run_method(arguments: argparse.Namespace, limit: float = LIMIT) -> MethodRun:
    """Run the method that the arguments name, or the one that suits the recording, over it within so many s; a bar shows how far it is.

    InputError for an unknown method or option and where the recording cannot be opened or calibrated.
    """
    if arguments.method is not None:
        method_of(arguments)  # refused before a long recording is read
    recording = formats_recordings.load(arguments.recording, arguments.hand)
    name = arguments.method or default_for(recording.streams)
    method, params = method_of(argparse.Namespace(method=name, option=arguments.option))
    found = arguments.calibration is not None and arguments.calibration.suffix == ".json"
    known = calibration_result.read(arguments.calibration) if found else None
    if known is not None and not method.CAPABILITIES.needs_pose:
        raise InputError("command.method_without_calibration", method=name)
    other = (
        formats_recordings.load(arguments.calibration, arguments.hand)
        if arguments.calibration and not found
        else None
    )
    on_progress, close = progress_bar("processing")
    try:
        made = process(method, params, recording, other, limit_time(limit, on_progress), known)
        return MethodRun(recording, check_processed(made, recording), name, params)
    finally:
        close()
