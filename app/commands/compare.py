"""`handscope compare`: how far two recordings of one movement agree, ours against an optical system or method against method."""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from handscope.app.commands.methods import method_of
from handscope.app.commands.words import (
    output_folder,
    progress_bar,
    require_file,
    require_folder,
    say,
)
from handscope.app.options import help_text
from handscope.app.results.comparison import PLOTS, Compared, Side, Tips, as_csv, as_json, as_text
from handscope.app.results.movement_agreement import (
    Movement,
    find_lag,
    given_lag,
    measure_agreement,
)
from handscope.estimators.data.samples import Event
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import ANGLES, HANDS, Hand
from handscope.estimators.measures import comparison, synchronisation, tip_errors
from handscope.estimators.measures.comparison import WHOLE, Pair
from handscope.estimators.measures.synchronisation import Lag
from handscope.estimators.measures.tip_errors import Frame
from handscope.estimators.methods import DEFAULT, DEFAULT_OF_ORIENTATIONS, METHODS, default_for
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation.fusion import FusionParams
from handscope.estimators.pipeline import landmark_trajectory, optical_trajectory
from handscope.estimators.pipeline.landmark_trajectory import Landmarks
from handscope.estimators.pipeline.optical_trajectory import FlatPose, Markers
from handscope.estimators.pipeline.process import process
from handscope.sessions.files import native
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import c3d, landmarks
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.motion_bids import kinematics
from handscope.sessions.motion_bids.kinematics import Kinematics
from handscope.sessions.tables_io.writing import save_file, save_folder

OURS = ("_tracksys-handscope_", "_tracksys-truth_")  # tables whose places are in the wrist's frame
FIRST = 3.0  # s of the flat pose of markers where nothing else is said
UP = {
    f"{sign}{axis}": float(f"{sign}1") * np.eye(3)[k]
    for k, axis in enumerate("xyz")
    for sign in ("", "-")
}

Opened = LoadedRecording | Kinematics | Markers | Landmarks


@dataclass(frozen=True)
class ComparedMovement:
    """One side with its movement."""

    side: Side
    trajectory: Trajectory
    events: tuple[Event, ...]
    checksum: str  # of a raw recording; "" otherwise
    in_wrist: bool = False  # positions of tips are in the wrist's frame


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    for name in ("a", "b"):
        what = "a recording, a derivative, a motion.tsv with JNTANG, ORNT or POS, a C3D file with markers, or a JSON or CSV file of 21 camera landmarks"
        parser.add_argument(
            name,
            type=Path,
            metavar=name.upper(),
            help=what if name == "a" else "the other; differences are B minus A",
        )
    for name in ("a", "b"):
        side = name.upper()
        parser.add_argument(
            f"--method-{name}",
            metavar="NAME",
            help=f"method for {side}: {', '.join(METHODS)} (default {DEFAULT}, {DEFAULT_OF_ORIENTATIONS} for orientations)",
        )
        parser.add_argument(
            f"--option-{name}",
            action="append",
            default=[],
            metavar="KEY=VALUE",
            help="an option of it; may be repeated",
        )
        parser.add_argument(
            f"--calibration-{name}",
            type=Path,
            metavar="RECORDING",
            help="its calibration events from another recording",
        )
        parser.add_argument(
            f"--static-{name}",
            metavar="START:STOP",
            help=f"s of {side} in which the hand lies flat and still (markers; aligns ORNT, too)",
        )
        parser.add_argument(
            f"--wrist-{name}",
            metavar="START:STOP",
            help=f"s of {side} in which only the wrist moves: brings its tips to the wrist's frame",
        )
    parser.add_argument("--hand", choices=HANDS, help="the hand measured, where neither says")
    parser.add_argument(
        "--up",
        choices=UP,
        default="z",
        help="the axis of the markers' frame that points up (default z)",
    )
    parser.add_argument(
        "--lag",
        type=float,
        metavar="S",
        help="A's time less B's, instead of looking for it; the clocks run equally fast then",
    )
    parser.add_argument(
        "--max-lag", type=float, default=np.inf, metavar="S", help="look for lags up to this only"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for comparison.json, comparison.csv and bland_altman.svg",
    )
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="FILE",
        help=f"the Bland-Altman plot: {', '.join('.' + form for form in PLOTS)}",
    )
    parser.epilog = "methods and their options:\n" + "\n".join(
        f"\n{name}: {m.TITLE}\n{help_text(m.Params)}" for name, m in METHODS.items()
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    _require_places(arguments)
    a, b = _both(arguments)
    lag, how = _lag(a, b, arguments)
    centres = _wrists(a, b, arguments)
    agreed = measure_agreement(_movement(a), _movement(b), lag)
    b = replace(b, trajectory=agreed.b.trajectory, events=agreed.b.events)
    found = agreed.agreements
    compared = Compared(a.side, b.side, lag, how, found, _tips(a, b, centres, agreed.stretches))
    plots = _plots(
        compared,
        agreed.pairs,
        {"svg" if arguments.out else "", arguments.plot.suffix[1:] if arguments.plot else ""}
        - {""},
    )
    if arguments.out:
        files = {
            "comparison.json": as_json(compared),
            "comparison.csv": as_csv(compared),
            "bland_altman.svg": plots["svg"],
        }
        save_folder(files, output_folder(arguments.out))
    if arguments.plot:
        save_file(plots[arguments.plot.suffix[1:]], arguments.plot)
    for letter, side in (("A", a.side), ("B", b.side)):
        for warning in side.warnings:
            say(f"warning: {letter}: {warning}")
    if lag.rival is not None:
        say(
            f"warning: the movement repeats itself: a lag of {lag.rival:.2f} s fits as well; say --max-lag or --lag if you know better"
        )
    say(as_text(compared))
    if arguments.out:
        say(
            f"\n{len(found)} comparisons of {len({g.name for g in found})} quantities: {arguments.out}"
        )
    return 0


def _movement(compared: ComparedMovement) -> Movement:
    return Movement(compared.side.name, compared.trajectory, compared.events)


def _wrists(
    a: ComparedMovement, b: ComparedMovement, arguments: argparse.Namespace
) -> dict[str, Array]:
    """The wrist's centre (3,) of each side whose stretch is named, in its own frame."""
    centres = {}
    for name, moved in (("a", a), ("b", b)):
        if words := getattr(arguments, f"wrist_{name}"):
            if moved.in_wrist:
                raise InputError("command.wrist_of_fingertips", name=moved.side.name, name2=name)
            centres[name] = tip_errors.centre_of_rotation(
                moved.trajectory.between(*_stretch(words, name, "wrist")).tips
            )
    return centres


def _tips(
    a: ComparedMovement,
    b: ComparedMovement,
    centres: dict[str, Array],
    parts: list[tuple[str, float, float]],
) -> Tips:
    """How far the tips are apart, in A's frame or, where only B's is the wrist's, in B's."""
    t, on_a = a.trajectory.t, a.trajectory.tips
    flat = b.trajectory.tips.reshape(len(b.trajectory), -1)
    on_b = synchronisation.interpolate(synchronisation.Signal(b.trajectory.t, flat), t).reshape(
        on_a.shape
    )
    frame: Frame = "wrist"
    if not (a.in_wrist and b.in_wrist):
        name, brought, to = ("a", on_a, on_b) if b.in_wrist else ("b", on_b, on_a)
        frame = (
            "wrist found by its movement"
            if name in centres and (a.in_wrist or b.in_wrist)
            else "best fit"
        )
        brought = tip_errors.transform_places(
            brought, to, centres.get(name) if frame != "best fit" else None
        )
        on_a, on_b = (brought, to) if name == "a" else (to, brought)
    within = {part: (t >= part[1]) & (t <= part[2]) for part in parts}
    errors = {
        part: tuple(tip_errors.tip_errors(on_a[rows], on_b[rows])) for part, rows in within.items()
    }
    return Tips(frame, {part: found for part, found in errors.items() if found})


def _plots(compared: Compared, pairs: list[Pair], forms: set[str]) -> dict[str, bytes]:
    """The Bland-Altman plot of the whole recording in each form."""
    if not forms:
        return {}
    from handscope.app.report.sections.agreement_plot import (
        agreement_chart,
    )  # here: it takes as long to import as all the rest

    words = ". ".join(
        f"{letter}: {side.name}, {side.source}"
        for letter, side in (("A", compared.a), ("B", compared.b))
    )
    whole = [g for g in compared.agreements if g.task == WHOLE]
    return {form: agreement_chart(pairs, whole, form, words) for form in PLOTS if form in forms}


def _require_places(arguments: argparse.Namespace) -> None:
    if arguments.plot and arguments.plot.suffix[1:] not in PLOTS:
        raise InputError(
            "command.plot_suffix",
            plot=arguments.plot,
            plots=" or ".join("." + form for form in PLOTS),
        )
    if arguments.lag is not None and not np.isfinite(arguments.lag):
        raise InputError("command.lag_form")
    if not arguments.max_lag >= 0:
        raise InputError("command.max_lag_form")
    if arguments.out:
        require_folder(arguments.out)
    if arguments.plot:
        require_file(arguments.plot, arguments.out)


def _both(arguments: argparse.Namespace) -> tuple[ComparedMovement, ComparedMovement]:
    """Both sides, of one hand."""
    opened = {name: _open(getattr(arguments, name), arguments.hand) for name in ("a", "b")}
    hands = {name: None if isinstance(o, Markers) else o.hand for name, o in opened.items()}
    if hands["a"] and hands["b"] and hands["a"] != hands["b"]:
        raise InputError("command.two_hands", hands=hands["a"], hands2=hands["b"])
    hand = hands["a"] or hands["b"] or arguments.hand
    if hand is None:
        raise InputError("command.hand_not_given")
    poses = {
        name: _pose(() if isinstance(o, Markers | Landmarks) else o.events)
        for name, o in opened.items()
    }
    a = _load_movement("a", opened["a"], hand, poses["a"], poses["b"], arguments)
    return a, _load_movement("b", opened["b"], hand, poses["b"], poses["a"], arguments)


def _pose(events: tuple[Event, ...]) -> Event | None:
    return next((e for e in events if e.trial_type == "initial_pose"), None)


def _open(path: Path, hand: Hand | None) -> Opened:
    """What is at a path: raw inertial samples go before the kinematics beside them, unless the path names a table of these."""
    if path.suffix.lower() == c3d.SUFFIX:
        return c3d.read_markers(path)
    if path.suffix.lower() in landmarks.SUFFIXES:
        return landmarks.read_landmarks(path)
    if path.suffix == native.SUFFIX and path.is_file():
        return formats_recordings.load(path, hand)
    files, tables, inertial = kinematics.tables_at(path)
    if inertial or not tables:
        return formats_recordings.load(path, hand)
    if len(tables) > 1:
        shown = [Path(t).name for t in tables[:4]] + ["..."] * (len(tables) > 4)
        raise InputError(
            "command.several_movements",
            name=path.name,
            count=len(tables),
            names=", ".join(shown),
        )
    return kinematics.load(files, tables[0], hand)


def _load_movement(
    name: str,
    opened: Opened,
    hand: Hand,
    own: Event | None,
    other: Event | None,
    arguments: argparse.Namespace,
) -> ComparedMovement:
    """One side's movement; `own` and `other` are the two sides' initial poses."""
    path, given = (
        getattr(arguments, name),
        {
            k: getattr(arguments, f"{k}_{name}")
            for k in ("method", "option", "calibration", "static")
        },
    )
    if isinstance(opened, LoadedRecording):
        return _process(path, opened, given)
    if given["method"] or given["option"] or given["calibration"]:
        raise InputError("command.not_a_raw_recording", name=path.name, name2=name)
    if isinstance(opened, Landmarks):
        return _by_landmarks(path.name, opened, hand, name if given["static"] else "")
    static = _stretch(given["static"], name, "static") if given["static"] else None
    markers = opened if isinstance(opened, Markers) else opened.markers
    if isinstance(opened, Markers) or opened.trajectory is None:
        if markers is None:
            raise InputError("command.nothing_of_a_hand", name=path.name)
        side, moved = _by_markers(
            path.name,
            markers,
            hand,
            _flat(
                static or ((own.onset, own.end) if own else _first(markers)),
                own,
                other,
                UP[arguments.up],
            ),
        )
        return ComparedMovement(
            side, moved, () if isinstance(opened, Markers) else opened.events, ""
        )
    moved = replace(opened.trajectory, hand=hand)
    if static:
        if opened.has_angles:
            raise InputError("command.static_of_angles", name=opened.name, name2=name)
        moved = optical_trajectory.align(moved, _flat(static, own, other, UP[arguments.up]))
    source = (
        "joint angles"
        if opened.has_angles
        else "orientations"
        if np.isfinite(moved.q_GS).any()
        else "tips"
    )
    return ComparedMovement(
        Side(opened.name, source, len(moved), warnings=opened.warnings),
        moved,
        opened.events,
        "",
        any(own in opened.name for own in OURS),
    )


def _process(path: Path, recording: LoadedRecording, given: dict[str, Any]) -> ComparedMovement:
    name = given["method"] or default_for(recording.streams)
    method, params = method_of(argparse.Namespace(method=name, option=given["option"]))
    other = (
        formats_recordings.load(given["calibration"], recording.hand)
        if given["calibration"]
        else None
    )
    hear, close = progress_bar(f"processing {path.name}")
    try:
        processed = process(method, params, recording, other, hear)
    finally:
        close()
    consistent = comparison.gyroscope_consistency(
        processed.trajectory,
        recording.samples.values(),
        processed.calibrations[0].gyr_bias,
        isinstance(params, FusionParams) and params.gyr_reading == "mean",
    )
    side = Side(
        path.name,
        f"by {name}",
        len(processed.trajectory),
        tuple(consistent),
        (),
        processed.warnings,
    )
    return ComparedMovement(side, processed.trajectory, recording.events, recording.checksum, True)


def _flat(
    static: tuple[float, float], own: Event | None, other: Event | None, up: Array
) -> FlatPose:
    """When the hand lay flat; the thumb's angles from either side's initial pose."""
    event = own or other
    thumb = [float(event.details.get(f"thumb_cmc_{a}_deg", 0.0)) if event else 0.0 for a in ANGLES]
    return FlatPose(*static, up, np.radians(thumb))


def _first(markers: Markers) -> tuple[float, float]:
    return float(markers.t[0]), float(markers.t[0]) + FIRST


def _by_markers(name: str, markers: Markers, hand: Hand, pose: FlatPose) -> tuple[Side, Trajectory]:
    fits = optical_trajectory.find_clusters(markers, pose)
    moved = optical_trajectory.trajectory_of(markers, fits, hand, pose)
    source = f"by markers, flat pose {pose.start:.1f} to {pose.stop:.1f} s"
    return Side(
        name, source, len(moved), (), tuple(optical_trajectory.rigidity(fits, markers))
    ), moved


def _by_landmarks(file: str, opened: Landmarks, hand: Hand, static: str) -> ComparedMovement:
    if static:
        raise InputError("command.static_of_landmarks", file=file, static=static)
    moved = landmark_trajectory.trajectory_of(opened, hand)
    limits = (landmark_trajectory.LIMITS,)
    return ComparedMovement(
        Side(file, "camera landmarks", len(moved), warnings=limits), moved, (), ""
    )


def _stretch(words: str, name: str, option: str) -> tuple[float, float]:
    start, colon, stop = words.partition(":")
    try:
        first, last = float(start), float(stop)
    except ValueError:
        colon, first, last = "", 0.0, 0.0
    if not colon or not 0 <= first < last < np.inf:
        raise InputError("command.stretch_form", option=option, name=name, words=words)
    return first, last


def _lag(
    a: ComparedMovement, b: ComparedMovement, arguments: argparse.Namespace
) -> tuple[Lag, str]:
    moved = _movement(a), _movement(b)
    if arguments.lag is not None:
        return given_lag(*moved, arguments.lag), "given"
    if a.checksum and a.checksum == b.checksum:
        return given_lag(*moved, 0.0), "one recording, one clock"
    return find_lag(*moved, arguments.max_lag), "cross-correlation"
