"""Angular rates of two neighbours about the axes that their joint does not turn, compiled.

In      rates (n, 3) of parent and child about the axes of their segments, weights (n,) of the samples, in windows of m
Out     misalignments and biases of both that fit best, and what is left over in each window
Source  a hinge about z leaves the components across it in common: u_b = e^{-i theta} u_a with u = w_x + i w_y, theta the integral of the difference about z (Seel et al. 2012,
        IEEE MSC, 45, who compare their lengths); of a joint with abduction about the child's x the component across both axes is common
Limits  Gauss-Newton, damped where a step does not help (Levenberg 1944); the angle at the beginning of each window is projected out
"""

import math

import numpy as np

from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.small_matrices import clear
from handscope.estimators.numerics.typing import Array

SIZE = 8  # misalignment about x and y and bias of the child, of the parent
ROBUST = 4.0  # residual, in variances, from which on a window counts less (Cauchy)
ABDUCTED = 0.2  # rad, standard deviation of abduction at the beginning of a window
PASSES = 15
DAMPING, CUT, RAISED = (
    0.01,
    0.3,
    10.0,
)  # of the first step, times it after one that helped, after one that did not
ENOUGH = 1e-3  # share of the misfit that a step has to gain
INNER = 3


@inlined
def corrected(w: Array, dr: float, di: float, br: float, bi: float, out: Array) -> None:
    """Rates whose frame is tilted by the rotation vector (-di, dr, 0), to the second order, with their biases."""
    square, along = 0.5 * (dr * dr + di * di), 0.5 * (dr * w[1] - di * w[0])
    out[0] = w[0] + dr * w[2] - di * along - square * w[0] + br
    out[1] = w[1] + di * w[2] + dr * along - square * w[1] + bi
    out[2] = w[2] - dr * w[0] - di * w[1] - square * w[2]


@inlined
def begin_hinge(
    wa: Array, wb: Array, weight: Array, first: int, m: int, dt: float, x: Array
) -> float:
    """Angle at which a window best begins."""
    a, b = np.empty(3), np.empty(3)
    angle, re, im = 0.0, 0.0, 0.0
    for j in range(m):
        i = first + j
        corrected(wb[i], x[0], x[1], x[2], x[3], b)
        corrected(wa[i], x[4], x[5], x[6], x[7], a)
        turn = dt * (b[2] - a[2])
        middle = angle + 0.5 * turn
        angle += turn
        if weight[i] > 0.0:
            c, s = math.cos(middle), math.sin(middle)
            pr, pi = c * a[0] + s * a[1], c * a[1] - s * a[0]
            re += weight[i] * (pr * b[0] + pi * b[1])
            im += weight[i] * (pr * b[1] - pi * b[0])
    return math.atan2(im, re)


@inlined
def walk_window(
    wa: Array,
    wb: Array,
    weight: Array,
    first: int,
    m: int,
    dt: float,
    x: Array,
    begin: Array,
    has_abduction: bool,
    out: Array,
) -> float:
    """Sum of squares of a window; out (11, 11): of products of the derivatives by x, by the angle and the abduction at its beginning, and of the residual."""
    a, b, ia, ib = np.empty(3), np.empty(3), np.zeros(2), np.zeros(2)
    d, e = np.empty(SIZE + 3), np.empty(SIZE + 3)
    carried = np.zeros(SIZE + 1)  # derivatives of abduction
    clear(out)
    angle, abducted = -begin[0], begin[1]
    for j in range(m):
        i = first + j
        corrected(wb[i], x[0], x[1], x[2], x[3], b)
        corrected(wa[i], x[4], x[5], x[6], x[7], a)
        ca, sa = math.cos(abducted), math.sin(abducted)
        turn = dt * (b[2] - a[2])
        if has_abduction:
            c, s = math.cos(angle), math.sin(angle)
            turn = dt * (b[2] / ca - a[2] + sa / ca * (c * a[1] - s * a[0]))
        middle = angle + 0.5 * turn
        angle += turn
        c, s = math.cos(middle), math.sin(middle)
        pr, pi = c * a[0] + s * a[1], c * a[1] - s * a[0]
        for k in range(2):
            ia[k] += 0.5 * dt * wa[i, k]
            ib[k] += 0.5 * dt * wb[i, k]
        if weight[i] > 0.0 or has_abduction:
            z, y = wb[i, 2], wa[i, 2]
            d[0], e[0] = z + pi * ib[0], -pr * ib[0]
            d[1], e[1] = pi * ib[1], z - pr * ib[1]
            d[2], e[2] = 1.0, 0.0
            d[3], e[3] = 0.0, 1.0
            d[4], e[4] = -c * y - pi * ia[0], s * y + pr * ia[0]
            d[5], e[5] = -s * y - pi * ia[1], -c * y + pr * ia[1]
            d[6], e[6] = -c, s
            d[7], e[7] = -s, -c
            d[8], e[8] = pi, -pr
            d[9], e[9] = 0.0, 0.0
            d[10], e[10] = b[0] - pr, b[1] - pi
            if has_abduction:
                e[9] = -b[2] * ca - b[1] * sa
                e[10] = b[1] * ca - b[2] * sa - pi
                for p in range(SIZE + 1):
                    e[p] += e[9] * (carried[p] + 0.5 * dt * d[p])
                    carried[p] += dt * d[p]
            for p in range(SIZE + 3):
                for q in range(p + 1):
                    product = e[p] * e[q]
                    if not has_abduction:
                        product += d[p] * d[q]
                    out[p, q] += weight[i] * product
        if has_abduction:
            abducted += dt * (b[0] - pr)
            abducted = min(max(abducted, -1.0), 1.0)
        for k in range(2):
            ia[k] += 0.5 * dt * wa[i, k]
            ib[k] += 0.5 * dt * wb[i, k]
    return float(out[SIZE + 2, SIZE + 2])


@inlined
def project_out(out: Array, p: int, ridge: float) -> None:
    """One unknown of the window itself out of its sums (lower half)."""
    pivot = out[p, p] + ridge
    for i in range(SIZE + 3):
        if i != p:
            own = out[i, p] if i > p else out[p, i]
            for j in range(i + 1):
                if j != p:
                    other = out[j, p] if j > p else out[p, j]
                    out[i, j] -= own * other / pivot


@looped
def fit_rates(
    wa: Array,
    wb: Array,
    weight: Array,
    m: int,
    dt: float,
    has_abduction: bool,
    start: Array,
    prior: Array,
    passes: int,
) -> tuple[Array, Array]:
    """Unknowns (8,) and mean squares (K,) that are left over in windows of m samples, in variances; NaN where a window has no samples."""
    K = len(weight) // m
    x, tried, damping = start.copy(), start.copy(), DAMPING
    normal, right = np.zeros((SIZE, SIZE)), np.zeros(SIZE)
    rest, best = np.zeros(K), np.zeros(K)
    begin, kept = np.zeros((K, 2)), np.zeros((K, 2))
    out, count = np.empty((SIZE + 3, SIZE + 3)), np.zeros(K)
    for k in range(K):
        for i in range(k * m, k * m + m):
            if weight[i] > 0.0:
                count[k] += 1.0 if has_abduction else 2.0
    least = np.inf
    for turn in range(passes):
        N, g = np.zeros((SIZE, SIZE)), np.zeros(SIZE)
        cost = 0.0
        for p in range(SIZE):
            cost += prior[p] * tried[p] ** 2
            N[p, p], g[p] = prior[p], prior[p] * tried[p]
        for k in range(K):
            rest[k] = np.nan
            if count[k] < m * 0.7:
                continue
            here = begin[k]
            if not has_abduction or turn == 0:
                here[0] = begin_hinge(wa, wb, weight, k * m, m, dt, tried)
            square = walk_window(wa, wb, weight, k * m, m, dt, tried, here, has_abduction, out)
            if has_abduction:
                for _ in range(INNER):
                    a11, a12 = out[SIZE, SIZE] + 1e-9, out[SIZE + 1, SIZE]
                    a22 = out[SIZE + 1, SIZE + 1] + ABDUCTED**-2
                    b1 = out[SIZE + 2, SIZE]
                    b2 = out[SIZE + 2, SIZE + 1] + here[1] * ABDUCTED**-2
                    det = a11 * a22 - a12 * a12
                    d0 = (b1 * a22 - b2 * a12) / det
                    d1 = (b2 * a11 - b1 * a12) / det
                    before0, before1 = here[0], here[1]
                    here[0] -= min(max(d0, -1.0), 1.0)
                    here[1] = min(max(here[1] - d1, -0.6), 0.6)
                    after = walk_window(
                        wa, wb, weight, k * m, m, dt, tried, here, has_abduction, out
                    )
                    if after > square:
                        here[0], here[1] = before0, before1
                        square = walk_window(
                            wa, wb, weight, k * m, m, dt, tried, here, has_abduction, out
                        )
                        break
                    square = after
                project_out(out, SIZE + 1, ABDUCTED**-2)
            project_out(out, SIZE, 1e-9)
            rest[k] = square / count[k]
            w = 1.0 / (1.0 + rest[k] / ROBUST)
            cost += count[k] * ROBUST * math.log1p(rest[k] / ROBUST)
            for p in range(SIZE):
                g[p] += w * out[SIZE + 2, p]
                for q in range(p + 1):
                    N[p, q] += w * out[p, q]
                    if q < p:
                        N[q, p] = N[p, q]
        gained = least - cost
        if gained > 0.0:
            least = cost
            damping *= CUT
            for p in range(SIZE):
                x[p], right[p] = tried[p], g[p]
                for q in range(SIZE):
                    normal[p, q] = N[p, q]
            for k in range(K):
                best[k] = rest[k]
                kept[k, 0], kept[k, 1] = begin[k, 0], begin[k, 1]
            if gained < ENOUGH * (1.0 + abs(cost)):
                break
        else:
            damping *= RAISED
            for k in range(K):
                begin[k, 0], begin[k, 1] = kept[k, 0], kept[k, 1]
        for p in range(SIZE):
            for q in range(SIZE):
                N[p, q] = normal[p, q]
            N[p, p] *= 1.0 + damping
        step = np.linalg.solve(N, right)
        for p in range(SIZE):
            tried[p] = x[p] - step[p]
    return x, best
