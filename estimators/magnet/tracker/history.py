"""What the filter stores of every sample for the smoother (smoother.py); compiled.

In      state x and covariance P (state.py), before a sample's readings and with them
Out     smoother gain from each sample to the one before, and the covariance that it leaves
Source  Rauch, Tung & Striebel 1965, AIAA Journal 3:1445: gain C = P F' S^-1 with S = F P F' + Q;
        remaining covariance P - C S C'
Leaves  errors of declared values (moment, positions, calibrations) are the same in every sample and
        do not average out: the gains are those of the motion errors given them, and the variance
        that they cause is kept apart from the recursion
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
    """Of n samples; no rows where nothing is smoothed."""

    expected: Array  # (n, 45 + 6 L) the state before the sample's readings
    state: Array  # (n, 45 + 6 L) the state with them
    gain: Any  # (n, 30, 30) float32: smoother gain to the sample before
    open: Any  # (n, 30, 30) float32: covariance of the sample before, given this one
    own: Any  # (n, 30, 30) float32: covariance with the sample's readings
    lasting: Array  # (n, 30) variances caused by errors of declared values; in no covariance here


def make_trace(rows: int, size: int) -> Trace:
    """Room for samples of a state of that size."""
    expected, state = np.full((2, rows, size), np.nan)
    gain, left_open, own = np.zeros((3, rows, OWN, OWN), np.float32)
    return Trace(expected, state, gain, left_open, own, np.full((rows, OWN), np.nan))


def slice_trace(trace: Trace | None, rows: slice) -> Trace | None:
    """Some of its samples."""
    return None if trace is None else Trace(*(a[rows] for a in trace))


@inlined
def split_covariance(P: Array, own: Array, lasting: Array) -> None:
    """Split the covariance A of the motion errors (30, 30) into what constant errors cause, B C^-1
    B' (lasting), and the rest (own)."""
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
    """Store the link from sample n to the one before, ahead of the readings of n. The errors before
    had the covariance own + lasting (30, 30) and became by F what they are now."""
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
    """Sample n carries no information about the one before, whose errors have the covariance own."""
    clear(trace.gain[n])
    put(own, trace.open[n])


@inlined
def store_update(trace: Trace, n: int, x: Array, P: Array, own: Array, lasting: Array) -> None:
    """Store sample n with its readings; own and lasting become those of n."""
    split_covariance(P, own, lasting)
    for i in range(len(x)):
        trace.state[n, i] = x[i]
    put(own, trace.own[n])
    for i in range(OWN):
        trace.lasting[n, i] = lasting[i, i]
