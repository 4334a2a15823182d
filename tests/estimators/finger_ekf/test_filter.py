"""The finger filter: exact propagation, honest covariances."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from filterpy.stats import NESS
from scipy.stats import chi2

from handscope.estimators.finger_ekf import filter as finger_ekf_filter
from handscope.estimators.finger_ekf import measurements as finger_ekf_measurements
from handscope.estimators.finger_ekf import sensor_to_segment
from handscope.estimators.finger_ekf.filter import FilterParams, State
from handscope.estimators.finger_ekf.samples import Samples
from handscope.estimators.finger_ekf.sensor_to_segment import SensorToSegmentPrior
from handscope.estimators.hand import joint_angles
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from tests.estimators.finger_ekf.test_jacobians import joint_jacobian

DEG = np.pi / 180
RATE = 200.0
# MCP, PIP, DIP
FREE_INDEX, LIMITS_INDEX = (
    finger_ekf_measurements.IS_FREE[1],
    finger_ekf_measurements.LIMITS[1],
)
WHITE = FilterParams(
    correlation=0.0,
    inclination_time=0.0,
    inclination=0.3,
    gyr_scale=0.0,
    bias_sd=0.1,
    creeping=1e3,
    dimension_noise=1.0,
    misalignment=1.0,
)
WHITE = replace(WHITE, inclination_by_rate=0.0, acc_bias=0.0)


def test_a_pose_determines_joints_and_mounting_except_about_the_vertical() -> None:
    """The covariance after the pose against 20000 people who put on sensors askew, miss the pose
    and are calibrated by gravity."""
    rng, params, trials = (
        np.random.default_rng(1),
        FilterParams(misalignment=1.0, pose_sd=0.5, angle_sd=0.2),
        20000,
    )
    up = np.array([1.0, 0.0, 0.0])
    # segment to sensor
    q_nominal = quat.multiply(
        quat.exp(1.0 * DEG * rng.normal(size=(trials, 4, 3))),
        np.tile(quat.IDENTITY, (trials, 4, 1)),
    )
    missed = 0.5 * DEG * rng.normal(size=(trials, 3, 3)) * FREE_INDEX
    q_joint = joint_angles.compose(missed)
    q_HS = quat.multiply(_chained(q_joint), quat.conjugate(q_nominal))  # of the sensors as they sit
    seen = quat.rotate(quat.conjugate(q_HS), up)
    seen += 0.2 * DEG * rng.normal(size=(trials, 4, 3)) * [0, 1, 1]
    # small: each sensor's frame is turned until it sees up where the hand's sees it
    turn = quat.exp(np.cross(seen, seen[:, :1]))
    q_SB = quat.multiply(turn, q_nominal)
    q_pc = quat.relative(
        quat.multiply(q_HS, quat.conjugate(turn))[:, :3],
        quat.multiply(q_HS, quat.conjugate(turn))[:, 1:],
    )
    errors = np.concatenate(
        [quat.log(q_pc).reshape(trials, 9), quat.log(q_SB).reshape(trials, 12)], axis=1
    )
    P = sensor_to_segment.covariance_after_pose(
        params,
        np.tile(quat.IDENTITY, (1, 3, 1)),
        np.tile(9.81 * up, (1, 4, 1)),
        FREE_INDEX[None],
        _prior(params),
    )[0]
    kept = np.r_[0:9, 21:33]
    np.testing.assert_allclose(np.cov(errors.T) / DEG**2, P[np.ix_(kept, kept)] / DEG**2, atol=0.06)


def test_a_pose_leaves_each_freedom_of_a_thumb_held_aside_to_what_is_missed() -> None:
    """Its axes are not at right angles there."""
    params = FilterParams(misalignment=1e-3, angle_sd=1e-6, pose_sd=1.45)
    angles = np.array([[[30.0, -45.0, 60.0], [0, 0, 0], [0, 0, 0]]]) * DEG
    q_pc = joint_angles.compose(angles)
    up = quat.rotate(quat.conjugate(_chained(q_pc)), np.array([1.0, 0.0, 0.0]))
    P = sensor_to_segment.covariance_after_pose(
        params, q_pc, up, finger_ekf_measurements.IS_FREE[:1], _prior(params)
    )[0]
    A = joint_jacobian(q_pc, np.tile(quat.IDENTITY, (1, 4, 1)), np.zeros((1, 3, 3))).A[0]
    J = finger_ekf_measurements.angle_jacobian(angles[0, 0], angles[0, 0])
    of_angles = J @ (A @ P @ A.T)[:3, :3] @ J.T
    np.testing.assert_allclose(np.sqrt(np.diag(of_angles)) / DEG, 1.45, rtol=1e-3)


def _chained(q_pc: Array) -> Array:
    """Orientations (F, 4, 4) of a chain's segments against its first, of the rotations of its
    joints (F, 3, 4)."""
    q = [np.tile(quat.IDENTITY, (len(q_pc), 1))]
    for j in range(3):
        q.append(quat.multiply(q[-1], q_pc[:, j]))
    return np.stack(q, axis=1)


def _samples(
    t: Array, turn: Array, acc: Array | None = None, q_first: Array | None = None
) -> Samples:
    n, fingers = turn.shape[:2]
    first = (
        np.tile(quat.IDENTITY, (n, fingers, 3, 1))
        if q_first is None
        else np.broadcast_to(q_first, (n, fingers, 3, 4))
    )
    dt = np.diff(t, prepend=t[0])
    return Samples(
        t,
        turn,
        np.broadcast_to(dt[:, None, None], turn.shape[:3]).copy(),
        np.full(turn.shape, np.nan) if acc is None else acc,
        np.zeros(turn.shape[:3]),
        np.ones((n, fingers, 3), bool),
        first,
    )


def test_constant_rates_of_both_segments_are_followed_exactly_for_a_minute() -> None:
    """Stepping with the relative rate alone drifts by 37.5 deg here."""
    t = np.arange(0.0, 60.0, 0.01)
    w = np.zeros((1, 4, 3))
    w[0, 0], w[0, 1] = [0.0, 1.3, 0.0], [0.0, 0.0, 3.6]
    turn = np.broadcast_to(w * 0.01, (len(t), 1, 4, 3)).copy()
    turn[0] = 0.0
    params = FilterParams(dimensions=False, rest_rate=0.01)
    _, estimate = finger_ekf_filter.step(params, _index(params), _samples(t, turn))
    exact = quat.multiply(quat.exp(-w[0, 0] * t[:, None]), quat.exp(w[0, 1] * t[:, None]))
    assert quat.angle(quat.relative(exact, estimate.q_joint[:, 0, 0])).max() < 1e-9


def _index(params: FilterParams, trials: int = 1) -> State:
    """Index fingers that start."""
    bias_sd = np.full((trials, 4), params.bias_sd * DEG)
    free, limits = (np.broadcast_to(x, (trials, *x.shape)) for x in (FREE_INDEX, LIMITS_INDEX))
    return finger_ekf_filter.start(bias_sd, _prior(params, trials), free, limits)


def _prior(params: FilterParams, trials: int = 1) -> SensorToSegmentPrior:
    """Sensors put on somehow, their frames aligned by the pose."""
    sd = DEG * np.repeat([params.misalignment, params.pose_sd], [12, 9])
    return SensorToSegmentPrior(np.tile(np.diag(sd**2), (trials, 1, 1)), np.ones((trials, 4), bool))


def _finger_trials(
    rng: np.random.Generator, params: FilterParams, trials: int, seconds: float
) -> tuple[Samples, Array, Array, Array]:
    """Index fingers that bend while the hand turns, drawn as the model says: samples, the true q_pc
    between sensors and of the joints (n, trials, 3, 4), the true biases at the end (trials, 4,
    3)."""
    t = np.arange(0.0, seconds, 1 / RATE)
    flexion = (
        0.6 * (np.cos(2 * np.pi * 0.4 * t[:, None, None]) - 1) * rng.uniform(-1, -0.2, (trials, 3))
    )
    missed = params.pose_sd * DEG * rng.normal(size=(trials, 3, 3)) * FREE_INDEX
    angles = missed + flexion[..., None] * [1.0, 0.0, 0.0]
    q_joint = joint_angles.compose(angles)
    tilt = 0.5 * np.sin(2 * np.pi * rng.uniform(0.05, 0.3, (trials, 3)) * t[:, None, None])
    q_GB = [quat.exp(tilt)]
    for j in range(3):
        q_GB.append(quat.multiply(q_GB[-1], q_joint[:, :, j]))
    walked = np.zeros((len(t), trials, 4, 3))
    (of_walk,) = rng.spawn(1)
    steps = of_walk.normal(size=(len(t) - 1, trials, 4, 2))
    walked[1:, ..., :2] = params.mounting_walk * DEG / np.sqrt(RATE) * steps.cumsum(axis=0)
    straight = quat.multiply(
        quat.exp(params.misalignment * DEG * rng.normal(size=(trials, 4, 3))), quat.exp(walked)
    )
    k = (
        params.skin
        * DEG
        / (np.pi / 2)
        / np.sqrt(3)
        * rng.normal(size=(trials, 3, 3))
        * np.array([np.sqrt(2), 1, 1])[:, None]
    )
    by_skin = np.concatenate(
        [np.tile(quat.IDENTITY, (len(t), trials, 1, 1)), quat.exp(-angles[..., :1] * k)], axis=2
    )
    q_GS = quat.multiply(np.stack(q_GB, axis=2), quat.conjugate(quat.multiply(straight, by_skin)))
    up = quat.rotate(quat.conjugate(q_GS), np.array([1.0, 0.0, 0.0]))  # x is up in the pose
    wrong = params.angle_sd * DEG * rng.normal(size=(trials, 4, 3))
    seen = up[0] + np.cross(wrong, up[0])
    to_hand = np.cross(seen, seen[:, :1])
    size = np.linalg.norm(to_hand, axis=-1, keepdims=True)
    # calibration turns each sensor's frame until it sees up where the hand's does
    aligned = quat.exp(to_hand * np.arcsin(size) / size.clip(1e-12))
    q_GS, up = quat.multiply(q_GS, quat.conjugate(aligned)), quat.rotate(aligned, up)
    turn = quat.log(quat.relative(np.concatenate([q_GS[:1], q_GS[:-1]]), q_GS))
    bias = params.bias_sd * DEG * rng.normal(size=(trials, 4, 3))
    walk = (
        params.bias_walk
        * DEG
        / np.sqrt(RATE)
        * rng.normal(size=(len(t), trials, 4, 3)).cumsum(axis=0)
    )
    noise = params.gyr_noise * DEG * np.sqrt(RATE / 2) * rng.normal(size=turn.shape)
    turn[1:] += (bias + walk + noise)[1:] / RATE
    acc = 9.80665 * (up + params.inclination * DEG * rng.normal(size=up.shape))
    return (
        _samples(t, turn, acc),
        quat.relative(q_GS[:, :, :3], q_GS[:, :, 1:]),
        q_joint,
        bias + walk[-1],
    )


def _nees(state: State, q_true: Array, bias: Array) -> Array:
    """Normalised error squared of each trial's 21 states of rotations between sensors and
    biases."""
    dth = quat.log(quat.relative(state.q_pc, q_true)).reshape(len(q_true), 9)
    error = np.concatenate([dth, (bias - state.bias).reshape(len(q_true), 12)], axis=-1)
    return np.array(NESS(error, np.zeros_like(error), state.P[:, :21, :21]))


def _nees_of_joints(estimate: finger_ekf_filter.Estimate, q_joint: Array) -> Array:
    d = quat.log(quat.relative(estimate.q_joint[-1], q_joint[-1])).reshape(len(q_joint[-1]), 9)
    return np.array(NESS(d, np.zeros_like(d), estimate.P[-1] + 1e-9 * np.eye(9)))


def _bounds(freedoms: int, trials: int) -> tuple[float, float]:
    """95 % bounds of the mean of chi squared."""
    low, high = (float(chi2.ppf(p, freedoms * trials)) / trials for p in (0.025, 0.975))
    return low, high


@pytest.mark.parametrize("seconds", [1.0, 10.0])
def test_standard_deviations_of_joints_rotations_and_biases_are_honest_on_data_as_modelled(
    seconds: float,
) -> None:
    """Everything at once, joints that are true hinges but for what the noise says; means over 100
    fingers within the 95 % bounds of chi squared."""
    trials = 100
    samples, q_true, q_joint, bias = _finger_trials(
        np.random.default_rng(7), WHITE, trials, seconds + 0.5 / RATE
    )
    free = replace(WHITE, dimensions=False)
    state, estimate = finger_ekf_filter.step(free, _index(free, trials), samples)
    assert state.newest == state.t
    low, high = _bounds(21, trials)
    assert low < _nees(state, q_true[-1], bias).mean() < high
    low, high = _bounds(9, trials)
    assert low < _nees_of_joints(estimate, q_joint).mean() < high


def test_gyroscope_noise_alone_makes_angles_walk_as_predicted() -> None:
    """No vertical, biases next to nothing: 9 angles of 300 fingers after 2 s."""
    params, trials = (
        replace(WHITE, dimensions=False, gyr_noise=0.3, bias_sd=1e-4, bias_walk=1e-8),
        300,
    )
    samples, q_true, _, _ = _finger_trials(
        np.random.default_rng(11), params, trials, 2.0 + 0.5 / RATE
    )
    acc = np.full(samples.acc.shape, np.nan)
    acc[0] = samples.acc[0]
    state, _ = finger_ekf_filter.step(params, _index(params, trials), replace(samples, acc=acc))
    dth = quat.log(quat.relative(state.q_pc, q_true[-1])).reshape(trials, 9)
    low, high = _bounds(9, trials)
    assert (
        low
        < (dth * np.linalg.solve(state.P[:, :9, :9], dth[..., None])[..., 0]).sum(axis=-1).mean()
        < high
    )


def test_what_joints_cannot_do_makes_them_better_known_and_the_filter_no_less_careful() -> None:
    """True hinges play less than their noise says, so the filter may only be too careful."""
    trials = 50
    samples, _, q_joint, _ = _finger_trials(
        np.random.default_rng(8), WHITE, trials, 20.0 + 0.5 / RATE
    )
    free, errors, sizes = replace(WHITE, dimensions=False), [], []
    for params in (WHITE, free):
        _, estimate = finger_ekf_filter.step(params, _index(params, trials), samples)
        assert _nees_of_joints(estimate, q_joint).mean() < _bounds(9, trials)[1]
        errors.append(quat.angle(quat.relative(estimate.q_joint[-200:], q_joint[-200:])).mean())
        sizes.append(np.trace(estimate.P[-1], axis1=1, axis2=2).mean())
    assert errors[0] < 0.7 * errors[1]
    assert sizes[0] < 0.7 * sizes[1]


def test_biases_are_found_while_the_fingers_move_and_better_while_they_rest() -> None:
    params, trials = replace(WHITE, bias_sd=1.0, creeping=0.1), 20
    samples, _, _, bias = _finger_trials(np.random.default_rng(9), params, trials, 20.0)
    state, _ = finger_ekf_filter.step(params, _index(params, trials), samples)
    relative = np.sqrt(((state.bias - bias) ** 2).mean()) / np.sqrt((bias**2).mean())
    assert relative < 0.9  # what turns all sensors alike can be told from none of them
    still = np.broadcast_to(bias / RATE, samples.turn.shape).copy()
    state, _ = finger_ekf_filter.step(
        replace(params, rest_rate=10.0),
        _index(params, trials),
        replace(samples, turn=still, acc=samples.acc[:1] + 0 * samples.acc),
    )
    error = (state.bias - bias) / np.sqrt(state.P[:, range(9, 21), range(9, 21)]).reshape(
        trials, 4, 3
    )
    assert np.sqrt(((state.bias - bias) ** 2).mean()) < 0.1 * DEG
    assert np.sqrt((error**2).mean()) < 1.2


def test_missing_samples_cost_certainty_and_leave_no_nan() -> None:
    samples, q_true, _, _ = _finger_trials(np.random.default_rng(3), WHITE, 5, 4.0)
    params = FilterParams()
    gap = (samples.t > 2.0) & (samples.t < 3.0)
    acc, turn, rotation_variance, bias_time = (
        samples.acc.copy(),
        samples.turn.copy(),
        samples.rotation_variance.copy(),
        samples.bias_time.copy(),
    )
    acc[gap, :, 2], turn[gap, :, 2], bias_time[gap, :, 2] = np.nan, 0.0, 0.0
    rotation_variance[gap, :, 2] = (60 * DEG) ** 2 * 0.005 / 0.25
    holed = replace(
        samples, acc=acc, turn=turn, rotation_variance=rotation_variance, bias_time=bias_time
    )
    (_, whole), (state, estimate) = (
        finger_ekf_filter.step(params, _index(params, 5), s) for s in (samples, holed)
    )
    assert np.isfinite(estimate.q_joint).all()
    assert np.isfinite(state.P).all()
    k = int(np.flatnonzero(gap)[-1])
    at, at_whole = (
        int(np.searchsorted(f.update_rows, k, side="right")) - 1 for f in (estimate, whole)
    )
    sd = np.sqrt(np.trace(estimate.P[at, :, 3:6, 3:6], axis1=1, axis2=2))
    assert (sd > 20 * DEG).all()
    assert (quat.angle(quat.relative(estimate.q_joint[k, :, 1], q_true[k, :, 1])) < 3 * sd).all()
    assert (
        np.linalg.eigvalsh(state.P[:, :42, :42]) > 0
    ).all()  # without magnetometers the last is nothing
    assert (
        np.trace(estimate.P[at], axis1=1, axis2=2)
        > 10 * np.trace(whole.P[at_whole], axis1=1, axis2=2)
    ).all()


def test_rotation_variance_of_a_gap_shows_at_once() -> None:
    """Between two updates a sensor is bridged: from that sample on the joint is less sure, not from
    the next update."""
    samples, _, _, _ = _finger_trials(np.random.default_rng(5), WHITE, 2, 2.0)
    row, rotation_variance = 215, samples.rotation_variance.copy()
    rotation_variance[row, 0, 2] = (5 * DEG) ** 2
    # turns about the vertical are then told by nothing else
    params = replace(WHITE, dimensions=False)
    _, estimate = finger_ekf_filter.step(
        params, _index(params, 2), replace(samples, rotation_variance=rotation_variance)
    )
    assert row in estimate.update_rows
    at = int(np.searchsorted(estimate.update_rows, row))
    sd = np.sqrt(np.trace(estimate.P[at - 1 : at + 1, 0, 3:6, 3:6], axis1=1, axis2=2))
    assert sd[1] > sd[0] + 2 * DEG


@pytest.mark.parametrize("where", [[1], [7, 8, 9], [100, 101, 350, 351, 352, 500]])
def test_samples_may_be_cut_anywhere(where: list[int]) -> None:
    samples, _, _, _ = _finger_trials(np.random.default_rng(4), WHITE, 5, 3.0)
    samples.known[:250, 2, 1] = False  # a sensor that is plugged in later
    state = _index(WHITE, 5)
    whole_state, whole = finger_ekf_filter.step(WHITE, state, samples)
    pieces, update_rows = [], []
    for a, b in zip([0, *where], [*where, len(samples)]):
        state, piece = finger_ekf_filter.step(WHITE, state, samples.between(slice(a, b)))
        pieces.append(piece)
        update_rows.append(piece.update_rows + a)
    np.testing.assert_array_equal(np.concatenate([p.q_joint for p in pieces]), whole.q_joint)
    np.testing.assert_array_equal(np.concatenate([p.P for p in pieces]), whole.P)
    np.testing.assert_array_equal(np.concatenate(update_rows), whole.update_rows)
    np.testing.assert_array_equal(state.P, whole_state.P)


def test_a_state_that_was_kept_does_not_change() -> None:
    samples, _, _, _ = _finger_trials(np.random.default_rng(4), WHITE, 5, 3.0)
    begun = finger_ekf_filter.step(WHITE, _index(WHITE, 5), samples.between(slice(0, 333)))[0]
    kept = pickle.dumps(begun)
    finger_ekf_filter.step(WHITE, begun, samples.between(slice(333, None)))
    assert pickle.dumps(begun) == kept
