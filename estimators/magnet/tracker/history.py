"""What is kept of every sample for who goes back (magnet_smoothing.py); compiled.

In      state x and covariance P as magnet_filter.py has them, before a sample's readings and with them
Out     for the errors of trunk and hand what the next sample's say of them, and how sure they are where that one is known
Source  Rauch, Tung & Striebel 1965, AIAA Journal 3:1445: gain C = P F' S^-1, S = F P F' + Q; what the next one leaves open, P - C S C'
Leaves  what was told before and is not exact (moment, places, calibrations) is the same error in every sample and does not average out: gains are those of
        errors beside it, and by what it explains they stay uncertain
"""

from typing import Any, NamedTuple

import numpy as np

from handscope.estimators.magnet.tracker.state import OWN
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.small_matrices import (
    cholesky,
    clear,
    product,
    put,
    solve_lower,
    solve_upper,
    spread,
)
from handscope.estimators.numerics.typing import Array


class Trace(NamedTuple):
    """Of n samples; without rows where nobody goes back."""

    expected: Array  # (n, 45 + 6 L) the state before the sample's readings
    state: Array  # (n, 45 + 6 L) with them
    gain: Any  # (n, 30, 30) float32: what errors of the sample say of those of the sample before
    open: Any  # (n, 30, 30) float32: covariance of those if the sample's were known
    own: Any  # (n, 30, 30) float32: covariance of the sample's errors, with its readings
    lasting: Array  # (n, 30) variances by what was told before; in no covariance here


def make_trace(rows: int, size: int) -> Trace:
    """Room for samples of a state of that size, of which nothing is known."""
    expected, state = np.full((2, rows, size), np.nan)
    gain, left_open, own = np.zeros((3, rows, OWN, OWN), np.float32)
    return Trace(expected, state, gain, left_open, own, np.full((rows, OWN), np.nan))


def slice_trace(trace: Trace | None, rows: slice) -> Trace | None:
    """Some of its samples."""
    return None if trace is None else Trace(*(a[rows] for a in trace))


@inlined
def split_covariance(P: Array, own: Array, lasting: Array) -> None:
    """The covariance of trunk's and hand's errors (30, 30) in two: by the errors behind them, which do not move, and without: A B^-1 A', P - A B^-1 A'."""
    many = len(P) - OWN
    L, W = np.empty((many, many)), np.empty((many, OWN))
    put(P[OWN:, :OWN], W)
    if cholesky(P[OWN:, OWN:], L):
        solve_lower(L, W)
    else:
        clear(W)
    gram_matrix(W, lasting)
    for i in range(OWN):
        for j in range(OWN):
            own[i, j] = P[i, j] - lasting[i, j]


@inlined
def gram_matrix(W: Array, WW: Array) -> None:
    """W' W."""
    clear(WW)
    for k in range(W.shape[0]):
        for i in range(W.shape[1]):
            for j in range(i + 1):
                WW[i, j] += W[k, i] * W[k, j]
    for i in range(len(WW)):
        for j in range(i):
            WW[j, i] = WW[i, j]


@inlined
def store_prediction(
    trace: Trace, n: int, x: Array, P: Array, F: Array, own: Array, lasting: Array
) -> None:
    """Before the readings of sample n: what it will say of the one before, whose errors have the covariance own + lasting (30, 30) and became by F what
    they are now."""
    S, L, W, WW = (
        np.empty((OWN, OWN)),
        np.empty((OWN, OWN)),
        np.empty((OWN, OWN)),
        np.empty((OWN, OWN)),
    )
    for i in range(len(x)):
        trace.expected[n, i] = x[i]
    spread(F, lasting, S)
    for i in range(OWN):
        for j in range(OWN):
            S[i, j] = P[i, j] - S[i, j]
    if not cholesky(S, L):
        decouple_sample(trace, n, own)
        return
    product(F, own, W)
    solve_lower(L, W)
    gram_matrix(W, WW)
    solve_upper(L, W)
    for i in range(OWN):
        for j in range(OWN):
            trace.gain[n, i, j] = W[j, i]
            trace.open[n, i, j] = own[i, j] - WW[i, j]


@inlined
def decouple_sample(trace: Trace, n: int, own: Array) -> None:
    """Sample n says nothing of the one before, whose errors have the covariance own."""
    clear(trace.gain[n])
    put(own, trace.open[n])


@inlined
def store_update(trace: Trace, n: int, x: Array, P: Array, own: Array, lasting: Array) -> None:
    """With the readings of sample n; own and lasting become its."""
    split_covariance(P, own, lasting)
    for i in range(len(x)):
        trace.state[n, i] = x[i]
    put(own, trace.own[n])
    for i in range(OWN):
        trace.lasting[n, i] = lasting[i, i]
