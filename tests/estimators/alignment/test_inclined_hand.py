"""What gravity alone shows of a hand that nothing is calibrated on, and how well it fits the initial pose."""

import numpy as np
import pytest

from handscope.estimators.alignment.inclined_hand import (
    fits,
    inclined_angles,
    inclined_orientation,
)
from handscope.estimators.alignment.initial_pose import Pose
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    FLEXION,
    HANDS,
    JOINT,
    JOINTS,
    SEGMENTS,
    Hand,
    side_sign,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

DEG = np.pi / 180
POSE = Pose(0.0, 3.0, (0.0, -45 * DEG, 60 * DEG))


def taken(**degrees: float) -> Array:
    """Angles of the pose with some joints bent, deg."""
    angles = np.zeros((len(JOINTS), 3))
    angles[JOINT["thumb_cmc"]] = POSE.thumb_cmc
    for joint, bent in degrees.items():
        angles[JOINT[joint], FLEXION] += bent * DEG
    return angles


def ups(angles: Array, up_hand: Array) -> dict[str, Array]:
    """Upward direction of every segment but the forearm, in its own frame."""
    q = {"hand": quat.IDENTITY}
    for joint in JOINTS[1:]:
        q[joint.child] = quat.multiply(
            q[joint.parent], joint_angles.compose(angles[JOINT[joint.name]])
        )
    return {s: quat.rotate(quat.conjugate(q[s]), up_hand) for s in SEGMENTS if s in q}


def tilted(hand: Hand, *degrees: float) -> Array:
    """The upward direction of a palm turned from lying palm down by these angles about its x, y and z axes."""
    up = side_sign(hand) * np.array([1.0, 0.0, 0.0])
    for axis, angle in enumerate(degrees):
        up = quat.rotate(quat.about(axis, angle * DEG), up)
    return up


@pytest.mark.parametrize("hand", HANDS)
def test_bent_fingers_are_seen_bent_in_a_hand_that_is_tilted(hand: Hand) -> None:
    angles = taken(index_mcp=40, index_pip=60, index_dip=20, thumb_mcp=15, little_pip=-5)
    seen = inclined_angles(ups(angles, tilted(hand, 0, 25, 30)), POSE)
    np.testing.assert_allclose(seen, angles, atol=1e-9)


@pytest.mark.parametrize("hand", HANDS)
def test_a_hand_on_its_side_is_shown_straight_since_gravity_shows_no_flexion(hand: Hand) -> None:
    seen = inclined_angles(ups(taken(index_pip=60), tilted(hand, 0, 85, 0)), POSE)
    assert np.all(seen[JOINT["index_pip"]] == 0)


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("turned", [(0, 0, 0), (0, 170, 0), (0, 20, 80), (0, -60, -85), (0, 0, 90)])
def test_the_drawn_hand_is_inclined_as_the_real_one_and_points_ahead(
    hand: Hand, turned: tuple[float, float, float]
) -> None:
    up = tilted(hand, *turned)
    q_GH = inclined_orientation(up, hand)
    np.testing.assert_allclose(quat.rotate(q_GH, up), [0, 0, 1], atol=1e-9)
    fingers = quat.rotate(q_GH, side_sign(hand) * np.array([0.0, 1.0, 0.0]))
    assert fingers[1] > -1e-6 and abs(fingers[0]) < 0.2


@pytest.mark.parametrize("hand", HANDS)
def test_a_finger_that_is_bent_or_lifted_does_not_fit_and_the_others_do(hand: Hand) -> None:
    up = ups(taken(index_pip=22, ring_mcp=-40, middle_mcp=10), tilted(hand, 0, 5, -5))
    by_part = {f.part: f for f in fits(up, POSE, hand)}
    graded = {part: (f.grade, f.direction) for part, f in by_part.items() if f.grade != "good"}
    assert graded == {"index": ("fair", "bent"), "ring": ("poor", "lifted")}
    assert by_part["index"].angle == pytest.approx(22 * DEG, abs=0.5 * DEG)
    assert set(by_part) == {"hand", "thumb", "index", "middle", "ring", "little"}


def test_a_palm_that_is_not_level_does_not_fit_and_a_missing_strip_says_nothing() -> None:
    up = ups(taken(), tilted("left", 0, 40, 0))
    up = {s: v for s, v in up.items() if not s.startswith("little")}
    found = {f.part: f.grade for f in fits(up, POSE, "left")}
    assert found.pop("hand") == "poor" and "little" not in found
    assert set(found.values()) == {"good"}
