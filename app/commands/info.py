"""`handscope info`: what a recording holds and what was cut."""

import argparse

from handscope.app.commands.methods import add_recording
from handscope.app.commands.shortfalls import shortfalls
from handscope.app.commands.words import say
from handscope.estimators.fault_detection.words import sentence
from handscope.estimators.recording_checks.check import suspicions_of
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
    for suspicion in suspicions_of(recording):
        say(f"{suspicion.message.severity}: {sentence(suspicion.message)}")
    say(f"sha256 {recording.checksum}")
    return 0
