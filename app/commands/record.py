"""`handscope record`: record a glove without the pages; the live tracker runs as in a station and calibrates on the glove's own marks."""

import argparse
import time
from contextlib import ExitStack
from pathlib import Path
from typing import cast

from handscope.app.commands.method_arguments import add_method
from handscope.app.commands.methods import method_of
from handscope.app.commands.shortfalls import shortfalls
from handscope.app.commands.words import (
    output_folder,
    progress_bar,
    read_json,
    require_file,
    require_folder,
    say,
)
from handscope.app.devices.glove import Glove
from handscope.app.devices.ports import is_network
from handscope.app.live.tracking import Tracking
from handscope.app.version import software_version
from handscope.estimators.alignment import initial_pose
from handscope.estimators.data import trajectory
from handscope.estimators.data.events import Event
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS, Hand
from handscope.estimators.hand.geometry import measures_from, sized
from handscope.estimators.methods import DEFAULT
from handscope.estimators.numerics.jit import load_kernels
from handscope.estimators.pipeline.method import steps_through
from handscope.estimators.pipeline.process import Processed
from handscope.sessions.formats import derivative
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.tables_io.writing import save_folder

OPEN_WAIT = 15.0  # s for the recording process to start and open the port
SPEAK_WAIT = 8.0  # s for the glove to say who it is and to send samples
LIVE_PATIENCE = 2.0  # s that a silent strip is waited for: nobody looks on
SILENCE = 2.0  # s without a sample that end a recording
OUTAGE = 45.0  # s without a sample that a glove in the network may take to come back
SHORT = 0.2  # s by which a recording may be shorter than asked: samples still on their way
UNPLUGGED = "the glove was unplugged"


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        "port",
        help="the glove's serial port, or its address: socket://HOST:PORT, rfc2217://HOST:PORT; slimevr://, lsl://, ximu3:// (docs/devices.md)",
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE.mcap", help="the native recording"
    )
    parser.add_argument(
        "--seconds",
        type=float,
        metavar="S",
        help="how long (default: until the glove falls silent or Ctrl-C)",
    )
    parser.add_argument("--hand", choices=HANDS, help="where the glove does not say")
    parser.add_argument(
        "--geometry",
        type=Path,
        metavar="FILE.json",
        help="hand measures, as HandGeometry of the Motion-BIDS contract",
    )
    parser.add_argument(
        "--live",
        type=Path,
        metavar="DIR",
        help="write the trajectory of the live tracker as a derivative",
    )
    add_method(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    arguments.method = arguments.method or DEFAULT
    method, params = method_of(arguments)
    if not steps_through(method):
        raise InputError("command.method_in_batch_only", method=arguments.method)
    geometry = _geometry(arguments.geometry)
    if arguments.out.suffix != ".mcap" or arguments.out.exists():
        raise InputError("command.out_not_new_mcap", out=arguments.out)
    require_file(arguments.out)
    if arguments.live:
        require_folder(arguments.live)
    rows: list[Trajectory] = []
    metadata = {
        "software": software_version(),
        "port": arguments.port,
        "geometry": geometry,
        **({"hand": arguments.hand} if arguments.hand else {}),
    }
    load_kernels()  # now: once the glove sends, whoever computes for long costs samples
    tracking: Tracking | None = None
    glove = Glove(
        arguments.port,
        arguments.out,
        metadata,
        lambda blocks: tracking.feed(blocks) if tracking else None,
    )

    with ExitStack() as undoing, glove:
        undoing.callback(arguments.out.unlink, missing_ok=True)
        connect(glove, arguments.port)
        hand = _hand_of(glove, arguments)
        undoing.pop_all()  # the right glove gives samples: from here on what was recorded stays
        with Tracking(
            method, params, hand, sized(hand, measures_from(geometry)), rows.append, LIVE_PATIENCE
        ) as tracking:
            patience = OUTAGE if is_network(arguments.port) else SILENCE
            why = _follow(glove, tracking, arguments.seconds, patience)
            tracking.drain()
        if early := ending(max(0.0, tracking.newest_sample()), arguments.seconds, why):
            glove.keep_metadata({"ended": early})
    recording = formats_recordings.load(arguments.out, arguments.hand)
    say(
        f"{recording.duration:.1f} s of {', '.join(s.name for s in recording.streams)}: {arguments.out}"
    )
    for sentence in shortfalls(recording):
        say(f"warning: {sentence}")
    if glove.state.dropped:
        say(
            f"note: this machine was too slow to show {glove.state.dropped} pieces of the data live; the recording has them"
        )
    if arguments.live and tracking.calibration is not None:
        shown = Processed(trajectory.join(rows, hand), (tracking.calibration,), recording.warnings)
        files = derivative.tree(shown, recording, arguments.method, params, software_version())
        save_folder(files, output_folder(arguments.live))
        say(f"{len(shown.trajectory)} live samples: {arguments.live}")
    return 1 if early and arguments.seconds else 0


def ending(recorded: float, asked: float | None, why: str) -> str:
    """How a recording of so many seconds ended, if that was early; empty where nothing is to be said."""
    if asked is not None and recorded < asked - SHORT:
        return (
            f"{recorded:.1f} s of {asked:g} s: {why or 'the glove fell silent'} at {recorded:.1f} s"
        )
    return (
        f"{recorded:.1f} s: {why} at {recorded:.1f} s" if why == UNPLUGGED and asked is None else ""
    )


def _geometry(path: Path | None) -> dict[str, object]:
    if path is None:
        return {}
    value = read_json(path)
    measures_from(value)
    return value


def connect(glove: Glove, port: str) -> None:
    """Wait until a glove at the port speaks; InputError where there is none."""
    if not glove.wait_for(lambda g: g.state.state != "opening", OPEN_WAIT):
        raise InputError("command.port_silent", port=port)
    speaks = glove.wait_for(lambda g: _speaks(g) or g.state.state != "opened", SPEAK_WAIT)
    if glove.state.state == "port_lost":
        raise InputError("command.port_hung_up", port=port)
    if glove.state.state != "opened":
        raise InputError(glove.state.reason)
    if not speaks:
        if glove.is_foreign:
            raise InputError("command.foreign_protocol", port=port)
        raise InputError("command.no_glove_at_port", port=port)


def _speaks(glove: Glove) -> bool:
    return bool(glove.assembler.counts) and glove.assembler.identity is not None


def _hand_of(glove: Glove, arguments: argparse.Namespace) -> Hand:
    glove_hand = glove.assembler.identity.hand if glove.assembler.identity else None
    if glove_hand and arguments.hand not in (None, glove_hand):
        raise InputError("command.other_glove", glove_hand=glove_hand, hand=arguments.hand)
    hand: Hand | None = cast("Hand | None", glove_hand) or arguments.hand
    if hand is None:
        raise InputError("command.glove_without_hand")
    return hand


def _calibrate(glove: Glove, tracking: Tracking, pose: Event) -> None:
    """Use a pose that the glove marked; where it cannot be used the recording goes on all the same."""
    tracking.mounting = glove.assembler.mounting
    try:
        tracking.calibrate(initial_pose.pose_of(pose))
    except InputError as problem:
        say(f"warning: the live tracker is not calibrated, the recording goes on: {problem}")


def _follow(glove: Glove, tracking: Tracking, seconds: float | None, patience: float) -> str:
    """Until the time is over or the glove silent; initial poses that the glove marks are used as soon as they are complete.

    Gives back what ended it before its time, empty where nothing did.
    """
    began, newest, last_seen, used = time.monotonic(), -1.0, time.monotonic(), 0
    hear, close = progress_bar("recording")
    try:
        while seconds is None or time.monotonic() - began < seconds:
            glove.wait_for(lambda g: False, 0.1)
            hear(min(1.0, (time.monotonic() - began) / seconds) if seconds else 0.0)
            if glove.state.state == "recording_failed":
                raise InputError("command.recording_stopped", reason=glove.state.reason)
            if tracking.newest_sample() > newest:
                newest, last_seen = tracking.newest_sample(), time.monotonic()
            elif time.monotonic() - last_seen > patience:
                break
            poses = [m for m in glove.assembler.marks if m.trial_type == "initial_pose"]
            if len(poses) > used and newest > poses[used].end + 0.05:
                _calibrate(glove, tracking, poses[used])
                used += 1
    except KeyboardInterrupt:
        return "it was stopped"
    finally:
        close()
    return "" if glove.state.state == "opened" else UNPLUGGED
