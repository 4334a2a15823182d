"""The fingers' filter: its derivatives, its exact turns, its honesty."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from estimators import ekf_updates, finger_ekf
from estimators import quaternions as quat
from estimators.finger_ekf import FilterParams, Samples, State
from estimators.quaternions import Array

DEG = np.pi / 180
RATE = 200.0
FORBIDS_INDEX = ekf_updates.FORBIDS[1]  # MCP, PIP, DIP
WHITE = FilterParams(correlation=0.0, acc_error=0.0, acc_noise=0.05, gyr_scale=0.0, lever=0.0, acc_gate=5.0, rate_gate=50.0)


def _derivative(f: Callable[[Array], Array], size: int, step: float = 1e-6) -> Array:
    """Central differences: the last axis is that of the argument."""
    return np.stack([(f(step * e) - f(-step * e)) / (2 * step) for e in np.eye(size)], axis=-1)


def _random(rng: np.random.Generator, *shape: int) -> Array:
    return quat.normalize(rng.normal(size=(*shape, 4)))


def test_the_transition_of_errors_is_the_derivative_of_the_two_sided_update(rng: np.random.Generator) -> None:
    """Ten samples of fast and unequal turning, 21 errors put in before, 9 read off behind."""
    q_pc, turns = _random(rng, 1, 3), rng.normal(scale=0.1, size=(10, 1, 4, 3))
    bias_time = rng.uniform(0.002, 0.02, size=(10, 1, 4))

    def after(turns: Array) -> Array:
        turned = [np.tile(quat.IDENTITY, (1, 4, 1))]
        for turn in turns:
            turned.append(quat.multiply(turned[-1], quat.exp(turn)))
        return np.array(turned[1:])

    def ended(errors: Array) -> Array:
        q = quat.multiply(q_pc, quat.exp(errors[:9].reshape(1, 3, 3)))
        wrong = turns - errors[9:].reshape(1, 4, 3) * bias_time[..., None]
        return quat.log(quat.relative(q_new, finger_ekf.carried(q, after(wrong)[-1]))).ravel()

    T = after(turns)
    q_new = finger_ekf.carried(q_pc, T[-1])
    F, _ = finger_ekf.transition(q_new, T[-1], finger_ekf.by_biases(turns, T, bias_time))
    np.testing.assert_allclose(F[0, :9, :21], _derivative(ended, 21), atol=1e-7)
    np.testing.assert_array_equal(F[0, 9:], np.eye(27)[9:])


def test_the_turning_errors_of_sensors_enter_as_the_derivative_says(rng: np.random.Generator) -> None:
    q_pc, T = _random(rng, 1, 3), _random(rng, 1, 4)
    q_new = finger_ekf.carried(q_pc, T)

    def ended(errors: Array) -> Array:
        wrong = quat.multiply(T, quat.exp(errors.reshape(1, 4, 3)))
        return quat.log(quat.relative(q_new, finger_ekf.carried(q_pc, wrong))).ravel()

    _, G = finger_ekf.transition(q_new, T, np.zeros((1, 4, 3, 3)))
    np.testing.assert_allclose(G[0], _derivative(ended, 12), atol=1e-7)


def test_vector_and_dimension_jacobians_are_derivatives(rng: np.random.Generator) -> None:
    q_pc, v = _random(rng, 6), 9.8 * rng.normal(size=(6, 3))

    def moved(dth: Array) -> Array:
        return quat.multiply(q_pc, quat.exp(dth))

    vectors = _derivative(lambda dth: quat.rotate(moved(dth), v), 3)
    np.testing.assert_allclose(ekf_updates.vector_jacobian(quat.matrix(q_pc), v), vectors, atol=1e-7)
    leaning = _derivative(lambda dth: ekf_updates.leaning(quat.matrix(moved(dth))), 3)
    np.testing.assert_allclose(ekf_updates.leaning_jacobian(quat.matrix(q_pc)[:, 2]), leaning, atol=1e-7)


def test_a_hinge_about_z_and_only_it_leans_nowhere() -> None:
    flexed = ekf_updates.leaning(quat.matrix(quat.about(2, np.linspace(-1, 2, 7))))
    np.testing.assert_allclose(flexed, 0.0, atol=1e-15)
    deviated, pronated = (ekf_updates.leaning(quat.matrix(quat.about(axis, np.array(0.2)))) for axis in (0, 1))
    np.testing.assert_allclose(deviated, [0.0, np.sin(0.2)], atol=1e-15)
    np.testing.assert_allclose(pronated, [-np.sin(0.2), 0.0], atol=1e-15)


def test_a_hinge_tells_nothing_of_its_flexion_however_it_seems_to_lean(rng: np.random.Generator) -> None:
    R = quat.matrix(_random(rng, 4, 3))
    forbids = np.ones((4, 3, 2), bool)
    told = ekf_updates.dimensions(FilterParams(), R, forbids, np.ones((4, 3), bool))
    np.testing.assert_array_equal(told.H[..., 2::3], 0.0)


def _samples(t: Array, turn: Array, acc: Array | None = None, q_first: Array | None = None) -> Samples:
    n, fingers = turn.shape[:2]
    first = np.tile(quat.IDENTITY, (n, fingers, 3, 1)) if q_first is None else np.broadcast_to(q_first, (n, fingers, 3, 4))
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
    params = FilterParams(dimensions=False)
    _, found = finger_ekf.step(params, finger_ekf.start(params, FORBIDS_INDEX[None]), _samples(t, turn))
    exact = quat.multiply(quat.exp(-w[0, 0] * t[:, None]), quat.exp(w[0, 1] * t[:, None]))
    assert quat.angle(quat.relative(exact, found.q_pc[:, 0, 0])).max() < 1e-9


def _finger_trials(rng: np.random.Generator, params: FilterParams, trials: int, seconds: float) -> tuple[Samples, Array, Array]:
    """Fingers that bend while the hand turns, drawn as the model says: samples, true q_pc (n, trials, 3, 4), true biases (trials, 4, 3)."""
    t = np.arange(0.0, seconds, 1 / RATE)
    flexion = 0.6 * (1 - np.cos(2 * np.pi * 0.4 * t[:, None, None] + rng.uniform(0, 6, (trials, 3)))) * rng.uniform(0.2, 1, (trials, 3))
    q_pc = np.broadcast_to(quat.about(2, flexion), (len(t), trials, 3, 4))
    tilt = 0.5 * np.sin(2 * np.pi * rng.uniform(0.05, 0.3, (trials, 3)) * t[:, None, None] + rng.uniform(0, 6, (trials, 3)))
    q_G = [quat.exp(tilt)]
    for j in range(3):
        q_G.append(quat.multiply(q_G[-1], q_pc[:, :, j]))
    q_GB = np.stack(q_G, axis=2)
    turn = quat.log(quat.relative(np.concatenate([q_GB[:1], q_GB[:-1]]), q_GB))
    bias = params.bias_sd * DEG * rng.normal(size=(trials, 4, 3))
    walk = params.bias_walk / np.sqrt(RATE) * rng.normal(size=(len(t), trials, 4, 3)).cumsum(axis=0)
    noise = params.gyr_noise * DEG * np.sqrt(RATE / 2) * rng.normal(size=turn.shape)
    turn[1:] += (bias + walk + noise)[1:] / RATE
    up = quat.rotate(quat.conjugate(q_GB), np.array([0.0, 0.0, 9.81]))
    acc = up + params.acc_noise * rng.normal(size=up.shape)
    q_first = quat.multiply(q_pc[0], quat.exp(params.angle_sd * DEG * rng.normal(size=(trials, 3, 3))))
    return _samples(t, turn, acc, q_first), q_pc, bias + walk[-1]


def _nees(state: State, q_true: Array, bias: Array) -> Array:
    """Normalised error squared of each trial's 21 states."""
    dth = quat.log(quat.relative(state.q_pc, q_true)).reshape(len(q_true), 9)
    error = np.concatenate([dth, (bias - state.bias).reshape(len(q_true), 12)], axis=-1)
    return np.asarray((error * np.linalg.solve(state.P[:, :21, :21], error[..., None])[..., 0]).sum(axis=-1))


@pytest.mark.parametrize("seconds", [1.0, 10.0])
def test_standard_deviations_of_all_21_states_are_honest_on_data_as_modelled(seconds: float) -> None:
    """Sensors alone; the mean over 100 fingers within the 95 % bounds of chi squared."""
    params, trials = replace(WHITE, dimensions=False), 100
    samples, q_true, bias = _finger_trials(np.random.default_rng(7), params, trials, seconds + 0.5 / RATE)
    state, _ = finger_ekf.step(params, finger_ekf.start(params, np.broadcast_to(FORBIDS_INDEX, (trials, 3, 2))), samples)
    assert state.newest == state.t
    low, high = chi2.ppf([0.025, 0.975], 21 * trials) / trials
    assert low < _nees(state, q_true[-1], bias).mean() < high


def test_noise_of_the_gyroscopes_alone_makes_angles_walk_as_said() -> None:
    """No accelerometers, biases next to nothing: 9 angles of 100 fingers after 2 s."""
    params, trials = replace(WHITE, dimensions=False, gyr_noise=0.3, angle_sd=1e-3, bias_sd=1e-4, bias_walk=1e-8), 100
    samples, q_true, _ = _finger_trials(np.random.default_rng(11), params, trials, 2.0 + 0.5 / RATE)
    blind = replace(samples, acc=np.full(samples.acc.shape, np.nan))
    state, _ = finger_ekf.step(params, finger_ekf.start(params, np.broadcast_to(FORBIDS_INDEX, (trials, 3, 2))), blind)
    dth = quat.log(quat.relative(state.q_pc, q_true[-1])).reshape(trials, 9)
    low, high = chi2.ppf([0.025, 0.975], 9 * trials) / trials
    assert low < (dth * np.linalg.solve(state.P[:, :9, :9], dth[..., None])[..., 0]).sum(axis=-1).mean() < high


def test_what_joints_cannot_do_keeps_errors_within_three_standard_deviations() -> None:
    """True hinges play less than their noise says, so the filter may only be too careful."""
    trials = 100
    samples, q_true, bias = _finger_trials(np.random.default_rng(8), WHITE, trials, 10.0 + 0.5 / RATE)
    forbids = np.broadcast_to(FORBIDS_INDEX, (trials, 3, 2))
    with_joints, _ = finger_ekf.step(WHITE, finger_ekf.start(WHITE, forbids), samples)
    free = replace(WHITE, dimensions=False)
    without, _ = finger_ekf.step(free, finger_ekf.start(free, forbids), samples)
    assert _nees(with_joints, q_true[-1], bias).mean() < chi2.ppf(0.975, 21 * trials) / trials
    assert np.trace(with_joints.P[:, :9, :9], axis1=1, axis2=2).mean() < np.trace(without.P[:, :9, :9], axis1=1, axis2=2).mean()


def test_biases_are_found_while_the_fingers_move() -> None:
    params, trials = replace(WHITE, bias_sd=1.0), 20
    samples, _, bias = _finger_trials(np.random.default_rng(9), params, trials, 20.0)
    state, _ = finger_ekf.step(params, finger_ekf.start(params, np.broadcast_to(FORBIDS_INDEX, (trials, 3, 2))), samples)
    relative = np.sqrt(((state.bias - bias) ** 2).mean()) / np.sqrt((bias**2).mean())
    assert relative < 0.9  # what turns all sensors alike can be told from none of them


def test_missing_samples_cost_certainty_and_leave_no_nan() -> None:
    samples, q_true, _ = _finger_trials(np.random.default_rng(3), WHITE, 5, 4.0)
    params = FilterParams()
    gap = (samples.t > 2.0) & (samples.t < 3.0)
    acc, turn, doubt, bias_time = samples.acc.copy(), samples.turn.copy(), samples.doubt.copy(), samples.bias_time.copy()
    acc[gap, :, 2], turn[gap, :, 2], bias_time[gap, :, 2] = np.nan, 0.0, 0.0
    doubt[gap, :, 2] = (60 * DEG) ** 2 * 0.005 / 0.25
    holed = replace(samples, acc=acc, turn=turn, doubt=doubt, bias_time=bias_time)
    (whole, _), (state, found) = (finger_ekf.step(params, finger_ekf.start(params), s) for s in (samples, holed))
    assert np.isfinite(found.q_pc).all()
    assert np.isfinite(state.P).all()
    k = int(np.flatnonzero(gap)[-1])
    sd = np.sqrt(np.trace(found.P[k, :, 3:6, 3:6], axis1=1, axis2=2))
    assert (sd > 20 * DEG).all()
    assert (quat.angle(quat.relative(found.q_pc[k, :, 1], q_true[k, :, 1])) < 3 * sd).all()
    assert (np.linalg.eigvalsh(state.P) > 0).all()
    assert (np.trace(state.P, axis1=1, axis2=2) > np.trace(whole.P, axis1=1, axis2=2)).all()


@pytest.mark.parametrize("where", [[1], [7, 8, 9], [100, 101, 350, 351, 352, 500]])
def test_samples_may_be_cut_anywhere(where: list[int]) -> None:
    samples, _, _ = _finger_trials(np.random.default_rng(4), WHITE, 5, 3.0)
    samples.known[:250, 2, 1] = False  # a sensor that is plugged in later
    state = finger_ekf.start(WHITE)
    whole_state, whole = finger_ekf.step(WHITE, state, samples)
    pieces = []
    for a, b in zip([0, *where], [*where, len(samples)]):
        state, piece = finger_ekf.step(WHITE, state, Samples(*(getattr(samples, n)[a:b] for n in Samples.__dataclass_fields__)))
        pieces.append(piece)
    np.testing.assert_array_equal(np.concatenate([p.q_pc for p in pieces]), whole.q_pc)
    np.testing.assert_array_equal(np.concatenate([p.P for p in pieces]), whole.P)
    np.testing.assert_array_equal(state.P, whole_state.P)
