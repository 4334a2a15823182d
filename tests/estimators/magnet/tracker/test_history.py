"""What a sample says of the one before, by the arithmetic of a textbook."""

import numpy as np
from filterpy.kalman import rts_smoother, update

from handscope.estimators.magnet.tracker import history
from handscope.estimators.magnet.tracker.history import Trace, make_trace
from handscope.estimators.magnet.tracker.smoother import rts_backward_pass
from handscope.estimators.magnet.tracker.state import ERROR, OWN, STATE
from handscope.estimators.numerics.typing import Array
from tests.estimators.interpreted import interpreted

decouple_sample = interpreted(history.decouple_sample)
split_covariance = interpreted(history.split_covariance)
store_prediction = interpreted(history.store_prediction)
store_update = interpreted(history.store_update)
MANY = OWN + 10  # errors, the last ten of which do not move


def _prediction() -> tuple[Trace, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A covariance before, a transition, the covariance behind it, and the trace of that sample."""
    rng = np.random.default_rng(4)
    A, F, Q = rng.normal(size=(MANY, 2 * MANY)), np.eye(MANY), np.zeros((MANY, MANY))
    F[:OWN, :OWN] += 0.1 * rng.normal(size=(OWN, OWN))
    Q[:OWN, :OWN] = np.diag(rng.uniform(0.1, 1.0, OWN))
    P = A @ A.T
    own, lasting, trace = np.empty((OWN, OWN)), np.empty((OWN, OWN)), make_trace(1, 7)
    split_covariance(P, own, lasting)
    store_prediction(
        trace, 0, np.arange(7.0), F @ P @ F.T + Q, np.ascontiguousarray(F[:OWN, :OWN]), own, lasting
    )
    return trace, P, F, Q, own


def test_what_does_not_move_is_the_same_error_before_and_after() -> None:
    """Without it, the gain and what it leaves open are those of Rauch, Tung and Striebel for errors of which the others are known."""
    trace, P, F, Q, own = _prediction()
    known = P[:OWN, :OWN] - P[:OWN, OWN:] @ np.linalg.inv(P[OWN:, OWN:]) @ P[OWN:, :OWN]
    f, q = F[:OWN, :OWN], Q[:OWN, :OWN]
    gain = known @ f.T @ np.linalg.inv(f @ known @ f.T + q)
    np.testing.assert_allclose(own, known, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(trace.gain[0], gain, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(
        trace.open[0], known - gain @ (f @ known @ f.T + q) @ gain.T, rtol=1e-5, atol=1e-4
    )
    np.testing.assert_array_equal(trace.expected[0], np.arange(7.0))


def test_a_sample_that_follows_from_nothing_leaves_the_one_before_as_it_was() -> None:
    trace, *_, own = _prediction()
    decouple_sample(trace, 0, own)
    assert not trace.gain[0].any()
    np.testing.assert_allclose(trace.open[0], own, rtol=1e-6)


def _random_covariance(rng: np.random.Generator, size: int) -> Array:
    L = rng.normal(size=(size, size))
    return np.asarray(L @ L.T + 0.1 * np.eye(size))


def test_a_smoothed_track_is_filterpys(rng: np.random.Generator) -> None:
    """Ten samples of errors that are no rotations, which have no covariance with the others; gains
    are stored in single precision."""
    n, size = 10, STATE.moment + 6
    linear = np.setdiff1d(
        np.arange(OWN), [*range(ERROR.th_bt, ERROR.th_bt + 3), *range(ERROR.th_gb, ERROR.th_gb + 3)]
    )
    of_state = np.setdiff1d(
        np.arange(STATE.moment),
        [*range(STATE.q_bt, STATE.q_bt + 4), *range(STATE.q_gb, STATE.q_gb + 4)],
    )
    P, x, constant = np.zeros((size - 2, size - 2)), np.zeros(size), np.arange(OWN, size - 2)
    P[np.ix_(linear, linear)] = _random_covariance(rng, len(linear))
    P[constant, constant] = 1.0
    P[range(ERROR.th_bt, ERROR.th_bt + 3), range(ERROR.th_bt, ERROR.th_bt + 3)] = P[
        range(ERROR.th_gb, ERROR.th_gb + 3), range(ERROR.th_gb, ERROR.th_gb + 3)
    ] = 1.0
    x[STATE.q_bt] = x[STATE.q_gb] = 1.0
    trace, own, lasting = make_trace(n, size), np.empty((OWN, OWN)), np.empty((OWN, OWN))
    split_covariance(P, own, lasting)
    F, Q = np.eye(OWN), np.diag(rng.uniform(0.1, 1.0, OWN))
    F[np.ix_(linear, linear)] += 0.1 * rng.normal(size=(len(linear), len(linear)))
    means, covariances = [], []
    for k in range(n):
        if k:
            x[of_state] = F[np.ix_(linear, linear)] @ x[of_state]
            P[:OWN, :OWN] = F @ P[:OWN, :OWN] @ F.T + Q
        store_prediction(trace, k, x, P, F, own, lasting)
        H = np.zeros((4, OWN))
        H[:, linear] = rng.normal(size=(4, len(linear)))
        dx, P[:OWN, :OWN] = update(np.zeros(OWN), P[:OWN, :OWN], rng.normal(size=4), np.eye(4), H)
        x[of_state] += dx[linear]
        store_update(trace, k, x, P, own, lasting)
        means.append(x[of_state].copy())
        covariances.append(P[np.ix_(linear, linear)].copy())
    states, variances = np.empty((n, size)), np.empty((n, OWN))
    rts_backward_pass(trace, np.zeros(OWN), own.copy(), states, variances)
    steps = np.tile(F[np.ix_(linear, linear)], (n, 1, 1)), [Q[np.ix_(linear, linear)]] * n
    mean, covariance, _, _ = rts_smoother(np.array(means), np.array(covariances), *steps)
    np.testing.assert_allclose(states[:, of_state], mean, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(
        variances[:, linear], np.diagonal(covariance, axis1=1, axis2=2), rtol=1e-5, atol=1e-5
    )
