"""`handscope info`: what a recording holds and what was cut."""

import argparse

from handscope.app.commands.methods import add_recording
from handscope.app.commands.shortfalls import shortfalls
from handscope.app.commands.words import say
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.errors import InputError
from handscope.estimators.fault_detection.check import check_recording
from handscope.estimators.fault_detection.words import sentence
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats_recordings


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_recording(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    recording = formats_recordings.load(arguments.recording, arguments.hand)
    say(
        f"{recording.hand} hand, {recording.duration:.3f} s, {recording.source.get('format', '')} {recording.source.get('device', '')}".rstrip()
    )
    for name, block in recording.samples.items():
        s = block.stream
        lost = recording.losses.get(name)
        say(
            f"  {name}: {len(block.t)} samples of {', '.join(s.sensors)} ({', '.join(s.quantities)}) at {s.rate:g} Hz{f', {lost} lost' if lost else ''}"
        )
    for event in recording.events:
        details = " ".join(f"{k}={v}" for k, v in event.details.items())
        say(
            f"  {event.onset:9.3f} s  {event.duration:7.3f} s  {event.trial_type} {details}".rstrip()
        )
    for shortfall in shortfalls(recording):
        say(f"warning: {shortfall}")
    blocks = [block for block in recording.samples.values() if len(block.t)]
    for suspicion in check_recording(blocks, recording, _calibrations(recording)):
        say(f"{suspicion.message.severity}: {sentence(suspicion.message)}")
    say(f"sha256 {recording.checksum}")
    return 0


def _calibrations(recording: LoadedRecording) -> list[Calibration]:
    """How sensors sit on their segments by the recording's poses; none where they do not tell it."""
    try:
        return calibrate(m2.Params(), recording)[0]
    except InputError:
        return []
