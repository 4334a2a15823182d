"""The tables of segments, joints and freedoms as docs/conventions.md counts them."""

import numpy as np

from handscope.estimators.hand.anatomy import (
    CHILDREN,
    DOF_NAMES,
    FINGER_JOINTS,
    JOINT,
    JOINTS,
    LIMITS,
    PARENTS,
    SEGMENTS,
    side_sign,
)
from tests.simulated import DEG


def test_there_are_17_segments_and_23_freedoms() -> None:
    assert len(SEGMENTS) == 17
    assert len(JOINTS) == 16
    assert len(DOF_NAMES) == 23
    assert len(set(DOF_NAMES)) == 23


def test_every_segment_but_the_forearm_is_the_child_of_one_joint() -> None:
    assert sorted(CHILDREN) == list(range(1, 17))
    assert (PARENTS < CHILDREN).all()  # so that a chain can be gone through in order


def test_the_papers_ranges_are_kept() -> None:
    for name in FINGER_JOINTS["index"][1:] + ("thumb_ip",):
        np.testing.assert_allclose(
            LIMITS[JOINT[name], 0] / DEG, [-20, 120 if name.endswith("pip") else 100]
        )


def test_every_range_names_its_source() -> None:
    assert all(joint.source for joint in JOINTS)


def test_sides_are_mirrored_by_the_sign() -> None:
    assert side_sign("left") == -side_sign("right") == 1.0
