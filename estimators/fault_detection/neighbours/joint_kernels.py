"""The joint between two sensors fitted to sums over the instants of each window, compiled: most of what the checks cost.

In      per window: sums of products of what either sensor contributes to the joint's acceleration; weights of the windows; where the joint may lie
Out     the unknowns, what is left over in each window, the rotation between the sensors in each
Source  normal equations with a nuisance rotation projected out (Golub & Pereyra 1973, SIAM J Numer Anal 10:413); the rotation by SVD (Markley 1988),
        followed by Gauss-Newton steps while the unknowns change
Limits  instants of a window weigh alike
"""

import math

import numpy as np

from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.small_matrices import (
    cholesky,
    clear,
    put,
    solve_lower,
    solve_upper,
)
from handscope.estimators.numerics.typing import Array

UNKNOWNS = 12  # place from the first sensor, from the second; bias of either, in its frame
EACH = 7  # vectors of a sensor: force, arm x, y, z, frame x, y, z
ALL = 2 * EACH
RIDGE = 1e-6  # (m/s^2)^2, keeps the rotation's square invertible where nothing accelerates
STEPS = 4
FARTHEST = 0.3  # rad that a step may turn a window's rotation before it is found anew
COLUMNS = np.array([1, 2, 3, 8, 9, 10, 4, 5, 6, 11, 12, 13])  # of the unknowns among all vectors


@inlined
def factors(x: Array) -> Array:
    """What each vector (14,) counts in the residual."""
    c = np.ones(ALL)
    for i in range(UNKNOWNS):
        c[COLUMNS[i]] = x[i]
    return c


@inlined
def fill_parts(sums: Array, c: Array, begin: int, parts: Array, total: Array) -> None:
    """Sums (7, 3, 3) of a sensor's vectors with the joint's acceleration by the second sensor; that of the joint's acceleration (3, 3), the vectors by `c` from `begin` on."""
    clear(total)
    for p in range(EACH):
        for i in range(3):
            for j in range(3):
                part = 0.0
                for q in range(EACH):
                    part += c[EACH + q] * sums[3 * p + i, 3 * q + j]
                parts[p, i, j] = part
                total[i, j] += c[begin + p] * part


@inlined
def find_rotation(products: Array, R: Array) -> None:
    """Rotation that takes accelerations by the second sensor best to those by the first, of the sum of their products."""
    U, _, Vt = np.linalg.svd(products)
    if np.linalg.det(U) * np.linalg.det(Vt) < 0:
        for i in range(3):
            U[i, 2] *= -1.0
    put(U @ Vt, R)


@inlined
def turned(part: Array, R: Array, out: Array) -> None:
    """A matrix (3, 3) times the rotation's transpose."""
    for i in range(3):
        for j in range(3):
            out[i, j] = part[i, 0] * R[j, 0] + part[i, 1] * R[j, 1] + part[i, 2] * R[j, 2]


@inlined
def fill_turn(square: Array, R: Array, out: Array) -> None:
    """Normal matrix (3, 3) of a small turn, of the sum of squares of the acceleration by the second sensor."""
    part = np.empty((3, 3))
    turned(square, R, part)
    for k in range(3):
        for m in range(3):
            out[k, m] = -(R[k, 0] * part[0, m] + R[k, 1] * part[1, m] + R[k, 2] * part[2, m])
        out[k, k] += square[0, 0] + square[1, 1] + square[2, 2] + RIDGE


@inlined
def follow_rotation(products: Array, square: Array, R: Array) -> None:
    """Turn a window's rotation to where the unknowns now have it."""
    normal, b = np.empty((3, 3)), np.empty((3, 3))
    L, right = np.empty((3, 3)), np.empty((3, 1))
    fill_turn(square, R, normal)
    turned(products, R, b)
    for k in range(3):
        e, f = (k + 1) % 3, (k + 2) % 3
        right[k, 0] = b[f, e] - b[e, f]
    angle = np.inf
    if cholesky(normal, L):
        solve_lower(L, right)
        solve_upper(L, right)
        v0, v1, v2 = right[0, 0], right[1, 0], right[2, 0]
        angle = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    if not angle < FARTHEST:
        find_rotation(products, R)
    elif angle > 0.0:
        turn_by(v0, v1, v2, angle, R)


@inlined
def turn_by(v0: float, v1: float, v2: float, angle: float, R: Array) -> None:
    """R by a rotation vector, from the left (Rodrigues)."""
    s, t = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
    for j in range(3):
        r0, r1, r2 = R[0, j], R[1, j], R[2, j]
        a0, a1, a2 = v1 * r2 - v2 * r1, v2 * r0 - v0 * r2, v0 * r1 - v1 * r0
        R[0, j] = r0 + s * a0 + t * (v1 * a2 - v2 * a1)
        R[1, j] = r1 + s * a1 + t * (v2 * a0 - v0 * a2)
        R[2, j] = r2 + s * a2 + t * (v0 * a1 - v1 * a0)


@inlined
def fill_vectors(gram: Array, cross: Array, outer: Array, R: Array, total: Array) -> None:
    """The normal matrix of all vectors with each other, those of the second sensor turned and negated; its upper half."""
    for p in range(EACH):
        for q in range(p, EACH):
            total[3 + p, 3 + q] = gram[p, q]
        for q in range(EACH):
            off = 0.0
            for i in range(3):
                for j in range(3):
                    off += R[i, j] * cross[3 * p + i, 3 * q + j]
            total[3 + p, 3 + EACH + q] = -off
    for p in range(EACH):
        for q in range(p, EACH):
            total[3 + EACH + p, 3 + EACH + q] = (
                outer[3 * p, 3 * q] + outer[3 * p + 1, 3 * q + 1] + outer[3 * p + 2, 3 * q + 2]
            )


@inlined
def fill_turn_rows(first: Array, second: Array, square: Array, R: Array, total: Array) -> None:
    """First three rows of the normal matrix (17, 17): of a small turn with itself and with all vectors."""
    b = np.empty((3, 3))
    fill_turn(square, R, total[:3, :3])
    for p in range(EACH):
        turned(first[p], R, b)
        for k in range(3):
            e, f = (k + 1) % 3, (k + 2) % 3
            total[k, 3 + p] = b[e, f] - b[f, e]
    for q in range(EACH):
        for m in range(3):
            off = 0.0
            for k in range(3):
                e, f = (k + 1) % 3, (k + 2) % 3
                off += R[m, k] * (second[q, e, f] - second[q, f, e])
            total[m, 3 + EACH + q] = -off


@inlined
def square_up(total: Array, c: Array, out: Array) -> None:
    """Sums (13, 13) of the products of derivatives by the unknowns and of the residual, the rotation projected out of the normal matrix (17, 17)."""
    for k in range(3):  # Gauss's elimination of the turn
        for p in range(k + 1, 3 + ALL):
            share = total[k, p] / total[k, k]
            for q in range(p, 3 + ALL):
                total[p, q] -= share * total[k, q]
    square = 0.0
    for p in range(ALL):
        along = 0.0
        for q in range(ALL):
            along += total[3 + min(p, q), 3 + max(p, q)] * c[q]
        square += c[p] * along
        total[3 + p, 0] = along
    for i in range(UNKNOWNS):
        p = 3 + COLUMNS[i]
        out[i, UNKNOWNS] = out[UNKNOWNS, i] = total[p, 0]
        for j in range(UNKNOWNS):
            q = 3 + COLUMNS[j]
            out[i, j] = total[min(p, q), max(p, q)]
    out[UNKNOWNS, UNKNOWNS] = square


@inlined
def solve_within(
    normal: Array, right: Array, centre: Array, prior: Array, reach: Array, levels: Array
) -> Array:
    """The unknowns that fit best; within reach of the centre by as much weight on it as that takes (Levenberg 1944)."""
    x = centre.copy()
    for level in levels:
        weight = prior.copy()
        weight[:6] *= level
        solved = np.linalg.solve(normal + np.diag(weight), right + weight * centre)
        for i in range(UNKNOWNS):
            x[i] = solved[i]
        off = x - centre
        near, far = np.sqrt((off[:3] ** 2).sum()), np.sqrt((off[3:6] ** 2).sum())
        if near <= reach[0] and far <= reach[1]:
            break
    return x


@inlined
def add_up(
    sums: Array, at: Array, x: Array, weight: Array, floor: float, count: float, gradient: Array
) -> tuple[Array, Array]:
    """Normal matrix (12, 12) and right side (12,) of windows' sums (K, 13, 13) that were formed where the unknowns were `at`; those that fit badly count less (Cauchy)."""
    normal, right = np.zeros((UNKNOWNS, UNKNOWNS)), np.zeros(UNKNOWNS)
    step = x - at
    for k in range(len(weight)):
        if weight[k] <= 0.0:
            continue
        rest = sums[k, UNKNOWNS, UNKNOWNS]
        for i in range(UNKNOWNS):
            along = 0.0
            for j in range(UNKNOWNS):
                along += sums[k, i, j] * step[j]
            gradient[k, i] = along + sums[k, i, UNKNOWNS]
            rest += step[i] * (along + 2.0 * sums[k, i, UNKNOWNS])
        w = floor * weight[k] / (1.0 + max(rest, 0.0) / count * weight[k])
        for i in range(UNKNOWNS):
            gradient[k, i] *= w
            right[i] -= gradient[k, i]
            for j in range(UNKNOWNS):
                normal[i, j] += w * sums[k, i, j]
    return normal, normal @ x + right


@inlined
def reduce_window(
    gram: Array, cross: Array, outer: Array, c: Array, is_new: bool, R: Array, out: Array
) -> None:
    """Find a window's rotation, or follow it to where the unknowns now have it, and its sums (13, 13) without it."""
    first, second = np.empty((EACH, 3, 3)), np.empty((EACH, 3, 3))
    products, square = np.empty((3, 3)), np.empty((3, 3))
    fill_parts(cross, c, 0, first, products)
    fill_parts(outer, c, EACH, second, square)
    if is_new:
        find_rotation(products, R)
    else:
        follow_rotation(products, square, R)
    total = np.empty((3 + ALL, 3 + ALL))
    fill_turn_rows(first, second, square, R, total)
    fill_vectors(gram, cross, outer, R, total)
    square_up(total, c, out)


@looped
def fit_unknowns(
    gram: Array,
    cross: Array,
    outer: Array,
    weight: Array,
    centre: Array,
    prior: Array,
    reach: Array,
    levels: Array,
    floor: float,
    count: float,
) -> tuple[Array, Array, Array, Array]:
    """Unknowns (12,), normal matrix (12, 12), gradients (K, 12), sums (K, 13, 13) of every window; windows count less by their sum of squares over `count`."""
    K = len(weight)
    R, sums = np.zeros((K, 3, 3)), np.zeros((K, UNKNOWNS + 1, UNKNOWNS + 1))
    gradient, x = np.zeros((K, UNKNOWNS)), centre.copy()
    for step in range(STEPS + 1):
        c = factors(x)
        for k in range(K):
            if weight[k] > 0.0 or step == STEPS:
                is_new = step == 0 or weight[k] <= 0.0
                reduce_window(gram[k], cross[k], outer[k], c, is_new, R[k], sums[k])
        normal, right = add_up(sums, x, x, weight, floor, count, gradient)
        if step < STEPS:
            x = solve_within(normal, right, centre, prior, reach, levels)
    return x, normal, gradient, sums


@looped
def refit_unknowns(
    sums: Array,
    at: Array,
    weight: Array,
    centre: Array,
    prior: Array,
    reach: Array,
    levels: Array,
    floor: float,
    count: float,
) -> tuple[Array, Array, Array]:
    """The first three of these of other weights and another region, from the sums that a fit left where its unknowns were `at`."""
    gradient, x = np.zeros((len(weight), UNKNOWNS)), at.copy()
    for _ in range(STEPS):
        normal, right = add_up(sums, at, x, weight, floor, count, gradient)
        x = solve_within(normal, right, centre, prior, reach, levels)
    normal, right = add_up(sums, at, x, weight, floor, count, gradient)
    return x, normal, gradient


@looped
def align(gram: Array, cross: Array, outer: Array, x: Array) -> tuple[Array, Array]:
    """Rotations (K, 3, 3) at given unknowns (12,), and sums of squares (K,) that are left over."""
    K = len(gram)
    R, out = np.zeros((K, 3, 3)), np.zeros((UNKNOWNS + 1, UNKNOWNS + 1))
    rest, c = np.zeros(K), factors(x)
    for k in range(K):
        reduce_window(gram[k], cross[k], outer[k], c, True, R[k], out)
        rest[k] = out[UNKNOWNS, UNKNOWNS]
    return R, rest
