"""BVH of motion capture gloves and suits (Perception Neuron's names): orientations of the joints' segments.

In      HIERARCHY and MOTION; Euler angles in deg in the order of each joint's channels, y up
Out     columns `left hand quat w` and so on, in a frame with z up; the time from the frame time
Source  Biovision's hierarchical format; joint names: Perception Neuron, Axis Neuron user guide (BVH skeleton)
Limits  a skeleton's segments, not sensors: what its maker's fusion and model made of them
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, HANDS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.sessions.table_import.number_columns import NumberColumns, text_lines

Z_UP = quat.about(0, np.pi / 2)  # takes a frame with y up to one with z up
BVH_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
MOST_JOINTS = 500


@dataclass(frozen=True)
class _Joint:
    name: str
    parent: int  # -1: none
    channels: tuple[str, ...]
    first: int  # column


def read_bvh(path: Path) -> NumberColumns:
    """The orientations of hands, forearms and fingers; InputError where there are none."""
    lines = text_lines(path)
    at = next((k for k, line in enumerate(lines) if line.strip() == "MOTION"), len(lines))
    joints = _joints(lines[:at], path.name)
    period, rows = _motion(lines[at + 1 :], sum(len(j.channels) for j in joints), path.name)
    places = {j.name: place for j in joints if (place := _place(j.name))}
    if not places:
        raise InputError("import.bvh_without_hand", name=path.name)
    found: list[Array] = []
    for joint in joints:
        local = _local(joint, rows)
        above = found[joint.parent] if joint.parent >= 0 else np.tile(Z_UP, (len(rows), 1))
        found.append(quat.multiply(above, local))
    names, columns = ["time [s]"], [np.arange(len(rows))[:, None] * period]
    for joint, q in zip(joints, found):
        if joint.name in places:
            names += [f"{places[joint.name]} quat {c}" for c in "wxyz"]
            columns.append(q)
    return NumberColumns(path.name, tuple(names), np.concatenate(columns, axis=1))


def _place(name: str) -> str:
    """Side and segment of a joint's name, empty where it is none of a hand."""
    for side in HANDS:
        rest = name.removeprefix(side.title())
        if rest == name:
            continue
        if rest in ("ForeArm", "Hand"):
            return f"{side} {rest.lower()}"
        m = re.fullmatch(r"Hand([A-Z][a-z]+)([123])", rest)
        if m and m[1] in BVH_FINGERS:
            finger = FINGERS[BVH_FINGERS.index(m[1])]
            return f"{side} {CHAINS[finger][int(m[2]) - 1]}"
    return ""


def _joints(lines: list[str], file: str) -> list[_Joint]:
    found: list[_Joint] = []
    open_joints: list[int] = []
    waiting, first = "", 0
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if not words:
            continue
        match words[0]:
            case "ROOT" | "JOINT":
                waiting = words[-1]
            case "End":
                waiting = ""
            case "{":
                open_joints.append(len(found) if waiting else -2)
                if waiting:
                    parent = next((k for k in reversed(open_joints[:-1]) if k >= 0), -1)
                    found.append(_Joint(waiting, parent, (), first))
            case "}":
                if not open_joints:
                    raise InputError("import.bvh_bracket", file=file, number=number)
                open_joints.pop()
            case "CHANNELS":
                new = bool(found) and not found[-1].channels
                if not new or len(words) < 3 or len(found) > MOST_JOINTS:
                    raise InputError("import.bvh_channels", file=file, number=number)
                channels = tuple(words[2:])
                found[-1] = _Joint(found[-1].name, found[-1].parent, channels, first)
                first += len(channels)
    return found


def _motion(lines: list[str], width: int, file: str) -> tuple[float, Array]:
    """Frame time (s) and the numbers (frames, channels)."""
    period = 0.0
    rows = []
    for line in lines:
        head, colon, rest = line.partition(":")
        try:
            if colon:
                period = float(rest) if head.strip() == "Frame Time" else period
            elif line.strip():
                rows.append([float(x) for x in line.split()])
        except ValueError:
            raise InputError("import.bvh_line", file=file, line=line.strip()[:40]) from None
    if not 1e-4 < period < 1 or not rows or any(len(r) != width for r in rows) or not width:
        raise InputError("import.bvh_frames", file=file, width=width)
    return period, np.array(rows)


def _local(joint: _Joint, rows: Array) -> Array:
    """Rotation (frames, 4) of a joint on its parent."""
    q = np.tile(quat.IDENTITY, (len(rows), 1))
    for k, channel in enumerate(joint.channels):
        axis = "XYZ".find(channel[:1])
        if channel.endswith("rotation") and axis >= 0:
            q = quat.multiply(q, quat.about(axis, np.radians(rows[:, joint.first + k])))
    return q
