"""The hand as a chain of bones for formats that want every bone at every instant.

In      a trajectory, a sized hand
Out     angles (n, joints, 3) rad without gaps, of the fingers that were measured whole
Limits  a gap takes the nearest sample that is known; a joint that was never measured is neutral where it lies within the chain (the wrist)
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import FINGER_JOINTS, FINGERS, IS_DOF, JOINT, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Bools
from handscope.sessions.exports.measured import Measured

# takes vectors with z up to those with y up
Y_UP = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0])


@dataclass(frozen=True)
class Skeleton:
    """Bones over time; all values known."""

    t: Array  # (n,) s
    angles: Array  # (n, joints, 3) rad, 0 of what is no freedom
    q_WF: Array  # (n, 4) forearm (the wrist frame) in a world whose y is up
    fingers: tuple[str, ...]  # those measured whole, thumb first
    geometry: HandGeometry
    notices: tuple[str, ...]

    @property
    def rotations(self) -> Array:
        """Of every joint (n, joints, 4), child to parent."""
        return joint_angles.compose(self.angles)


def skeleton(measured: Measured, evenly: bool = False) -> Skeleton:
    """The bones of a recording; `evenly`: at instants of one spacing, each the nearest sample."""
    moved, notices = measured.movement, list[str]()
    if evenly:
        moved, notices = even(moved)
    known: Bools = np.isfinite(moved.angles) | ~IS_DOF
    ever = np.asarray(known.all(axis=2).any(axis=0))  # (joints,)
    fingers = tuple(f for f in FINGERS if all(ever[JOINT[j]] for j in FINGER_JOINTS[f]))
    absent = [f for f in FINGERS if f not in fingers]
    if absent:
        notices.append(phrase("export.finger_left_out", fingers=", ".join(absent)))
    if not ever[JOINT["wrist"]]:
        notices.append(phrase("export.wrist_neutral"))
    joints = [JOINT[j] for f in fingers for j in FINGER_JOINTS[f]]
    whole = np.asarray(known[:, joints].all(axis=(1, 2)))
    missing = 1.0 - float(whole.mean()) if joints and len(moved) else 0.0
    if missing > 0:
        notices.append(phrase("export.joint_unknown", share=100 * missing))
    angles = np.where(IS_DOF, fill(moved.angles), 0.0)
    return Skeleton(
        moved.t, angles, _forearm(moved, angles), fingers, measured.geometry, tuple(notices)
    )


def even(moved: Trajectory) -> tuple[Trajectory, list[str]]:
    """The nearest samples to instants of one spacing, the median of the recording's own; sentences about what that changed."""
    t = moved.t
    if len(t) < 2:
        return moved, []
    spacing = float(np.median(np.diff(t)))
    count = round(float(t[-1] - t[0]) / spacing) + 1
    instants = np.linspace(t[0], t[-1], count)
    later = np.clip(np.searchsorted(t, instants), 1, len(t) - 1)
    rows = later - (instants - t[later - 1] < t[later] - instants)
    off = float(np.abs(t[rows] - instants).max())
    notices = [phrase("export.uneven", off=1e3 * off)] if off > 0.1 * spacing else []
    return moved.at(rows), notices


def rate(t: Array) -> float:
    """Samples a second of evenly spaced instants, Hz; 100 where there is one alone."""
    return (len(t) - 1) / float(t[-1] - t[0]) if len(t) > 1 and t[-1] > t[0] else 100.0


def fill(values: Array) -> Array:
    """Each gap along the first axis takes its nearest known value; 0 where nothing is known."""
    flat = values.reshape(len(values), -1).copy()
    rows = np.arange(len(flat))
    for column in flat.T:
        known = np.flatnonzero(np.isfinite(column))
        if not len(known):
            column[:] = 0.0
        elif len(known) < len(column):
            after = np.clip(np.searchsorted(known, rows), 0, len(known) - 1)
            before = np.clip(after - 1, 0, None)
            nearer = np.abs(rows - known[before]) <= np.abs(known[after] - rows)
            column[:] = column[np.where(nearer, known[before], known[after])]
    return flat.reshape(values.shape)


def fill_rotations(q: Array) -> Array:
    """The same for rotations (n, 4); identity where nothing is known."""
    known: Bools = np.isfinite(q[:, 0])
    return (
        fill(np.where(known[:, None], q, np.nan))
        if known.any()
        else np.tile(quat.IDENTITY, (len(q), 1))
    )


def in_continuous_signs(q: Array) -> Array:
    """The same rotations (n, ..., 4) with signs that never jump, so that one may interpolate between neighbours."""
    turned = np.sum(q[1:] * q[:-1], axis=-1) < 0
    signs = np.concatenate([np.ones((1, *q.shape[1:-1])), np.where(turned, -1.0, 1.0)])
    return np.asarray(q * np.cumprod(signs, axis=0)[..., None])


def _forearm(moved: Trajectory, angles: Array) -> Array:
    """Orientation (n, 4) of the forearm in the world with y up: measured, else from the hand's with a neutral wrist."""
    q_GH = fill_rotations(moved.q_GS[:, SEGMENT["hand"]])
    back = quat.conjugate(joint_angles.compose(angles[:, JOINT["wrist"]]))
    return quat.multiply(np.broadcast_to(Y_UP, q_GH.shape), quat.multiply(q_GH, back))
