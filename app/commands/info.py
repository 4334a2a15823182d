"""`handscope info`: what a recording holds, what was cut, and what the checks find; without estimating."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from handscope.app.commands.method_arguments import add_recording
from handscope.app.commands.words import require_file, say

if TYPE_CHECKING:
    from handscope.estimators.fault_detection.finding import Suspicion, Untested
    from handscope.sessions.files.recording import LoadedRecording


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_recording(parser)
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="write it there, too; findings by their codes"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    from handscope.app.commands.shortfalls import shortfalls  # here: not for --help
    from handscope.estimators.fault_detection.words import sentence
    from handscope.estimators.recording_checks.check import suspicions_of, untested_of
    from handscope.sessions.formats import recordings as formats_recordings
    from handscope.sessions.tables_io.writing import save_file

    if arguments.json:
        require_file(arguments.json)
    recording = formats_recordings.load(arguments.recording, arguments.hand)
    suspicions, cut = suspicions_of(recording), list(shortfalls(recording))
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
    for shortfall in cut:
        say(f"warning: {shortfall}")
    for suspicion in suspicions:
        say(f"{suspicion.message.severity}: {sentence(suspicion.message)}")
    untested = untested_of(recording, suspicions)
    for message in untested.messages:
        say(f"{message.severity}: {sentence(message)}")
    say(f"sha256 {recording.checksum}")
    if arguments.json:
        table = _table(recording, cut, suspicions, untested)
        save_file((json.dumps(table, indent=1) + "\n").encode(), arguments.json)
    return 0


def _table(
    recording: "LoadedRecording",
    cut: Sequence[str],
    suspicions: "Sequence[Suspicion]",
    untested: "Untested",
) -> dict[str, Any]:
    from handscope.estimators.fault_detection.words import sentence
    from handscope.sessions.formats.derivative import finding_table, untested_table

    streams = [
        {
            "name": name,
            "samples": len(block.t),
            "sensors": list(block.stream.sensors),
            "quantities": list(block.stream.quantities),
            "rate": block.stream.rate,
            "lost": recording.losses.get(name),
        }
        for name, block in recording.samples.items()
    ]
    events = [
        {
            "onset": e.onset,
            "duration": e.duration,
            "trial_type": e.trial_type,
            "details": dict(e.details),
        }
        for e in recording.events
    ]
    return {
        "hand": recording.hand,
        "duration": recording.duration,
        "streams": streams,
        "events": events,
        "warnings": list(cut),
        "findings": [{**finding_table(s), "sentence": sentence(s.message)} for s in suspicions],
        "untested": untested_table(untested),
        "sha256": recording.checksum,
    }
