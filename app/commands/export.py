"""`handscope export`: any recording as Motion-BIDS."""

import argparse
from pathlib import Path

from app.commands.words import add_recording, output_folder, say
from estimators.errors import InputError
from sessions import formats, motion_bids


def add(parser: argparse.ArgumentParser) -> None:
    add_recording(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR|FILE.zip")
    parser.add_argument("--subject", default="01", metavar="LABEL", help="BIDS label of the subject")
    parser.add_argument("--task", default="hand", metavar="LABEL", help="BIDS label of the task")


def run(arguments: argparse.Namespace) -> int:
    for option in ("subject", "task"):
        if not getattr(arguments, option).isalnum():
            raise InputError(f"--{option} {getattr(arguments, option)!r} may have letters and digits only")
    recording = formats.load(arguments.recording, arguments.hand)
    target = arguments.out if arguments.out.suffix == ".zip" else output_folder(arguments.out)
    motion_bids.write(recording, target, arguments.subject, arguments.task)
    say(f"{len(recording.samples)} streams, {recording.duration:.1f} s: {arguments.out}")
    return 0
