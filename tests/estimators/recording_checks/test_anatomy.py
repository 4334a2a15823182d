"""Angles beyond what a joint does are asked about, others are not."""

from dataclasses import replace

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import SEGMENT
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.recording_checks.anatomy import check_anatomy
from tests.estimators.fault_detection.joint_recordings import freely_moved


def turned(trajectory: Trajectory, segment: str, degrees: float) -> Trajectory:
    """One segment turned about its flexion axis all the time."""
    q_GS = trajectory.q_GS.copy()
    k = SEGMENT[segment]
    q_GS[:, k] = quat.multiply(q_GS[:, k], quat.about(2, np.array(np.radians(degrees))))
    return replace(trajectory, q_GS=q_GS)


def asked_of(trajectory: Trajectory) -> list[Suspicion]:
    return check_anatomy(trajectory, joint_angles.of_segments(trajectory.q_GS))


def test_a_hand_that_moves_as_hands_do_is_not_asked_about() -> None:
    assert asked_of(freely_moved().truth) == []


def test_a_joint_bent_backward_is_asked_about_as_a_question() -> None:
    asked = asked_of(turned(freely_moved().truth, "index_distal", -60.0))
    assert [s.message.values["joint"] for s in asked] == ["index_dip"]
    assert asked[0].message.severity == "info"
    assert asked[0].message.code == "person.angle_beyond"


def test_nothing_is_asked_of_nothing() -> None:
    truth = freely_moved().truth
    assert asked_of(truth.between(-2.0, -1.0)) == []
