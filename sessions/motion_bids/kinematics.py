"""Open the movement that a system measured: joint angles, orientations or places of a Motion-BIDS table, an optical system's or our derivative's.

One table (`tracksys`, `desc`) is one movement: JNTANG `<joint>_<angle>`, ORNT of segments (q_GS), POS of fingertips (`index_tip`) and of markers
(`index_proximal_1`, ...). Rules in docs/comparison.md.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from handscope.estimators.data.samples import Event
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    ANGLES,
    FINGERS,
    HANDS,
    JOINT,
    JOINTS,
    SEGMENT,
    SEGMENTS,
    Hand,
)
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.optical_trajectory import NAME as MARKER
from handscope.estimators.pipeline.optical_trajectory import Markers
from handscope.sessions.motion_bids.events_reader import events_of
from handscope.sessions.motion_bids.files import Files, open_files, whole
from handscope.sessions.motion_bids.reader import NAME, System, times_of
from handscope.sessions.motion_bids.tables import json_object, numbers, rows

UNITS: dict[str, dict[str, float]] = {
    "JNTANG": {"rad": 1.0, "deg": np.pi / 180, "°": np.pi / 180},
    "POS": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
}
Found = dict[tuple[str, str], Array]  # (tracked point, component) -> (n,) SI


@dataclass(frozen=True)
class Kinematics:
    """A movement as a system measured it; `trajectory` is None where there are markers only, its hand where none is given."""

    name: str
    hand: Hand | None
    trajectory: Trajectory | None
    markers: Markers | None
    has_angles: bool  # joint angles stood in the file; otherwise they are those of the orientations
    events: tuple[Event, ...]
    warnings: tuple[str, ...]


def tables_at(path: Path) -> tuple[Files, list[str], bool]:
    """The files there, the tables of kinematics among them, and whether there are raw inertial samples to be processed instead.

    A path to a motion.tsv means that one.
    """
    wanted = ""
    if path.is_file() and path.name.endswith("_motion.tsv"):
        path = path.absolute()
        root = next((p.parent for p in path.parents if p.name.startswith("sub-")), path.parent)
        wanted, path = path.relative_to(root).as_posix(), root
    files = open_files(path)
    found, inertial = [], False
    for name in sorted(files):
        beside = name.replace("_motion.tsv", "_channels.tsv")
        if not name.endswith("_motion.tsv") or beside not in files or (wanted and name != wanted):
            continue
        types = {
            row["type"].upper()
            for row in rows(whole(files[beside]), PurePosixPath(beside).name, ("type",)).values()
        }
        raw = not name.startswith("derivatives/") and "_desc-" not in name
        inertial |= raw and "GYRO" in types
        if types & {"JNTANG", "ORNT", "POS"} and "GYRO" not in types:
            found.append(name)
    return files, found, inertial


def load(files: Files, path: str, hand: Hand | None = None) -> Kinematics:
    """The movement of one table; `hand` is the side to take where the table does not say."""
    name = PurePosixPath(path).name
    base = path.removesuffix("_motion.tsv")
    if f"{base}_motion.json" not in files:
        raise InputError(
            "motion_bids.file_missing_beside",
            file=f"{PurePosixPath(base).name}_motion.json",
            name=name,
        )
    match = NAME.search(path)
    needed = ("name", "component", "type", "tracked_point", "units")
    channels = list(
        rows(
            whole(files[f"{base}_channels.tsv"]), f"{PurePosixPath(base).name}_channels.tsv", needed
        ).values()
    )
    sidecar = json_object(
        whole(files[f"{base}_motion.json"]), f"{PurePosixPath(base).name}_motion.json"
    )
    system = System(match["system"] if match else name, path, sidecar, channels)
    table = numbers(files[path](), name, len(channels))
    if len(table) < 2:
        raise InputError("motion_bids.too_few_samples", name=name, count=len(table))
    warnings: list[str] = []
    t, _ = times_of(system, table, name, warnings)
    side = _side(sidecar.get("MeasuredHand"), hand, name)
    inside = str(PurePosixPath(path).parent / (match["stem"] + match["rest"])) if match else ""
    moved, has_angles = _trajectory(t, channels, table, side, name)
    markers = _markers(t, channels, table, name)
    return Kinematics(
        name, side, moved, markers, has_angles, events_of(files, inside), tuple(warnings)
    )


def _side(value: object, hand: Hand | None, name: str) -> Hand | None:
    for side in HANDS:
        if str(value).lower() == side:
            if hand not in (None, side):
                raise InputError("motion_bids.other_hand", name=name, one=side, other=str(hand))
            return side
    return hand


def _trajectory(
    t: Array, channels: list[dict[str, str]], table: Array, hand: Hand | None, name: str
) -> tuple[Trajectory | None, bool]:
    angles, has_angles = _angles(channels, table, name)
    q_GS = _orientations(_of("ORNT", channels, table, name), len(t), name)
    tips = _tips(_of("POS", channels, table, name), len(t))
    if not has_angles:
        angles = joint_angles.of_segments(q_GS)
    clustered = any(MARKER.match(c["tracked_point"]) for c in channels)
    if not any(
        np.isfinite(values).any() for values in (angles, q_GS, *([] if clustered else [tips]))
    ):
        return None, False
    return Trajectory(hand or "right", t, angles, q_GS, tips, _flags(channels, table)), has_angles


def _angles(channels: list[dict[str, str]], table: Array, name: str) -> tuple[Array, bool]:
    """Joint angles (n, joints, 3), by the names of their columns, and whether there are any."""
    angles, has_any = np.full((len(table), len(JOINTS), 3), np.nan), False
    for column, channel in enumerate(channels):
        joint, _, angle = channel["name"].rpartition("_")
        if channel["type"].upper() == "JNTANG" and joint in JOINT and angle in ANGLES:
            angles[:, JOINT[joint], ANGLES.index(angle)] = table[:, column] * _factor(
                channel, "JNTANG", name
            )
            has_any = True
    return angles, has_any


def _orientations(found: Found, n: int, name: str) -> Array:
    q_GS = np.full((n, len(SEGMENTS), 4), np.nan)
    for segment in {point for point, _ in found} & set(SEGMENTS):
        if any((segment, c) not in found for c in "wxyz"):
            raise InputError("motion_bids.orientation_components", name=name, segment=segment)
        q = np.stack([found[segment, c] for c in "wxyz"], axis=-1)
        norm = np.linalg.norm(q, axis=-1, keepdims=True)
        if (np.abs(norm[np.isfinite(norm)] - 1) > 0.05).any():
            raise InputError("motion_bids.orientation_not_unit", name=name, segment=segment)
        q_GS[:, SEGMENT[segment]] = q / norm
    return q_GS


def _tips(found: Found, n: int) -> Array:
    tips = np.full((n, len(FINGERS), 3), np.nan)
    for k, finger in enumerate(FINGERS):
        for c, component in enumerate("xyz"):
            tips[:, k, c] = found.get((f"{finger}_tip", component), np.nan)
    return tips


def _markers(t: Array, channels: list[dict[str, str]], table: Array, name: str) -> Markers | None:
    found = _of("POS", channels, table, name)
    points = [
        p for p in dict.fromkeys(point for point, _ in found) if all((p, c) in found for c in "xyz")
    ]
    if not any(MARKER.match(p) for p in points):
        return None
    return Markers(
        t,
        tuple(points),
        np.stack([np.stack([found[p, c] for c in "xyz"], axis=-1) for p in points], axis=1),
    )


def _flags(channels: list[dict[str, str]], table: Array) -> np.ndarray:
    """What our derivative says of each segment's samples; nothing elsewhere."""
    flags = np.zeros((len(table), len(SEGMENTS)), np.uint8)
    for column, channel in enumerate(channels):
        if (
            channel["type"].upper() == "MISC"
            and channel["name"] == f"{channel['tracked_point']}_flags"
            and channel["tracked_point"] in SEGMENT
        ):
            flags[:, SEGMENT[channel["tracked_point"]]] = np.nan_to_num(table[:, column]).astype(
                np.uint8
            )
    return flags


def _of(kind: str, channels: list[dict[str, str]], table: Array, name: str) -> Found:
    found: Found = {}
    for column, channel in enumerate(channels):
        if channel["type"].upper() == kind:
            component = channel["component"].lower().removeprefix("quat_")
            found[channel["tracked_point"], component] = table[:, column] * _factor(
                channel, kind, name
            )
    return found


def _factor(channel: Mapping[str, str], kind: str, name: str) -> float:
    if kind not in UNITS:
        return 1.0
    if channel["units"] not in UNITS[kind]:
        raise InputError(
            "motion_bids.derivative_unknown_unit",
            name=name,
            channel=channel["name"],
            unit=channel["units"],
            kind=kind,
            units=", ".join(UNITS[kind]),
        )
    return UNITS[kind][channel["units"]]
