"""A pose as other programs receive it: names of docs/conventions.md, SI units, nothing about who is measured."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import orjson

from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import ANGLES, FINGERS, JOINTS, SEGMENTS, Hand
from handscope.estimators.numerics.typing import Array

VERSION = 1
ANGLE_COLUMNS = tuple(
    (f"{joint.name}_{ANGLES[a]}", j, a) for j, joint in enumerate(JOINTS) for a in joint.dofs
)
ANGLE_NAMES = tuple(name for name, _, _ in ANGLE_COLUMNS)
TIP_NAMES = tuple(f"{finger}_tip_{axis}" for finger in FINGERS for axis in "xyz")
UNITS = {"t": "s", "angles": "rad", "tips": "m", "orientations": "1", "age_ms": "ms", "sent": "s"}
FRAMES = {
    "tips": "wrist frame",
    "orientations": "w, x, y, z of q_GS: segment to a frame with z up",
}
_JOINT = np.array([j for _, j, _ in ANGLE_COLUMNS])
_AXIS = np.array([a for _, _, a in ANGLE_COLUMNS])


@dataclass(frozen=True)
class Pose:
    """One pose of the hand; what is not measured is absent."""

    t: float  # s of the recording
    hand: Hand
    angles: Mapping[str, float]  # rad, such as index_pip_flexion
    tips: Mapping[str, Sequence[float]]  # m, finger -> x, y, z in the wrist frame
    orientations: Mapping[str, Sequence[float]]  # segment -> w, x, y, z of q_GS
    flags: Mapping[str, Sequence[str]]  # segment -> why it is to be doubted
    age_ms: float | None = None  # from the sample to the sending
    sent: float = 0.0  # s, monotonic clock of the server's machine


def description(hand: Hand, method: str, simulated: bool) -> bytes:
    """The first message of a stream: what the poses that follow are."""
    return orjson.dumps(
        {
            "stream": {
                "version": VERSION,
                "hand": hand,
                "method": method,
                "simulated": simulated,
                "units": UNITS,
                "frames": FRAMES,
                "angles": list(ANGLE_NAMES),
                "notice": "research use; not a medical device",
            }
        }
    )


def newest_pose(rows: Trajectory, age_ms: float | None = None) -> Pose:
    """The last row of a trajectory that has one."""
    orientations = rows.q_GS[-1]
    return Pose(
        float(rows.t[-1]),
        rows.hand,
        {n: v for n, v in zip(ANGLE_NAMES, angle_table(rows)[-1].tolist()) if np.isfinite(v)},
        _known(FINGERS, rows.tips[-1]),
        _known(SEGMENTS, orientations),
        {
            s: [str(flag.name).lower() for flag in Flag if flag & int(bits)]
            for s, bits in zip(SEGMENTS, rows.flags[-1])
            if bits
        },
        age_ms,
        time.monotonic(),
    )


def to_json(pose: Pose) -> bytes:
    """A message of the stream."""
    return orjson.dumps(pose)


def from_json(message: Mapping[str, Any]) -> Pose:
    """The pose of a message that has been parsed."""
    return Pose(**{name: message[name] for name in Pose.__dataclass_fields__})


def angle_table(rows: Trajectory) -> Array:
    """Angles (n, 23) rad in the order of ANGLE_NAMES; NaN where not measured."""
    return np.asarray(rows.angles[:, _JOINT, _AXIS])


def _known(names: Sequence[str], values: Array) -> dict[str, list[float]]:
    return {n: v for n, v in zip(names, values.tolist()) if np.isfinite(v).all()}
