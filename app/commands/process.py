"""`handscope process`: run a method over a recording, or over a cohort's, and write Motion-BIDS derivatives."""

import argparse
import os
from pathlib import Path

from handscope.app.commands.method_arguments import add_method
from handscope.app.commands.words import counted, output_folder, progress_bar, say
from handscope.app.version import software_version
from handscope.app.workers.deadline import LIMIT
from handscope.estimators.errors import InputError
from handscope.estimators.hand.sides import HANDS
from handscope.sessions.exports import FORMATS, format_of


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "recording", type=Path, nargs="?", help="a Motion-BIDS folder or zip, or a native recording"
    )
    parser.add_argument(
        "--hand", choices=HANDS, help="the hand measured, where the recording does not say"
    )
    add_method(parser)
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="folder for the derivative; a folder in it for each of a cohort",
    )
    parser.add_argument(
        "--time-limit",
        type=float,
        default=LIMIT,
        metavar="S",
        help="end after so many seconds with what is done, or with a refusal (%(default)g; always that with --cohort)",
    )
    many = parser.add_argument_group("a cohort")
    many.add_argument(
        "--cohort",
        type=Path,
        metavar="FOLDER|LIST",
        help="every recording of a folder, or of a text file with a path a line",
    )
    many.add_argument(
        "--workers",
        type=int,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes of this machine (%(default)s)",
    )
    many.add_argument(
        "--format",
        action="append",
        default=[],
        metavar="NAME",
        help=f"write each in this format, too; may be repeated: {', '.join(FORMATS)}",
    )
    many.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of a Dask cluster that sees the same folders, such as tcp://host:8786",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    if (arguments.recording is None) == (arguments.cohort is None):
        raise InputError("command.recording_or_cohort")
    if arguments.cohort is not None:
        return _cohort(arguments)
    if arguments.format:
        raise InputError("command.format_is_of_cohort")
    if not arguments.time_limit > 0:
        raise InputError("command.time_limit_form", time_limit=arguments.time_limit)
    from handscope.app.commands.methods import exit_code, run_method  # here: not for --help
    from handscope.sessions.formats import derivative
    from handscope.sessions.tables_io.writing import save_folder

    done = run_method(arguments, arguments.time_limit)
    processed = done.processed
    files = derivative.tree(processed, done.recording, done.method, done.params, software_version())
    save_folder(files, output_folder(arguments.out))
    for warning in processed.warnings:
        say(f"warning: {warning}")
    name = next(n for n in files if n.endswith("_motion.tsv"))
    say(f"{len(processed.trajectory)} samples by {done.method}: {arguments.out / name}")
    return exit_code("process", processed, arguments.out)


def _cohort(arguments: argparse.Namespace) -> int:
    """0 where every recording has its derivative, 1 where some failed: they are named."""
    from handscope.app.commands.methods import method_of
    from handscope.app.exporting import cohort
    from handscope.app.options import parse

    method_of(arguments)
    if arguments.calibration is not None:
        raise InputError("command.calibration_with_cohort")
    if arguments.workers < 1:
        raise InputError("command.workers_form", workers=arguments.workers)
    for name in arguments.format:
        format_of(name)
    found, out = cohort.recordings(arguments.cohort), output_folder(arguments.out).absolute()
    options, formats = parse(arguments.option), tuple(dict.fromkeys(arguments.format))
    asked = arguments.method
    works = [
        cohort.Work(name, str(path.absolute()), str(out), asked, options, arguments.hand, formats)
        for name, path in found.items()
    ]
    hear, close = progress_bar("processing")
    try:
        outcomes = cohort.all_of(
            works, min(arguments.workers, len(works)), arguments.scheduler, hear
        )
    finally:
        close()
    failed = [o for o in outcomes if o.state == "failed"]
    for outcome in failed:
        say(f"FAILED {outcome.name}: {outcome.message}")
    before = sum(o.state == "before" for o in outcomes)
    say(
        f"{counted(len(outcomes) - len(failed), 'recording')} by {asked or 'the method that suits each'} in {arguments.out}, {before} of them done before; {len(failed)} failed"
    )
    return 1 if failed else 0
