"""Relative headings from what joints cannot do."""

import numpy as np
import pytest
from filterpy.kalman import update

from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import JOINT, JOINTS, PARENTS, SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation import heading_constraints
from handscope.estimators.orientation.heading_constraints import DEG, HeadingParams
from handscope.estimators.simulation.kinematics import compute_kinematics
from handscope.estimators.simulation.movements.task_performance import fist_and_stretch

PARAMS = HeadingParams()
TURN = 40 * DEG


def _moving() -> tuple[Array, Array]:
    """Instants (n,) and segment orientations (n, segments, 4) of fist and stretch."""
    g = sized("left")
    performance = fist_and_stretch(g)
    t = np.arange(0.0, performance.motion.duration, 0.01)
    return t, compute_kinematics(performance.motion, g, t).q_GB


def _turned(q_GB: Array, segments: list[str]) -> Array:
    turned = q_GB.copy()
    for s in segments:
        turned[:, SEGMENT[s]] = quat.multiply(quat.about(2, np.array(TURN)), q_GB[:, SEGMENT[s]])
    return turned


def _stepped(
    t: Array, q_GB: Array, doubted: list[str], params: HeadingParams = PARAMS
) -> tuple[Array, np.ndarray]:
    doubt = np.zeros((len(t), len(SEGMENTS)))
    doubt[t > 2.0] = np.where(np.isin(SEGMENTS, doubted), np.radians(60.0) ** 2, 0.0)
    _, corrected, lost = heading_constraints.step(
        params, heading_constraints.start(), t, q_GB, doubt, np.ones((len(t), len(SEGMENTS)), bool)
    )
    return corrected, lost


@pytest.mark.parametrize("segment", ["index_middle", "ring_distal", "little_proximal"])
def test_a_heading_that_was_lost_is_found_again_from_the_joints(segment: str) -> None:
    t, q_GB = _moving()
    given = q_GB.copy()
    given[t > 2.0] = _turned(q_GB, [segment])[t > 2.0]
    corrected, lost = _stepped(t, given, [segment])
    assert lost[t > 2.0][0, SEGMENT[segment]]
    assert not lost[-1, SEGMENT[segment]]
    error = quat.angle(quat.relative(q_GB[-1], corrected[-1]))
    assert np.degrees(error[SEGMENT[segment]]) < 3.0
    assert error[SEGMENT["middle_middle"]] < 1e-12


def test_without_doubt_nothing_is_changed_within_a_session() -> None:
    t, q_GB = _moving()
    corrected, lost = _stepped(t, q_GB, [])
    np.testing.assert_allclose(corrected, q_GB, atol=1e-15)
    assert not lost.any()


def test_a_heading_of_the_thumb_s_base_stays_lost_because_its_joint_turns_all_ways() -> None:
    t, q_GB = _moving()
    _, lost = _stepped(t, q_GB, ["thumb_metacarpal"])
    assert lost[-1, SEGMENT["thumb_metacarpal"]]


def test_a_joint_whose_axis_stands_upright_tells_nothing() -> None:
    t, q_GB = _moving()
    # the hand's edge down: flexion axes are vertical
    on_its_side = quat.multiply(quat.about(1, np.array(90 * DEG)), q_GB)
    _, lost = _stepped(t, on_its_side, ["index_middle"])
    assert lost[-1, SEGMENT["index_middle"]]


def test_a_segment_that_is_not_measured_changes_nothing_and_says_nothing() -> None:
    t, q_GB = _moving()
    q_GB[:, SEGMENT["index_distal"]] = np.nan
    corrected, lost = _stepped(t, q_GB, [])
    np.testing.assert_array_equal(np.isnan(corrected), np.isnan(q_GB))
    assert not lost.any()


def test_a_gap_of_the_hand_costs_no_heading_where_nothing_is_worn() -> None:
    t, q_GB = _moving()
    worn = [SEGMENT[s] for s in ("hand", "index_proximal", "index_middle")]
    q_GB[:, np.setdiff1d(np.arange(len(SEGMENTS)), worn)] = np.nan
    _, lost = _stepped(t, q_GB, ["hand"])
    assert {SEGMENTS[s] for s in np.flatnonzero(lost.any(axis=0))} == {
        "index_proximal",
        "index_middle",
    }


def test_slopes_are_the_derivatives_of_the_angles_by_the_heading() -> None:
    rng = np.random.default_rng(5)
    q_GP = quat.exp(rng.normal(size=(len(JOINTS), 3)))
    angles = rng.uniform(-1.2, 1.2, (len(JOINTS), 3))
    q_GC = quat.multiply(q_GP, joint_angles.compose(angles))
    up = quat.rotate(quat.conjugate(q_GP), np.array([0.0, 0.0, 1.0]))
    step = 1e-6
    turned = [
        joint_angles.decompose(quat.relative(q_GP, quat.multiply(quat.about(2, np.array(d)), q_GC)))
        for d in (-step, step)
    ]
    np.testing.assert_allclose(
        heading_constraints._slopes(angles, up), (turned[1] - turned[0]) / (2 * step), atol=1e-7
    )


def test_the_forearm_turns_for_the_wrist_and_every_segment_for_the_joints_before_it() -> None:
    by_joint = np.zeros((1, len(JOINTS)))
    by_joint[0, [JOINT["wrist"], JOINT["index_mcp"], JOINT["index_dip"]]] = 1.0, 10.0, 100.0
    sums = heading_constraints._by_segment(by_joint)[0]
    found = {
        s: sums[SEGMENT[s]]
        for s in (
            "forearm",
            "hand",
            "index_proximal",
            "index_middle",
            "index_distal",
            "ring_distal",
        )
    }
    assert found == {
        "forearm": -1.0,
        "hand": 0.0,
        "index_proximal": 10.0,
        "index_middle": 10.0,
        "index_distal": 110.0,
        "ring_distal": 0.0,
    }
    assert len(PARENTS) == len(JOINTS)


def test_time_alone_loses_no_heading() -> None:
    t = np.arange(0.0, 4000.0, 1.0)
    _, q_GB = _moving()
    still = np.repeat(q_GB[:1], len(t), axis=0)
    still[:, SEGMENT["little_middle"]] = np.nan
    _, lost = _stepped(t, still, [])
    assert not lost.any()


def test_a_heading_learnt_from_one_look_is_filterpys(rng: np.random.Generator) -> None:
    before = 1.0
    q_GB = quat.normalize(rng.normal(size=(17, 4)))
    joints = len(PARENTS)
    state = heading_constraints.State(
        np.zeros(joints), np.full(joints, before), np.zeros(17), np.zeros(joints, bool), 0.0
    )
    miss, slope = heading_constraints._constraint_residuals(state.delta, q_GB)
    new = heading_constraints._update(PARAMS, state, 0.0, q_GB, np.zeros(17), np.ones(17, bool))
    play = np.radians(PARAMS.joint_play) ** 2
    R = play * PARAMS.joint_play_time / heading_constraints.UPDATE * np.eye(3)
    assert slope.any(axis=1).sum() > 5
    for j in np.flatnonzero(slope.any(axis=1)):
        mean, P = update(np.zeros(1), np.array([[before]]), miss[j], R, slope[j][:, None])
        if P[0, 0] > play:
            np.testing.assert_allclose(
                np.array([new.delta[j], new.variance[j]]),
                np.array([mean[0], P[0, 0]]),
                rtol=1e-10,
                atol=1e-10,
            )
