"""Decomposition and composition of joint rotations, at the singular edge too."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    DEVIATION,
    FLEXION,
    IS_DOF,
    JOINT,
    JOINTS,
    LIMITS,
    PRONATION,
    SEGMENT,
    SEGMENTS,
)
from handscope.estimators.numerics import quaternions as quat
from tests.estimators.numerics.test_quaternions import SHAPES, assert_same_rotation
from tests.simulated import DEG

WITHIN = st.tuples(
    st.floats(-np.pi, np.pi), st.floats(-89.9 * DEG, 89.9 * DEG), st.floats(-np.pi, np.pi)
)


@given(st.sampled_from(SHAPES), st.lists(WITHIN, min_size=6, max_size=6))
def test_decompose_undoes_compose(
    shape: tuple[int, ...], drawn: list[tuple[float, float, float]]
) -> None:
    angles = np.array(drawn)[: int(np.prod(shape))].reshape(*shape, 3)
    back = joint_angles.decompose(joint_angles.compose(angles))
    wrapped = (back - angles + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(wrapped, 0.0, atol=1e-9)


@given(arrays(float, (4, 3), elements=st.floats(-np.pi, np.pi)))
def test_compose_turns_about_z_then_x_then_y(angles: np.ndarray) -> None:
    z, x, y = (
        quat.about(axis, angles[:, k]) for axis, k in ((2, FLEXION), (0, DEVIATION), (1, PRONATION))
    )
    np.testing.assert_allclose(
        joint_angles.compose(angles), quat.multiply(quat.multiply(z, x), y), atol=1e-15
    )


@given(st.lists(WITHIN, min_size=3, max_size=3))
def test_the_angles_are_scipys_intrinsic_zxy(drawn: list[tuple[float, float, float]]) -> None:
    q = joint_angles.compose(np.array(drawn))
    reference = Rotation.from_quat(q, scalar_first=True).as_euler("ZXY")
    difference = (joint_angles.decompose(q) - reference + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(difference, 0.0, atol=1e-8)


@pytest.mark.parametrize(("axis", "angle"), [(2, FLEXION), (0, DEVIATION), (1, PRONATION)])
def test_a_turn_about_one_axis_is_one_angle(axis: int, angle: int) -> None:
    expected = np.zeros(3)
    expected[angle] = 40 * DEG
    np.testing.assert_allclose(
        joint_angles.decompose(quat.about(axis, 40 * DEG)), expected, atol=1e-15
    )


def test_each_angle_turns_the_child_about_its_axis(rng: np.random.Generator) -> None:
    angles = rng.uniform([-3.0, -1.5, -3.0], [3.0, 1.5, 3.0], (30, 3))
    step = 1e-6 * np.eye(3)
    q = joint_angles.compose(angles)[:, None]
    # (30, angle, 3)
    turned = quat.log(quat.relative(q, joint_angles.compose(angles[:, None] + step)))
    np.testing.assert_allclose(joint_angles.axes(angles), turned.swapaxes(1, 2) / 1e-6, atol=1e-5)


@given(st.sampled_from([-1.0, 1.0]), st.floats(1e-6, 1e-3), st.floats(-3, 3), st.floats(-3, 3))
def test_close_to_gimbal_lock_the_rotation_is_kept(
    side: float, off: float, flexion: float, pronation: float
) -> None:
    q = joint_angles.compose(np.array([flexion, side * (np.pi / 2 - off), pronation]))
    assert_same_rotation(joint_angles.compose(joint_angles.decompose(q)), q, atol=1e-7)


@given(st.sampled_from([-1.0, 1.0]), st.floats(-3, 3), st.floats(-3, 3))
def test_in_gimbal_lock_the_angles_are_finite(
    side: float, flexion: float, pronation: float
) -> None:
    angles = joint_angles.decompose(
        joint_angles.compose(np.array([flexion, side * np.pi / 2, pronation]))
    )
    assert np.isfinite(angles).all()
    np.testing.assert_allclose(angles[DEVIATION], side * np.pi / 2, atol=1e-7)


def test_rounding_beyond_one_does_not_make_nan() -> None:
    q = quat.about(0, np.pi / 2) * (1 + 1e-15)
    assert 2 * (q[0] * q[1]) > 1
    assert joint_angles.decompose(q)[DEVIATION] == np.pi / 2


def test_angles_of_segments_are_those_between_neighbours(rng: np.random.Generator) -> None:
    q_GS = quat.normalize(rng.normal(size=(5, len(SEGMENTS), 4)))
    q_GS[2, SEGMENT["index_middle"]] = np.nan
    angles = joint_angles.of_segments(q_GS)
    parent, child = q_GS[:, SEGMENT["ring_middle"]], q_GS[:, SEGMENT["ring_distal"]]
    np.testing.assert_array_equal(
        angles[:, JOINT["ring_dip"]], joint_angles.decompose(quat.relative(parent, child))
    )
    unknown = np.isnan(angles[2]).all(axis=-1)
    assert {JOINTS[j].name for j in np.flatnonzero(unknown)} == {"index_pip", "index_dip"}


@given(arrays(float, (len(JOINTS), 3), elements=st.floats(-np.pi, np.pi)))
def test_constrained_angles_are_freedoms_within_their_limits(angles: np.ndarray) -> None:
    angles[JOINT["wrist"]] = np.nan
    kept = joint_angles.constrain(angles)
    assert np.isnan(kept[JOINT["wrist"]]).all()
    np.testing.assert_array_equal(np.isnan(joint_angles.mask_non_freedoms(kept))[1:], ~IS_DOF[1:])
    others = np.arange(len(JOINTS)) != JOINT["wrist"]
    assert (kept[others] >= LIMITS[others, :, 0]).all()
    assert (kept[others] <= LIMITS[others, :, 1]).all()
    assert (kept[others][~IS_DOF[others]] == 0).all()
    inside = IS_DOF & (angles >= LIMITS[..., 0]) & (angles <= LIMITS[..., 1])
    np.testing.assert_array_equal(kept[inside], angles[inside])
