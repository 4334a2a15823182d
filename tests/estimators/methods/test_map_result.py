"""The tracked movement with what self-calibration found, made a piece at a time."""

import numpy as np

from handscope.estimators.data import trajectory
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import map_result
from tests.estimators.methods.solved_hands import PARAMS, solved
from tests.simulated import pose_and_wiggle

GEOMETRY = sized("left")


def test_a_movement_is_described_the_same_in_any_pieces() -> None:
    truth = pose_and_wiggle("left").truth
    flags = np.zeros(truth.q_GS.shape[:2], np.uint8)
    moved = Trajectory("left", truth.t, truth.angles, truth.q_GS, truth.tips, flags)
    fingers = solved(moved.between(4.0, 9.0))

    def describe(tracked: Trajectory) -> Trajectory:
        found = map_result.with_solution(tracked, GEOMETRY, fingers)
        found = map_result.with_deviations(PARAMS, found, fingers)
        return map_result.add_wrist_uncertainty(PARAMS, found, GEOMETRY)

    whole, edges = describe(moved), [-np.inf, 1.0, 4.003, 4.02, 7.7, 9.5, np.inf]
    pieces = (describe(moved.between(a, b)) for a, b in zip(edges, edges[1:]))
    joined = trajectory.join(pieces, "left", len(moved))
    for name in ("t", "angles", "q_GS", "tips", "flags", "angles_sd", "tips_sd"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(joined, name), name)
