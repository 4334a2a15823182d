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

from handscope.estimators.fault_detection.single_sensors.cells import CELL, Cells
from handscope.estimators.numerics.jit import loops
from handscope.estimators.numerics.typing import Array

CHAIN, WINDOW, HOP = 250, 50, 25  # cells: 5 s in one frame, averaged over 1 s, every 0.5 s
KNOTS = (CHAIN - WINDOW) // HOP + 1
MATRIX, GYR_BIAS, ACC_BIAS, ARM, DELAY = slice(0, 9), slice(9, 12), slice(12, 15), slice(15, 18), 18
PARAMETERS = 19
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


def windows_of(cells: Cells, M: Array, with_slope: bool = True) -> Windows:
    """Average the specific force over windows in the frame that a gyroscope read as M y carries along.

    Parameters
    ----------
    cells : Cells
        Readings of S sensors.
    M : Array
        (S, 3, 3) or (3, 3), takes readings to rates about the accelerometer's axes.
    with_slope : bool
        Whether the derivatives are computed.

    Returns
    -------
    Windows
        Of as many chains as the cells hold.
    """
    first, S = begins(len(cells.valid)), cells.valid.shape[1]
    force = np.zeros((len(first), S, KNOTS, 3))
    slope = np.zeros((len(first), S, KNOTS, 3, PARAMETERS if with_slope else 0))
    path = np.zeros(force.shape[:2])
    M = np.ascontiguousarray(np.broadcast_to(M, (S, 3, 3)), dtype=float)
    _average(cells.gyr, cells.acc, M, first, WEIGHT, SECOND, CELL, HOP, force, slope, path)
    t = np.asarray(
        cells.start + CELL * (first[:, None] + HOP * np.arange(KNOTS) + 0.5 * WINDOW), float
    )
    return Windows(t, force, slope, path, _unbroken(cells.valid[first[:, None] + np.arange(CHAIN)]))


def begins(n: int) -> NDArray[np.intp]:
    """First cells (G,) of as many chains as n cells hold; a last one that lacks a tenth begins a little earlier."""
    count = (n + CHAIN // 10) // CHAIN
    return np.minimum(np.arange(count) * CHAIN, n - CHAIN) if n >= CHAIN else np.zeros(0, np.intp)


@loops
def _average(
    gyr: Array,
    acc: Array,
    M: Array,
    first: NDArray[np.intp],
    weight: Array,
    second: Array,
    dt: float,
    hop: int,
    force: Array,
    slope: Array,
    path: Array,
) -> None:
    """Fill force and slope: a wrong rate dw turns all that follows by the integral of R dw."""
    G, S, K = force.shape[:3]
    with_slope, length = slope.shape[4] > 0, len(weight)
    R, E, mid, after = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    turned, here, u = np.empty((3, 13)), np.empty((3, 13)), np.empty(3)
    for g in range(G):
        for s in range(S):
            R[:] = 0.0
            R[0, 0] = R[1, 1] = R[2, 2] = 1.0
            turned[:] = 0.0
            for b in range((K - 1) * hop + length):
                y, a = gyr[first[g] + b, s], acc[first[g] + b, s]
                x0 = 0.5 * dt * (M[s, 0, 0] * y[0] + M[s, 0, 1] * y[1] + M[s, 0, 2] * y[2])
                x1 = 0.5 * dt * (M[s, 1, 0] * y[0] + M[s, 1, 1] * y[1] + M[s, 1, 2] * y[2])
                x2 = 0.5 * dt * (M[s, 2, 0] * y[0] + M[s, 2, 1] * y[1] + M[s, 2, 2] * y[2])
                size = x0 * x0 + x1 * x1 + x2 * x2
                angle = math.sqrt(size)
                path[g, s] += dt * math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
                sine = math.sin(angle) / angle if angle > 1e-6 else 1.0
                versed = (1.0 - math.cos(angle)) / size if angle > 1e-6 else 0.5
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
                R[:] = after
                if with_slope:
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
                    if with_slope:
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


def _unbroken(valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which windows (G, S, K) belong to the longest run of a chain without missing cells (G, B, S)."""
    missing = np.concatenate([np.zeros_like(valid[:, :1], int), np.cumsum(~valid, axis=1)], axis=1)
    first = np.arange(KNOTS) * HOP
    begin, end = missing[:, first], missing[:, first + WINDOW]
    whole = begin == end
    run = whole[:, :, None] & whole[:, None] & (begin[:, :, None] == begin[:, None])
    best = np.argmax(run.sum(axis=1), axis=1)
    return np.moveaxis(np.take_along_axis(run, best[:, None, None], axis=1)[:, 0], 1, 2)
