"""Gaps, spacing and signs of what goes into formats without a place for 'not known'."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.hand import forward_kinematics as kinematics
from handscope.estimators.hand.anatomy import JOINT
from handscope.sessions.exports.measured import Measured
from handscope.sessions.exports.skeleton import even, fill, in_continuous_signs, skeleton


def test_bones_of_the_skeleton_end_at_our_fingertips(measured: Measured) -> None:
    bones = skeleton(measured)
    tips = kinematics.tips(bones.rotations, bones.geometry)
    np.testing.assert_allclose(tips, measured.movement.tips, atol=1e-4)


def test_a_finger_that_was_not_measured_whole_is_left_out_and_a_sentence_says_so(
    without_ring: Measured,
) -> None:
    bones = skeleton(without_ring)
    assert bones.fingers == ("thumb", "index", "middle", "little")
    assert np.isfinite(bones.angles).all()
    assert any(n.startswith("ring") for n in bones.notices)
    assert any(n.startswith("wrist") for n in bones.notices)
    assert any("% of the samples" in n for n in bones.notices)


def test_a_gap_takes_its_nearest_known_value() -> None:
    values = np.array([np.nan, 1.0, np.nan, np.nan, np.nan, 5.0])[:, None]
    assert fill(values)[:, 0].tolist() == [1.0, 1.0, 1.0, 1.0, 5.0, 5.0]
    assert fill(np.full((3, 2), np.nan)).tolist() == [[0.0, 0.0]] * 3


def test_uneven_samples_are_taken_at_even_instants_and_a_sentence_says_so(
    measured: Measured,
) -> None:
    moved = measured.movement
    assert even(moved)[1] == []
    gap = np.r_[0:50, 80 : len(moved)]
    spread, notices = even(moved.at(gap))
    assert len(spread) == len(moved)
    assert notices
    np.testing.assert_array_equal(spread.angles[90:], moved.angles[90:])


def test_signs_of_quaternions_never_jump() -> None:
    q = np.array([[1.0, 0, 0, 0], [-0.99, 0.1, 0, 0], [0.98, -0.2, 0, 0]])
    assert (in_continuous_signs(q)[:, 0] > 0).all()


@pytest.mark.parametrize("finger", ["thumb", "little"])
def test_a_skeleton_of_one_sample_is_a_skeleton(measured: Measured, finger: str) -> None:
    one = replace(measured, movement=measured.movement.at(slice(0, 1)))
    assert finger in skeleton(one, evenly=True).fingers
    assert skeleton(one).angles.shape == (1, len(JOINT), 3)
