"""`handscope samples`: small simulated recordings with their truth, made from seeds."""

import argparse
from pathlib import Path

from handscope.app.analysis.samples import SAMPLES, make
from handscope.app.commands.words import output_folder, say
from handscope.estimators.errors import InputError


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"some of {', '.join(SAMPLES)} (all)"
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="folder for NAME.zip, CC0"
    )
    parser.epilog = "\n".join(f"{name}: {sample.title}" for name, sample in SAMPLES.items())


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    names = arguments.names or list(SAMPLES)
    if unknown := [name for name in names if name not in SAMPLES]:
        raise InputError("analysis.unknown_sample", name=unknown[0], samples=", ".join(SAMPLES))
    folder = output_folder(arguments.out)
    for name in names:
        made = make(name, folder)
        say(f"{SAMPLES[name].title}, {made.stat().st_size / 1e6:.1f} MB: {made}")
    return 0
