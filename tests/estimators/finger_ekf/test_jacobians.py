"""Measurements of the finger filter: Jacobians are derivatives, gates leave out what disagrees."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from handscope.estimators.finger_ekf import measurements as finger_ekf_measurements
from handscope.estimators.finger_ekf import sensor_to_segment
from handscope.estimators.finger_ekf.filter import FilterParams, pack_params
from handscope.estimators.hand import joint_angles
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from tests.estimators.interpreted import interpreted

DEG = np.pi / 180
SOFT_TISSUE = slice(33, 42)  # rows of the error state
FREE_INDEX = finger_ekf_measurements.IS_FREE[1]  # MCP, PIP, DIP
LIMITS_INDEX = finger_ekf_measurements.LIMITS[1]


def _derivative(f: Callable[[Array], Array], size: int, step: float = 1e-6) -> Array:
    """Central differences: the last axis is that of the argument."""
    return np.stack([(f(e) - f(-e)) / (2 * step) for e in step * np.eye(size)], axis=-1)


def _random(rng: np.random.Generator, *shape: int) -> Array:
    return quat.normalize(rng.normal(size=(*shape, 4)))


@dataclass(frozen=True)
class _Jacobian:
    q: Array  # (F, 3, 4)
    A: Array  # (F, 9, 43)


def joint_jacobian(q_pc: Array, q_SB: Array, soft_tissue_gain: Array) -> _Jacobian:
    estimate = _Jacobian(np.empty(q_pc.shape), np.zeros((len(q_pc), 9, sensor_to_segment.SIZE)))
    for each in zip(q_pc, q_SB, soft_tissue_gain, estimate.q, estimate.A):
        interpreted(sensor_to_segment.joint_jacobian_row)(*each)
    return estimate


def _bent_chain(rng: np.random.Generator) -> tuple[Array, Array]:
    """Seats 8 deg askew and rotations between sensors of a chain that is bent in all its joints."""
    q_SB = quat.exp(8 * DEG * rng.normal(size=(1, 4, 3)))
    q = joint_angles.compose(rng.uniform(-0.3, 1.0, (1, 3, 3)))
    return q_SB, quat.multiply(quat.multiply(q_SB[:, :3], q), quat.conjugate(q_SB[:, 1:]))


def test_the_errors_of_true_joints_follow_from_all_error_states_as_the_derivative_says(
    rng: np.random.Generator,
) -> None:
    """Skin that turns in proportion to flexion, whose own error counts for nothing in it: a part in
    fifty."""
    q_SB, q_pc = _bent_chain(rng)
    soft_tissue_gain = 0.02 * rng.normal(size=(1, 3, 3))
    at = joint_jacobian(q_pc, q_SB, soft_tissue_gain)

    def estimate(x: Array) -> Array:
        parts = (
            quat.multiply(q_pc, quat.exp(x[:9].reshape(1, 3, 3))),
            quat.multiply(q_SB, quat.exp(x[21:33].reshape(1, 4, 3))),
        )
        return quat.log(
            quat.relative(
                at.q, joint_jacobian(*parts, soft_tissue_gain + x[33:42].reshape(1, 3, 3)).q
            )
        ).ravel()

    numeric = _derivative(estimate, sensor_to_segment.SIZE)
    np.testing.assert_allclose(
        at.A[0][:, SOFT_TISSUE],
        numeric[:, SOFT_TISSUE],
        atol=1e-7,
    )
    np.testing.assert_allclose(at.A[0], numeric, atol=0.06)
    at = joint_jacobian(q_pc, q_SB, soft_tissue_gain := np.zeros((1, 3, 3)))
    without = np.delete(np.arange(sensor_to_segment.SIZE), np.r_[SOFT_TISSUE])
    np.testing.assert_allclose(
        at.A[0][:, without], _derivative(estimate, sensor_to_segment.SIZE)[:, without], atol=1e-7
    )


def test_true_joints_of_sensors_that_sit_straight_are_the_rotations_between_them(
    rng: np.random.Generator,
) -> None:
    q_pc, straight = _random(rng, 5, 3), np.tile(quat.IDENTITY, (5, 4, 1))
    np.testing.assert_allclose(
        np.abs((joint_jacobian(q_pc, straight, np.zeros((5, 3, 3))).q * q_pc).sum(axis=-1)),
        1.0,
        atol=1e-12,
    )


def test_skin_turns_the_child_s_sensor_by_its_share_of_the_flexion() -> None:
    """Sensors turned on their segments as the simulator does it: q_BS = exp(flexion k)."""
    flexion, k = (
        np.array([0.9, 1.2, 0.7]),
        0.03 * np.array([[1.0, -0.5, 0.0], [0.2, 1.0, 0.0], [-1.0, 0.3, 0.0]]),
    )
    q = quat.about(2, flexion)
    q_BS = np.concatenate([[quat.IDENTITY], quat.exp(flexion[:, None] * k)])
    q_pc = quat.multiply(quat.multiply(quat.conjugate(q_BS[:3]), q), q_BS[1:])
    estimate = joint_jacobian(q_pc[None], np.tile(quat.IDENTITY, (1, 4, 1)), k[None]).q[0]
    # from which flexion, is of the second order
    assert quat.angle(quat.relative(q, estimate)).max() < 0.1 * DEG
    assert quat.angle(quat.relative(q, q_pc)).max() > 2 * DEG


def test_vector_and_angle_jacobians_are_derivatives(rng: np.random.Generator) -> None:
    q_pc, v, angles = (
        _random(rng, 6),
        9.8 * rng.normal(size=(6, 3)),
        rng.uniform(-1.2, 1.2, (20, 3)),
    )
    vectors = _derivative(lambda dth: quat.rotate(quat.multiply(q_pc, quat.exp(dth)), v), 3)
    for R_pc, v_c, expected in zip(quat.matrix(q_pc), v, vectors):
        H = np.zeros((5, 6))
        interpreted(finger_ekf_measurements.vector_jacobian_row)(R_pc, v_c, 1, 2, H)
        np.testing.assert_allclose(H[1:4, 2:5], expected, atol=1e-7)
        assert not H[[0, 4]].any()
    q = joint_angles.compose(angles)
    turned = _derivative(lambda d: joint_angles.decompose(quat.multiply(q, quat.exp(d))), 3)
    np.testing.assert_allclose(
        finger_ekf_measurements.angle_jacobian(angles, angles), turned, atol=1e-7
    )


@dataclass(frozen=True)
class _Rows:
    innovation: Array  # (F, M)
    H: Array  # (F, M, 42)
    noise: Array  # (F, M, M)


def _constrain(jacobian: _Jacobian) -> _Rows:
    """What index fingers cannot do, three rows a joint."""
    rows = _Rows(
        np.zeros((len(jacobian.q), 18)),
        np.zeros((len(jacobian.q), 18, sensor_to_segment.SIZE)),
        np.zeros((len(jacobian.q), 18, 18)),
    )
    for each in zip(jacobian.q, jacobian.A, rows.innovation, rows.H, rows.noise):
        given = (
            np.eye(sensor_to_segment.SIZE),
            np.full(3, (2 * DEG) ** 2),
            FREE_INDEX.astype(float),
            LIMITS_INDEX,
            np.ones(3),
            5.0,
        )
        interpreted(finger_ekf_measurements.joint_constraints_row)(
            pack_params(FilterParams()), *each[:2], *given, *each[2:]
        )
    return _Rows(rows.innovation[:, 9:], rows.H[:, 9:], rows.noise[:, 9:, 9:])


def test_what_joints_cannot_do_misses_what_the_derivative_says(rng: np.random.Generator) -> None:
    """A chain near what it may be: every angle that is no freedom, by all error states."""
    q_SB, _ = _bent_chain(rng)
    q = joint_angles.compose(np.array([[[0.8, 0.1, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0]]]))
    q_pc = quat.multiply(quat.multiply(q_SB[:, :3], q), quat.conjugate(q_SB[:, 1:]))
    no_skin = np.zeros((1, 3, 3))

    def missed(x: Array) -> Array:
        parts = (
            quat.multiply(q_pc, quat.exp(x[:9].reshape(1, 3, 3))),
            quat.multiply(q_SB, quat.exp(x[21:33].reshape(1, 4, 3))),
        )
        return np.asarray(
            _constrain(joint_jacobian(*parts, no_skin + x[33:42].reshape(1, 3, 3))).innovation[0]
        )

    rows = _constrain(joint_jacobian(q_pc, q_SB, no_skin))
    np.testing.assert_allclose(rows.H[0], -_derivative(missed, sensor_to_segment.SIZE), atol=1e-7)
    np.testing.assert_allclose(rows.innovation, 0.0, atol=1e-12)


def test_a_hinge_gives_no_flexion_information_however_misaligned(
    rng: np.random.Generator,
) -> None:
    angles = rng.uniform(-0.3, 0.3, (4, 3, 3)) + [0.5, 0.0, 0.0]
    straight = np.tile(quat.IDENTITY, (4, 4, 1))
    H = _constrain(joint_jacobian(joint_angles.compose(angles), straight, np.zeros((4, 3, 3)))).H
    np.testing.assert_allclose(H[:, 3:, 5], 0.0, atol=1e-15)  # PIP, about its own z
    np.testing.assert_allclose(H[:, 6:, 8], 0.0, atol=1e-15)  # DIP


def test_only_a_flexion_beyond_its_range_is_measured() -> None:
    straight, flexion = (
        np.tile(quat.IDENTITY, (2, 4, 1)),
        np.array([[0.5, 1.0, 0.5], [0.5, 2.3, 0.5]]),
    )
    rows = _constrain(joint_jacobian(quat.about(2, flexion), straight, np.zeros((2, 3, 3))))
    np.testing.assert_allclose(rows.innovation[:, 3], [0.0, 120 * DEG - 2.3], atol=1e-12)
    assert rows.H[0, 3].any() == np.False_
    assert rows.H[1, 3, 5] == pytest.approx(1.0)


def test_the_gates_leave_out_accelerometers_that_disagree_or_turn_fast() -> None:
    params, up = FilterParams(vertical="accelerometers"), np.tile([9.81, 0.0, 0.0], (3, 4, 1))
    up[1, 2, 0] = 10.5  # the middle phalanx is pushed
    rates = np.zeros((3, 4))
    rates[2, 1] = 3.0  # the proximal one turns
    straight, H = np.tile(quat.IDENTITY, (3, 1)), np.zeros((3, 18, sensor_to_segment.SIZE))
    for case in range(3):
        given = (
            straight,
            up[case],
            up[case] / 9.81,
            np.zeros(4),
            rates[case],
            np.ones(3),
            0.2,
            np.zeros(18),
            H[case],
            np.zeros((18, 18)),
        )
        interpreted(finger_ekf_measurements.vectors_row)(pack_params(params), *given)
    used = np.abs(H[:, :9]).reshape(3, 3, 3, -1).sum(axis=(2, 3)) > 0
    np.testing.assert_array_equal(
        used, [[True, True, True], [True, False, False], [False, False, True]]
    )
