"""Fingertips in closed form, mirrored, and with segments missing."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import (
    CHAINS,
    CHILDREN,
    FINGER_JOINTS,
    FINGERS,
    FLEXION,
    JOINT,
    JOINTS,
    PARENTS,
    SEGMENT,
    side_sign,
)
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from tests.simulated import DEG

ANGLES = arrays(float, (len(JOINTS), 3), elements=st.floats(-1.2, 1.2))


def _bent(**degrees: float) -> np.ndarray:
    angles = np.zeros((len(JOINTS), 3))
    for name, value in degrees.items():
        angles[JOINT[name], FLEXION] = value * DEG
    return joint_angles.compose(angles)


@pytest.mark.parametrize("hand", ["left", "right"])
def test_a_straight_finger_points_distally(hand: Any) -> None:
    geometry = sized(hand)
    tips = forward_kinematics.tips(_bent(), geometry)
    for f, finger in enumerate(FINGERS):
        length = sum(geometry.lengths[s] for s in CHAINS[finger])
        np.testing.assert_allclose(
            tips[f], geometry.roots()[f] + [0, side_sign(hand) * length, 0], atol=1e-15
        )


@pytest.mark.parametrize("hand", ["left", "right"])
def test_a_fist_folds_the_finger_back_on_itself(hand: Any) -> None:
    """All three joints at 90 deg: the proximal phalanx points to the palm, the middle one back to
    the wrist, the distal one to the back."""
    geometry = sized(hand)
    proximal, middle, distal = (geometry.lengths[s] for s in CHAINS["ring"])
    tips = forward_kinematics.tips(_bent(ring_mcp=90, ring_pip=90, ring_dip=90), geometry)
    dorsal_distal_ulnar = side_sign(hand) * np.array([distal - proximal, -middle, 0.0])
    np.testing.assert_allclose(
        tips[FINGERS.index("ring")],
        geometry.roots()[FINGERS.index("ring")] + dorsal_distal_ulnar,
        atol=1e-15,
    )


def test_joint_places_are_the_tips_of_shorter_fingers() -> None:
    geometry = sized("left")
    q_pc = _bent(index_mcp=30, index_pip=40, index_dip=20)
    places = forward_kinematics.joint_places(q_pc, geometry)
    np.testing.assert_array_equal(places[:, 2], forward_kinematics.tips(q_pc, geometry))
    lengths = np.linalg.norm(np.diff(places[1], axis=0), axis=-1)
    np.testing.assert_allclose(
        lengths, [geometry.lengths["index_middle"], geometry.lengths["index_distal"]], atol=1e-15
    )


@given(ANGLES)
def test_equal_angles_give_mirrored_hands(angles: np.ndarray) -> None:
    """The frames of the two hands are turned against each other, so that mirroring the hand changes
    the sign of every component."""
    q_pc = joint_angles.compose(angles)
    left, right = (forward_kinematics.tips(q_pc, sized(hand)) for hand in ("left", "right"))
    np.testing.assert_allclose(left, -right, atol=1e-15)


@given(ANGLES, st.sets(st.sampled_from(sorted(JOINT))))
def test_a_missing_joint_takes_away_only_its_own_finger(
    angles: np.ndarray, names: set[str]
) -> None:
    geometry = sized("right")
    q_pc = joint_angles.compose(angles)
    whole = forward_kinematics.tips(q_pc, geometry)
    for name in names:
        q_pc[JOINT[name]] = np.nan
    tips = forward_kinematics.tips(q_pc, geometry)
    for f, finger in enumerate(FINGERS):
        if names & set(FINGER_JOINTS[finger]):
            assert np.isnan(tips[f]).all()
        elif "wrist" not in names:
            np.testing.assert_array_equal(tips[f], whole[f])
        else:
            assert np.isfinite(tips[f]).all()


@given(ANGLES)
def test_an_unknown_wrist_counts_as_neutral(angles: np.ndarray) -> None:
    q_pc = joint_angles.compose(angles)
    unknown, neutral = q_pc.copy(), q_pc.copy()
    unknown[JOINT["wrist"]], neutral[JOINT["wrist"]] = np.nan, quat.IDENTITY
    geometry = sized("left")
    np.testing.assert_array_equal(
        forward_kinematics.tips(unknown, geometry), forward_kinematics.tips(neutral, geometry)
    )


@given(ANGLES)
def test_segments_on_the_hand_have_the_joints_rotations_between_them(angles: np.ndarray) -> None:
    q_pc, q_GH = joint_angles.compose(angles), quat.exp(np.array([0.3, -1.0, 0.4]))
    q_GS = forward_kinematics.segments_on(q_GH, q_pc)
    np.testing.assert_array_equal(q_GS[SEGMENT["hand"]], q_GH)
    np.testing.assert_allclose(quat.relative(q_GS[PARENTS], q_GS[CHILDREN]), q_pc, atol=1e-14)


def test_one_posture_and_many_give_the_same(rng: np.random.Generator) -> None:
    geometry = sized("left")
    q_pc = joint_angles.compose(rng.uniform(-1, 1, (4, 3, len(JOINTS), 3)))
    np.testing.assert_array_equal(
        forward_kinematics.tips(q_pc, geometry)[2, 1], forward_kinematics.tips(q_pc[2, 1], geometry)
    )
