"""Hands as if self-calibration had found their movement exactly, but for what no movement tells."""

from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.methods import map_unobserved
from handscope.estimators.methods.map_options import Params
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.result import Finger
from handscope.estimators.self_calibration.segments import Segments
from handscope.estimators.self_calibration.uncertainty import monte_carlo
from handscope.estimators.self_calibration.uncertainty.monte_carlo import Uncertainty

EXACTLY: Mapping[str, Array] = {}
STRAIGHT: Array = np.zeros(3)
PARAMS = Params()
SD = np.radians(PARAMS.mounting)


def turned(
    truth: Trajectory,
    hand: Array,
    last: Mapping[str, float],
    forearm: Array = STRAIGHT,
) -> Trajectory:
    """The movement as sensors show it that sit otherwise than believed: the hand's and the forearm's by vectors (3,), last phalanges' about z (rad)."""
    q_GS = truth.q_GS.copy()
    turns = {
        "hand": hand,
        "forearm": forearm,
        **{CHAINS[f][-1]: a * map_unobserved.Z for f, a in last.items()},
    }
    for name, turn in turns.items():
        q_GS[:, SEGMENT[name]] = quat.multiply(q_GS[:, SEGMENT[name]], quat.exp(turn))
    return Trajectory(
        truth.hand, truth.t, truth.angles, q_GS, truth.tips, np.zeros(q_GS.shape[:2], np.uint8)
    )


def solved(moved: Trajectory) -> list[Finger]:
    """Fingers as if self-calibration had found this movement, and knew no more of mountings than what is usual."""
    rows = np.arange(0, len(moved), 50)
    return [
        Finger(name, moved.t, SimpleNamespace(), *_described(name, moved, rows))  # type: ignore[arg-type]
        for name in (*FINGERS, "forearm")
    ]


def _described(name: str, moved: Trajectory, rows: Array) -> tuple[Segments, Uncertainty]:
    chain = CHAINS.get(name, ("forearm",))
    turns = SD * monte_carlo.mounting_numbers()
    q_GB = {n: moved.q_GS[:, SEGMENT[n]] for n in ("hand", *chain)}
    unknown = {"hand": np.ones(3), chain[-1]: map_unobserved.Z if name in CHAINS else np.ones(3)}
    errors = {n: turns[:, SEGMENT[n]] * axes for n, axes in unknown.items()}
    best = _angles(q_GB, rows)
    drawn = [_angles(q_GB, rows, {n: e[k] for n, e in errors.items()}) for k in range(len(turns))]
    tip = np.tile(0.01 * monte_carlo.length_numbers()[:, None, None], (1, len(rows), 3))
    segments = Segments(
        dict.fromkeys(q_GB, quat.IDENTITY), {n: np.zeros(3) for n in q_GB}, {}, {}, q_GB
    )
    return segments, Uncertainty(errors, {}, rows, np.array(drawn) - best, tip)


def _angles(q_GB: Mapping[str, Array], rows: Array, off: Mapping[str, Array] = EXACTLY) -> Array:
    """Joint angles (m, joints, 3) where mountings are off by so much."""
    q_GS = np.full((len(rows), len(SEGMENTS), 4), np.nan)
    for name, q in q_GB.items():
        q_GS[:, SEGMENT[name]] = quat.multiply(q[rows], quat.exp(-off.get(name, np.zeros(3))))
    return joint_angles.of_segments(q_GS)


def calibrated(geometry: HandGeometry) -> Calibration:
    """As self-calibration leaves it, lengths as given."""
    return initial_pose.uncalibrated("left", geometry, {}, ["hand"], 0.0)


def off(fingers: list[Finger], truth: Trajectory) -> float:
    """How far phalanges are turned against the hand, rad, root mean square."""
    squares = []
    for f in (f for f in fingers if f.name in CHAINS):
        q_GB = f.segments.q_GB
        for name in CHAINS[f.name]:
            believed = quat.relative(q_GB["hand"], q_GB[name])
            true = quat.relative(truth.q_GS[:, SEGMENT["hand"]], truth.q_GS[:, SEGMENT[name]])
            squares.append((quat.log(quat.relative(believed, true)) ** 2).sum(axis=-1))
    return float(np.sqrt(np.mean(squares)))
