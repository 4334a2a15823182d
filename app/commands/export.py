"""`handscope export`: a recording and its movement in the files of other programs, or as a replay in one file."""

import argparse
from pathlib import Path

from handscope.app.commands.method_arguments import add_method, add_recording
from handscope.app.commands.methods import run_method
from handscope.app.commands.words import counted, output_folder, require_file, say
from handscope.app.exporting import fhir_server
from handscope.app.exporting.saving import require_place, save
from handscope.app.language import ENGLISH
from handscope.app.protocols import load_all
from handscope.app.version import software_version
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.sessions import motion_bids
from handscope.sessions.exports import FORMATS, format_of
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.tables_io.writing import save_file


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_recording(parser)
    parser.add_argument(
        "--format",
        default="bids",
        metavar="NAME",
        help="; ".join(f"{name}: {f.title}" for name, f in FORMATS.items()) + " (default bids)",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="PATH",
        help="file to write; a folder for bids (or FILE.zip), opensim and redcap",
    )
    parser.add_argument(
        "--send",
        metavar="URL",
        help="with --format fhir: post it to this FHIR server; credentials by the environment (docs/fhir.md), never here",
    )
    parser.add_argument(
        "--pseudonym",
        default="",
        metavar="WORD",
        help="written into the export as its subject; never a name. Without it nothing tells who moved",
    )
    parser.add_argument(
        "--replay",
        type=Path,
        metavar="FILE.html",
        help="write its movement in 3-D as one file that opens in a browser without a network",
    )
    parser.add_argument(
        "--title",
        default="",
        metavar="WORDS",
        help="title of the replay; without it nothing tells who moved",
    )
    parser.add_argument(
        "--subject", default="01", metavar="LABEL", help="BIDS label of the subject"
    )
    parser.add_argument("--task", default="hand", metavar="LABEL", help="BIDS label of the task")
    add_method(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    for option in ("subject", "task"):
        if not getattr(arguments, option).isalnum():
            raise InputError(
                "command.label_form",
                option=option,
                arguments=getattr(arguments, option),
            )
    if arguments.out is None and arguments.replay is None and arguments.send is None:
        raise InputError("command.nothing_to_write")
    if arguments.replay is not None:
        require_file(arguments.replay)
    wanted = format_of(arguments.format)
    if arguments.send is not None:
        _require_sendable(arguments)
    if arguments.send is not None or (arguments.out is not None and arguments.format != "bids"):
        if arguments.out is not None:
            require_place(arguments.out, wanted)
        _write_format(arguments)
    elif arguments.out is not None:
        recording = formats_recordings.load(arguments.recording, arguments.hand)
        target = arguments.out if arguments.out.suffix == ".zip" else output_folder(arguments.out)
        motion_bids.write(
            recording, target, arguments.subject, arguments.task, software=software_version()
        )
        say(f"{len(recording.samples)} streams, {recording.duration:.1f} s: {arguments.out}")
    if arguments.replay is not None:
        _write_replay(arguments)
    return 0


def _require_sendable(arguments: argparse.Namespace) -> None:
    """Before anything is computed: the format, the address and the credentials."""
    if arguments.format != "fhir":
        raise InputError("command.send_is_for_fhir")
    fhir_server.require_server(arguments.send)
    fhir_server.credentials()


def _write_format(arguments: argparse.Namespace) -> None:
    from handscope.app.exporting.measured import export_processed, gather  # here: reports are slow

    done = run_method(arguments)
    processed = done.processed
    measured = gather(done.recording, processed, done.method, done.params, arguments.pseudonym)
    exported = export_processed(measured, arguments.format, processed, done.params)
    if arguments.out is not None:
        save(exported.files, arguments.out)
    for sentence in (*processed.warnings, *exported.notices):
        say(f"warning: {sentence}")
    if arguments.out is not None:
        say(f"{len(processed.trajectory)} samples by {done.method}: {arguments.out}")
    if arguments.send is not None:
        taken = fhir_server.send(exported.files[""], arguments.send, fhir_server.credentials())
        say(f"{counted(taken, 'resource')} stored by {arguments.send}")


def _write_replay(arguments: argparse.Namespace) -> None:
    from handscope.app.replay_file import (
        chapters,
        replay_file,
    )  # here: the scene takes a while to import

    done = run_method(arguments)
    recording, moved = done.recording, done.processed.trajectory
    if not len(moved):
        raise InputError("command.no_movement", recording=arguments.recording, method=done.method)
    movement = {"t": moved.t, "angles": moved.angles, "q_GH": moved.q_GS[:, SEGMENT["hand"]]}
    chapter_list = chapters(recording.events, load_all(), ENGLISH)
    title = arguments.title or ENGLISH.say("replay.title")
    data = replay_file(recording.hand, recording.geometry, movement, chapter_list, title, ENGLISH)
    save_file(data, arguments.replay)
    say(
        f"{moved.t[-1] - moved.t[0]:.1f} s by {done.method}, {len(data) / 1e6:.1f} MB: {arguments.replay}"
    )
