"""How far an estimate is from the truth: tips, joint angles, known distances, orientations.

In      estimate and truth at the same instants
Out     root mean squares: m, rad
Source  tips and distances: Salchow-Hoemmen 2019, (30)-(32); orientations: Laidig et al. 2021, Data 6(7):72
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import FINGERS, JOINT
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array


@dataclass(frozen=True)
class OrientationError:
    """Angles (n,) in rad of an orientation against a reference in the same earth frame."""

    total: Array
    heading: Array
    inclination: Array


def rms(values: Array) -> float:
    """Root mean square of all values."""
    assert values.size and np.isfinite(values).all(), "an error without a value"
    return float(np.sqrt(np.mean(values * values)))


def tip_rmse(estimate: Trajectory, truth: Trajectory, fingers: Sequence[str]) -> float:
    """RMS of the tips' distance from the truth in the wrist frame, m. Source: Salchow-Hoemmen 2019, (30), (31)."""
    k = [FINGERS.index(finger) for finger in fingers]
    return rms(np.linalg.norm(estimate.tips[:, k] - truth.tips[:, k], axis=-1))


def angle_difference(a: Array, b: Array) -> Array:
    """a - b in rad, the shorter way round: in [-pi, pi)."""
    return quat.wrapped(a - b)


def nees(error: Array, sd: Array) -> float:
    """Mean normalised error squared over all values that are known. 1: consistent; below 1: sd too large; above: too small."""
    return float(np.nanmean((error / sd) ** 2))


def angle_errors(estimate: Trajectory, truth: Trajectory, joints: Sequence[str]) -> Array:
    """Differences (n, freedoms) of all freedoms of the joints, rad, the shorter way round."""
    k = [JOINT[joint] for joint in joints]
    error = angle_difference(estimate.angles[:, k], truth.angles[:, k])
    free = np.isfinite(truth.angles[:, k]).all(axis=0)
    return np.asarray(error[:, free])


def distance_rmse(a: Array, b: Array, distance: float) -> float:
    """RMS of the distance between points (n, 3) against the known one, m. Source: Salchow-Hoemmen 2019, (32), (31)."""
    return rms(np.linalg.norm(a - b, axis=-1) - distance)


def orientation_error(q_GS: Array, q_ref: Array) -> OrientationError:
    """Split the error q_e = q_GS conj(q_ref) (n, 4) into its turn about the vertical and the rest."""
    q_e = quat.multiply(q_GS, quat.conjugate(q_ref))
    w, x, y, z = np.moveaxis(q_e, -1, 0)
    upright, tilted = np.hypot(w, z), np.hypot(x, y)
    return OrientationError(
        2 * np.arctan2(np.hypot(tilted, z), np.abs(w)),
        quat.twist(q_e, 2),
        2 * np.arctan2(tilted, upright),
    )
