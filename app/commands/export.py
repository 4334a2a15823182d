"""`handscope export`: any recording as Motion-BIDS, or its movement in the formats of other programs."""

import argparse
from pathlib import Path

from handscope.app.commands.methods import add_method, add_recording, method_of, processed_by
from handscope.app.commands.words import output_folder, require_file, say
from handscope.app.exports.formats import FORMATS
from handscope.app.language import ENGLISH
from handscope.app.protocols import load_all
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.sessions import motion_bids
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.tables_io.writing import save_file


def add(parser: argparse.ArgumentParser) -> None:
    add_recording(parser)
    parser.add_argument(
        "--format",
        default="bids",
        metavar="NAME",
        help="bids (default; the samples as they are), or the movement by a method: "
        + ", ".join(FORMATS),
    )
    parser.add_argument("--out", type=Path, metavar="PATH", help="the file or folder to write")
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
    for option in ("subject", "task"):
        if not getattr(arguments, option).isalnum():
            raise InputError(
                f"--{option} {getattr(arguments, option)!r} may have letters and digits only"
            )
    if arguments.out is None and arguments.replay is None:
        raise InputError(
            "say where to write: --out PATH, or --replay FILE.html for the movement in 3-D"
        )
    if arguments.format not in ("bids", *FORMATS):
        raise InputError(
            f"there is no format {arguments.format!r}; formats are bids, {', '.join(FORMATS)}"
        )
    if arguments.replay is not None:
        require_file(arguments.replay)
    if arguments.out is not None and arguments.format != "bids":
        _write_movement(arguments)
    elif arguments.out is not None:
        recording = formats_recordings.load(arguments.recording, arguments.hand)
        target = arguments.out if arguments.out.suffix == ".zip" else output_folder(arguments.out)
        motion_bids.write(recording, target, arguments.subject, arguments.task)
        say(f"{len(recording.samples)} streams, {recording.duration:.1f} s: {arguments.out}")
    if arguments.replay is not None:
        _write_replay(arguments)
    return 0


def _write_movement(arguments: argparse.Namespace) -> None:
    from handscope.app.exports import formats  # here: figures and scene take a while to import
    from handscope.app.results.export_content import Content

    _require_path(arguments.format, arguments.out)
    method, params = method_of(arguments)
    recording, processed = processed_by(method, params, arguments)
    content = Content(recording, processed, arguments.method, params)
    for sentence in formats.save(content, arguments.format, arguments.out):
        say(f"note: {sentence}")
    for warning in processed.warnings:
        say(f"warning: {warning}")
    say(f"{len(processed.trajectory)} samples by {arguments.method}: {arguments.out}")


def _write_replay(arguments: argparse.Namespace) -> None:
    from handscope.app.replay_file import (
        chapters,
        replay_file,
    )  # here: the scene takes a while to import

    method, params = method_of(arguments)
    recording, processed = processed_by(method, params, arguments)
    moved = processed.trajectory
    if not len(moved):
        raise InputError(
            f"{arguments.recording} gave no movement by {arguments.method}; there is nothing to replay"
        )
    movement = {"t": moved.t, "angles": moved.angles, "q_GH": moved.q_GS[:, SEGMENT["hand"]]}
    chapter_list = chapters(recording.events, load_all(), ENGLISH)
    title = arguments.title or ENGLISH.say("replay.title")
    data = replay_file(recording.hand, recording.geometry, movement, chapter_list, title, ENGLISH)
    save_file(data, arguments.replay)
    say(
        f"{moved.t[-1] - moved.t[0]:.1f} s by {arguments.method}, {len(data) / 1e6:.1f} MB: {arguments.replay}"
    )


def _require_path(name: str, path: Path) -> None:
    """Refuse a place that cannot be written to before anything is computed; InputError."""
    if FORMATS[name].suffix:
        if path.is_dir():
            raise InputError(f"--out {path} is a folder; --format {name} writes one file")
        if not path.parent.is_dir():
            raise InputError(f"--out {path}: there is no folder {path.parent}")
    elif path.exists() and not path.is_dir():
        raise InputError(f"--out {path} is a file; --format {name} writes a folder")
