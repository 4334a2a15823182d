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
INNER, ALONE = (
    3,
    12,
)  # steps of the angles at the beginning of a window, in each pass and where nothing else is fitted
SETTLED = 1e-4  # share of a window's misfit that another step has to gain
# series of sine and cosine
S3, S5, S7, S9, S11, S13 = (
    -1.0 / 6,
    1.0 / 120,
    -1.0 / 5040,
    1.0 / 362880,
    -1.0 / 39916800,
    1.0 / 6227020800,
)
C2, C4, C6, C8, C10, C12, C14 = (
    -0.5,
    1.0 / 24,
    -1.0 / 720,
    1.0 / 40320,
    -1.0 / 3628800,
    1.0 / 479001600,
    -1.0 / 87178291200,
)


@inlined
def corrected(w: Array, dr: float, di: float, br: float, bi: float, out: Array) -> None:
    """Rates whose frame is tilted by the rotation vector (-di, dr, 0), to the second order, with their biases."""
    square, along = 0.5 * (dr * dr + di * di), 0.5 * (dr * w[1] - di * w[0])
    out[0] = w[0] + dr * w[2] - di * along - square * w[0] + br
    out[1] = w[1] + di * w[2] + dr * along - square * w[1] + bi
    out[2] = w[2] - dr * w[0] - di * w[1] - square * w[2]


@inlined
def correct_window(wa: Array, wb: Array, first: int, x: Array, a: Array, b: Array) -> None:
    """Rates (m, 3) of parent and child in a window, their tilts and biases taken away."""
    for j in range(len(a)):
        corrected(wb[first + j], x[0], x[1], x[2], x[3], b[j])
        corrected(wa[first + j], x[4], x[5], x[6], x[7], a[j])


@inlined
def sine(x: float) -> float:
    """To 1e-12 up to 1 rad: calls of the library would take most of a walk."""
    if abs(x) > 1.0:
        return math.sin(x)
    s = x * x
    return x * (1.0 + s * (S3 + s * (S5 + s * (S7 + s * (S9 + s * (S11 + s * S13))))))


@inlined
def cosine(x: float) -> float:
    """The same."""
    if abs(x) > 1.0:
        return math.cos(x)
    s = x * x
    return 1.0 + s * (C2 + s * (C4 + s * (C6 + s * (C8 + s * (C10 + s * (C12 + s * C14))))))


@inlined
def begin_hinge(a: Array, b: Array, weight: Array, first: int, dt: float) -> float:
    """Angle at which a window best begins."""
    c, s, re, im = 1.0, 0.0, 0.0, 0.0
    for j in range(len(a)):
        half = 0.5 * dt * (b[j, 2] - a[j, 2])
        ch, sh = cosine(half), sine(half)
        c, s = c * ch - s * sh, s * ch + c * sh
        w = weight[first + j]
        if w > 0.0:
            pr, pi = c * a[j, 0] + s * a[j, 1], c * a[j, 1] - s * a[j, 0]
            re += w * (pr * b[j, 0] + pi * b[j, 1])
            im += w * (pr * b[j, 1] - pi * b[j, 0])
        c, s = c * ch - s * sh, s * ch + c * sh
    return math.atan2(im, re)


@inlined
def walk_begin(
    a: Array, b: Array, weight: Array, first: int, dt: float, begin: Array, sums: Array
) -> float:
    """Sum of squares of a window of a joint that abducts; sums (5,) of products of the derivatives by the angle and the abduction at its beginning, and of these with the residual."""
    carried, abducted, total = 0.0, begin[1], 0.0
    c, s = math.cos(begin[0]), -math.sin(begin[0])
    a11, a12, a22, b1, b2 = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(len(a)):
        ca, sa = cosine(abducted), sine(abducted)
        half = 0.5 * dt * (b[j, 2] / ca - a[j, 2] + sa / ca * (c * a[j, 1] - s * a[j, 0]))
        ch, sh = cosine(half), sine(half)
        c, s = c * ch - s * sh, s * ch + c * sh
        pr, pi = c * a[j, 0] + s * a[j, 1], c * a[j, 1] - s * a[j, 0]
        c, s = c * ch - s * sh, s * ch + c * sh
        by_abduction = -b[j, 2] * ca - b[j, 1] * sa
        by_angle = -pr + by_abduction * (carried + 0.5 * dt * pi)
        left = b[j, 1] * ca - b[j, 2] * sa - pi
        w = weight[first + j]
        a11 += w * by_angle * by_angle
        a12 += w * by_angle * by_abduction
        a22 += w * by_abduction * by_abduction
        b1 += w * by_angle * left
        b2 += w * by_abduction * left
        total += w * left * left
        carried += dt * pi
        abducted = min(max(abducted + dt * (b[j, 0] - pr), -1.0), 1.0)
    sums[0], sums[1], sums[2], sums[3], sums[4] = a11, a12, a22, b1, b2
    return total


@inlined
def settle_begin(
    a: Array,
    b: Array,
    weight: Array,
    first: int,
    dt: float,
    begin: Array,
    sums: Array,
    steps: int,
) -> float:
    """Sum of squares of a window of a joint that abducts; angle and abduction (in place) at which it best begins, near those given."""
    square = walk_begin(a, b, weight, first, dt, begin, sums)
    for _ in range(steps):
        a11, a12, a22 = sums[0] + 1e-9, sums[1], sums[2] + ABDUCTED**-2
        b1, b2 = sums[3], sums[4] + begin[1] * ABDUCTED**-2
        det = a11 * a22 - a12 * a12
        d0 = (b1 * a22 - b2 * a12) / det
        d1 = (b2 * a11 - b1 * a12) / det
        if b1 * d0 + b2 * d1 < SETTLED * square:
            break
        before0, before1 = begin[0], begin[1]
        begin[0] -= min(max(d0, -1.0), 1.0)
        begin[1] = min(max(begin[1] - d1, -0.6), 0.6)
        after = walk_begin(a, b, weight, first, dt, begin, sums)
        if after > square:
            begin[0], begin[1] = before0, before1
            break
        square = after
    return float(square)


@inlined
def walk_window(
    wa: Array,
    wb: Array,
    a: Array,
    b: Array,
    weight: Array,
    first: int,
    dt: float,
    begin: Array,
    has_abduction: bool,
    out: Array,
) -> float:
    """Sum of squares of a window; out (11, 11), lower half: of products of the derivatives by the unknowns, by the angle and the abduction at its beginning, and of the residual."""
    ia, ib = np.zeros(2), np.zeros(2)
    d, e = np.zeros(SIZE + 3), np.zeros(SIZE + 3)
    carried = np.zeros(SIZE + 1)  # derivatives of abduction
    clear(out)
    abducted = begin[1]
    c, s = math.cos(begin[0]), -math.sin(begin[0])
    for j in range(len(a)):
        i = first + j
        ca, sa = cosine(abducted), sine(abducted)
        turn = dt * (b[j, 2] - a[j, 2])
        if has_abduction:
            turn = dt * (b[j, 2] / ca - a[j, 2] + sa / ca * (c * a[j, 1] - s * a[j, 0]))
        ch, sh = cosine(0.5 * turn), sine(0.5 * turn)
        c, s = c * ch - s * sh, s * ch + c * sh
        pr, pi = c * a[j, 0] + s * a[j, 1], c * a[j, 1] - s * a[j, 0]
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
            d[10], e[10] = b[j, 0] - pr, b[j, 1] - pi
            if has_abduction:
                e[9] = -b[j, 2] * ca - b[j, 1] * sa
                e[10] = b[j, 1] * ca - b[j, 2] * sa - pi
                for p in range(SIZE + 1):
                    e[p] += e[9] * (carried[p] + 0.5 * dt * d[p])
                    carried[p] += dt * d[p]
            for p in range(SIZE + 3):
                own = weight[i] * e[p]
                for q in range(p + 1):
                    out[p, q] += own * e[q]
            if not has_abduction:
                for p in range(SIZE + 3):
                    own = weight[i] * d[p]
                    for q in range(p + 1):
                        out[p, q] += own * d[q]
        if has_abduction:
            abducted = min(max(abducted + dt * (b[j, 0] - pr), -1.0), 1.0)
        c, s = c * ch - s * sh, s * ch + c * sh
        for k in range(2):
            ia[k] += 0.5 * dt * wa[i, k]
            ib[k] += 0.5 * dt * wb[i, k]
    return float(out[SIZE + 2, SIZE + 2])


@inlined
def walk_hinge(a: Array, b: Array, weight: Array, first: int, dt: float, angle: float) -> float:
    """Sum of squares of a window of a hinge."""
    c, s, total = math.cos(angle), -math.sin(angle), 0.0
    for j in range(len(a)):
        half = 0.5 * dt * (b[j, 2] - a[j, 2])
        ch, sh = cosine(half), sine(half)
        c, s = c * ch - s * sh, s * ch + c * sh
        re, im = b[j, 0] - c * a[j, 0] - s * a[j, 1], b[j, 1] - c * a[j, 1] + s * a[j, 0]
        total += weight[first + j] * (re * re + im * im)
        c, s = c * ch - s * sh, s * ch + c * sh
    return total


@inlined
def count_samples(weight: Array, m: int, has_abduction: bool, count: Array) -> None:
    """Components (K,) with a weight in each window of m samples; 0 where a window misses too many."""
    for k in range(len(count)):
        count[k] = 0.0
        for i in range(k * m, k * m + m):
            if weight[i] > 0.0:
                count[k] += 1.0 if has_abduction else 2.0
        if count[k] < m * 0.7:
            count[k] = 0.0


@looped
def leave_rates(
    wa: Array, wb: Array, weight: Array, m: int, dt: float, has_abduction: bool, x: Array
) -> Array:
    """Mean squares (K,) that are left over at given unknowns, in variances, as `fit_rates` has them at the best."""
    K = len(weight) // m
    a, b, sums = np.empty((m, 3)), np.empty((m, 3)), np.empty(5)
    begin, count, rest = np.zeros(2), np.zeros(K), np.full(K, np.nan)
    count_samples(weight, m, has_abduction, count)
    for k in range(K):
        if count[k] > 0.0:
            correct_window(wa, wb, k * m, x, a, b)
            begin[0], begin[1] = begin_hinge(a, b, weight, k * m, dt), 0.0
            if has_abduction:
                square = settle_begin(a, b, weight, k * m, dt, begin, sums, ALONE)
            else:
                square = walk_hinge(a, b, weight, k * m, dt, begin[0])
            rest[k] = square / count[k]
    return rest


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
    a, b, sums = np.empty((m, 3)), np.empty((m, 3)), np.empty(5)
    count_samples(weight, m, has_abduction, count)
    least = np.inf
    for turn in range(passes):
        N, g = np.zeros((SIZE, SIZE)), np.zeros(SIZE)
        cost = 0.0
        for p in range(SIZE):
            cost += prior[p] * tried[p] ** 2
            N[p, p], g[p] = prior[p], prior[p] * tried[p]
        for k in range(K):
            rest[k] = np.nan
            if count[k] == 0.0:
                continue
            here = begin[k]
            correct_window(wa, wb, k * m, tried, a, b)
            if not has_abduction or turn == 0:
                here[0] = begin_hinge(a, b, weight, k * m, dt)
            if has_abduction:
                settle_begin(a, b, weight, k * m, dt, here, sums, INNER)
            square = walk_window(wa, wb, a, b, weight, k * m, dt, here, has_abduction, out)
            if has_abduction:
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
