"""`handscope process`: run a method over a recording and write its Motion-BIDS derivative."""

import argparse
from pathlib import Path

from app.commands.words import add_method, add_recording, method_of, output_folder, processed_by, say
from app.version import software_version
from sessions import derivative
from sessions.writing import save_folder


def add(parser: argparse.ArgumentParser) -> None:
    add_recording(parser)
    add_method(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the derivative")


def run(arguments: argparse.Namespace) -> int:
    method, params = method_of(arguments)
    recording, processed = processed_by(method, params, arguments)
    files = derivative.tree(processed, recording, arguments.method, params, software_version())
    save_folder(files, output_folder(arguments.out))
    for warning in processed.warnings:
        say(f"warning: {warning}")
    name = next(n for n in files if n.endswith("_motion.tsv"))
    say(f"{len(processed.trajectory)} samples by {arguments.method}: {arguments.out / name}")
    return 0
