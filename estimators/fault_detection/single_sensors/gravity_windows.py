"""Specific force averaged over windows, in one frame that the gyroscope carries along: there gravity must stand still.

In      cells of readings; per sensor the matrix M that turns the gyroscope's readings y into rates M y about the accelerometer's axes
Out     per chain of windows the mean specific forces, and how they change with M, with the biases, with a delay of the gyroscope and with a lever arm
Source  preintegration: Forster et al. 2017, IEEE Trans Robot 33:1; specific force averaged in an almost inertial frame: Laidig & Seel 2023 (VQF); use ours
Limits  a window's mean is gravity plus the change of velocity that its weights see; weights without steps leave little of a movement that comes back.
        The lever arm takes what turns about a fixed centre; other accelerations stay as noise, whose size the fit estimates
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.single_sensors.cells import (
    CELL,
    HOP,
    KNOTS,
    WINDOW,
    Cells,
    begins,
)
from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.small_matrices import clear, put
from handscope.estimators.numerics.typing import Array

MATRIX, GYR_BIAS, ACC_BIAS, ARM, DELAY = slice(0, 9), slice(9, 12), slice(12, 15), slice(15, 18), 18
PARAMETERS = 19
SERIES = 0.1  # rad^2, of half a cell's turn: below it four terms are exact to 1e-12
PHASE = 2 * np.pi * (np.arange(WINDOW) + 0.5) / WINDOW
WEIGHT = (1 - np.cos(PHASE)) / WINDOW
SECOND = (
    (2 * np.pi / (WINDOW * CELL)) ** 2 * np.cos(PHASE) / WINDOW
)  # 1/s^2, the weights' second derivative by time


@dataclass(frozen=True)
class Windows:
    """Chains (G) of windows (K) of sensors (S)."""

    t: Array  # (G, K) s, middles
    force: Array  # (G, S, K, 3) m/s^2 in the frame that each chain begins with
    slope: Array  # (G, S, K, 3, PARAMETERS) of the force by M (row by row), biases, lever arm and delay; or none (G, S, K, 3, 0)
    path: Array  # (G, S) rad that the gyroscope reads in all, whatever M
    valid: NDArray[np.bool_]  # (G, S, K)


def windows_of(
    cells: Cells,
    M: Array,
    with_slope: bool = True,
    chains: slice = slice(None),
    columns: NDArray[np.intp] | None = None,
) -> Windows:
    """Average the specific force over windows in the frame that a gyroscope read as M y carries along.

    Parameters
    ----------
    cells : Cells
        Readings of S sensors.
    M : Array
        (S, 3, 3) or (3, 3), takes readings to rates about the accelerometer's axes.
    with_slope : bool
        Whether the derivatives are computed.
    chains : slice
        Of the chains that the cells hold those that are wanted.
    columns : Array, optional
        (S,) sensors whose readings are taken, where one is wanted with several matrices; else each once.
    """
    columns = np.arange(cells.valid.shape[1]) if columns is None else columns
    first, S = begins(len(cells.valid))[chains], len(columns)
    force = np.zeros((len(first), S, KNOTS, 3))
    slope = np.zeros((len(first), S, KNOTS, 3, PARAMETERS if with_slope else 0))
    M = np.ascontiguousarray(np.broadcast_to(M, (S, 3, 3)), dtype=float)
    readings = cells.gyr, cells.acc, columns
    if with_slope:
        _average(*readings, M, first, WEIGHT, SECOND, CELL, HOP, force, slope)
    else:
        _average_force(*readings, M, first, WEIGHT, CELL, HOP, force)
    t = np.asarray(
        cells.start + CELL * (first[:, None] + HOP * np.arange(KNOTS) + 0.5 * WINDOW), float
    )
    path, valid = cells.path[chains][:, columns], cells.unbroken[chains][:, columns]
    return Windows(t, force, slope, path, valid)


@inlined
def sine_and_versed(size: float) -> tuple[float, float]:
    """sin(a) / a and (1 - cos(a)) / a^2 of an angle whose square is `size`."""
    if size < SERIES:
        short: tuple[float, float] = short_sine_and_versed(size)
        return short
    angle = math.sqrt(size)
    return math.sin(angle) / angle, (1.0 - math.cos(angle)) / size


@inlined
def short_sine_and_versed(size: float) -> tuple[float, float]:
    """The same of a small angle."""
    sine = 1 - size / 6 * (1 - size / 20 * (1 - size / 42 * (1 - size / 72)))
    return sine, 0.5 - size / 24 * (1 - size / 30 * (1 - size / 56 * (1 - size / 90)))


@looped
def _average_force(
    gyr: Array,
    acc: Array,
    columns: NDArray[np.intp],
    M: Array,
    first: NDArray[np.intp],
    weight: Array,
    dt: float,
    hop: int,
    force: Array,
) -> None:
    """Fill force alone, the frames as quaternions: faults are first compared without slopes.

    Sensors and matrices are the last axis of all that is computed, so that several are computed at once.
    """
    G, S, K = force.shape[:3]
    length = len(weight)
    q, half, a, u = np.empty((4, S)), np.empty((3, S)), np.empty((3, S)), np.empty((3, S))
    total = np.empty((K, 3, S))
    for g in range(G):
        for s in range(S):
            q[0, s], q[1, s], q[2, s], q[3, s] = 1.0, 0.0, 0.0, 0.0
        for k in range(K):
            clear(total[k])
        for b in range((K - 1) * hop + length):
            row = first[g] + b
            for s in range(S):
                c = columns[s]
                g0, g1, g2 = gyr[row, c, 0], gyr[row, c, 1], gyr[row, c, 2]
                for i in range(3):
                    a[i, s] = acc[row, c, i]
                    rate = M[s, i, 0] * g0 + M[s, i, 1] * g1 + M[s, i, 2] * g2
                    half[i, s] = 0.25 * dt * rate
            _carry(q[0], q[1], q[2], q[3], half, a, u[0], u[1], u[2])
            for k in range(max(0, (b - length + hop) // hop), min(K - 1, b // hop) + 1):
                for i in range(3):
                    _add_share(weight[b - k * hop], u[i], total[k, i])
        for s in range(S):
            for k in range(K):
                for i in range(3):
                    force[g, s, k, i] = total[k, i, s]


@inlined
def _add_share(share: float, values: Array, total: Array) -> None:
    for s in range(len(values)):
        total[s] += share * values[s]


@inlined
def _carry(
    W: Array, X: Array, Y: Array, Z: Array, half: Array, a: Array, u0: Array, u1: Array, u2: Array
) -> None:
    """Carry frames (S,) over a cell in two halves (3, S) rad, as quaternions have it, and turn forces (3, S) into them in its middle."""
    S = len(W)
    size, sine, versed = np.empty(S), np.empty(S), np.empty(S)
    for s in range(S):
        e0, e1, e2 = half[0, s], half[1, s], half[2, s]
        size[s] = e0 * e0 + e1 * e1 + e2 * e2
        sine[s], versed[s] = short_sine_and_versed(size[s])
    for s in range(S):
        if not size[s] < SERIES:
            sine[s], versed[s] = sine_and_versed(size[s])
    for s in range(S):
        w, x, y, z = W[s], X[s], Y[s], Z[s]
        cosine = 1 - versed[s] * size[s]
        e0, e1, e2 = sine[s] * half[0, s], sine[s] * half[1, s], sine[s] * half[2, s]
        p = w * cosine - x * e0 - y * e1 - z * e2  # in the middle of the cell
        q = w * e0 + x * cosine + y * e2 - z * e1
        r = w * e1 - x * e2 + y * cosine + z * e0
        t = w * e2 + x * e1 - y * e0 + z * cosine
        a0, a1, a2 = a[0, s], a[1, s], a[2, s]
        c0, c1, c2 = 2 * (r * a2 - t * a1), 2 * (t * a0 - q * a2), 2 * (q * a1 - r * a0)
        u0[s] = a0 + p * c0 + r * c2 - t * c1
        u1[s] = a1 + p * c1 + t * c0 - q * c2
        u2[s] = a2 + p * c2 + q * c1 - r * c0
        W[s] = p * cosine - q * e0 - r * e1 - t * e2
        X[s] = p * e0 + q * cosine + r * e2 - t * e1
        Y[s] = p * e1 - q * e2 + r * cosine + t * e0
        Z[s] = p * e2 + q * e1 - r * e0 + t * cosine


@looped
def _average(
    gyr: Array,
    acc: Array,
    columns: NDArray[np.intp],
    M: Array,
    first: NDArray[np.intp],
    weight: Array,
    second: Array,
    dt: float,
    hop: int,
    force: Array,
    slope: Array,
) -> None:
    """Fill force and slope: a wrong rate dw turns all that follows by the integral of R dw."""
    G, S, K = force.shape[:3]
    length = len(weight)
    R, E, mid, after = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    turned, here, u = np.empty((3, 13)), np.empty((3, 13)), np.empty(3)
    for g in range(G):
        for s in range(S):
            clear(R)
            R[0, 0] = R[1, 1] = R[2, 2] = 1.0
            clear(turned)
            for b in range((K - 1) * hop + length):
                y, a = gyr[first[g] + b, columns[s]], acc[first[g] + b, columns[s]]
                x0 = 0.5 * dt * (M[s, 0, 0] * y[0] + M[s, 0, 1] * y[1] + M[s, 0, 2] * y[2])
                x1 = 0.5 * dt * (M[s, 1, 0] * y[0] + M[s, 1, 1] * y[1] + M[s, 1, 2] * y[2])
                x2 = 0.5 * dt * (M[s, 2, 0] * y[0] + M[s, 2, 1] * y[1] + M[s, 2, 2] * y[2])
                size = x0 * x0 + x1 * x1 + x2 * x2
                sine, versed = sine_and_versed(size)
                E[0, 0], E[1, 1], E[2, 2] = (
                    1 - versed * (x1 * x1 + x2 * x2),
                    1 - versed * (x0 * x0 + x2 * x2),
                    1 - versed * (x0 * x0 + x1 * x1),
                )
                E[0, 1], E[1, 0] = versed * x0 * x1 - sine * x2, versed * x0 * x1 + sine * x2
                E[0, 2], E[2, 0] = versed * x0 * x2 + sine * x1, versed * x0 * x2 - sine * x1
                E[1, 2], E[2, 1] = versed * x1 * x2 - sine * x0, versed * x1 * x2 + sine * x0
                for i in range(3):
                    for j in range(3):
                        mid[i, j] = R[i, 0] * E[0, j] + R[i, 1] * E[1, j] + R[i, 2] * E[2, j]
                for i in range(3):
                    u[i] = mid[i, 0] * a[0] + mid[i, 1] * a[1] + mid[i, 2] * a[2]
                    for j in range(3):
                        after[i, j] = (
                            mid[i, 0] * E[0, j] + mid[i, 1] * E[1, j] + mid[i, 2] * E[2, j]
                        )
                put(after, R)
                for i in range(3):
                    here[i, 12] = mid[i, 0] * y[0] + mid[i, 1] * y[1] + mid[i, 2] * y[2]
                    for j in range(3):
                        step = 0.5 * dt * mid[i, j]
                        turned[i, 9 + j] += step
                        here[i, 9 + j] = turned[i, 9 + j]
                        turned[i, 9 + j] += step
                        for k in range(3):
                            turned[i, 3 * j + k] += step * y[k]
                            here[i, 3 * j + k] = turned[i, 3 * j + k]
                            turned[i, 3 * j + k] += step * y[k]
                for k in range(max(0, (b - length + hop) // hop), min(K - 1, b // hop) + 1):
                    w, w2 = weight[b - k * hop], second[b - k * hop]
                    into = force[g, s, k]
                    for i in range(3):
                        into[i] += w * u[i]
                    by = slope[g, s, k]
                    for p in range(13):
                        c = p if p < 12 else 18
                        by[0, c] += w * (here[1, p] * u[2] - here[2, p] * u[1])
                        by[1, c] += w * (here[2, p] * u[0] - here[0, p] * u[2])
                        by[2, c] += w * (here[0, p] * u[1] - here[1, p] * u[0])
                    for i in range(3):
                        for j in range(3):
                            by[i, 12 + j] -= w * mid[i, j]
                            by[i, 15 + j] -= w2 * mid[i, j]
