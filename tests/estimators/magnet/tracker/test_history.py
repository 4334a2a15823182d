"""What a sample says of the one before, by the arithmetic of a textbook."""

import numpy as np

from handscope.estimators.magnet.tracker.history import (
    Trace,
    decouple_sample,
    make_trace,
    split_covariance,
    store_prediction,
)
from handscope.estimators.magnet.tracker.state import OWN

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
