"""The joint between two sensors fitted to sums over the instants of each window, compiled: most of what the checks cost.

In      per window: sums of products of what either sensor contributes to the joint's acceleration; weights of the windows; where the joint may lie
Out     the unknowns, what is left over in each window, the rotation between the sensors in each
Source  normal equations with a nuisance rotation projected out (Golub & Pereyra 1973, SIAM J Numer Anal 10:413); the rotation by SVD (Markley 1988),
        followed by Gauss-Newton steps while the unknowns change
Limits  instants of a window weigh alike
"""

import numpy as np

from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.typing import Array

UNKNOWNS = 9  # place from the first sensor, from the second, difference of biases in its frame
FIRST, SECOND = 7, 4  # vectors: force, arm x, y, z, frame x, y, z of the first; force, arm
ALL = FIRST + SECOND
RIDGE = 1e-6  # (m/s^2)^2, keeps the rotation's square invertible where nothing accelerates
STEPS = 4
FARTHEST = 0.3  # rad that a step may turn a window's rotation before it is found anew
COLUMNS = np.array([1, 2, 3, 8, 9, 10, 4, 5, 6])  # of the unknowns among all vectors


@inlined
def factors(x: Array) -> Array:
    """What each vector (11,) counts in the residual."""
    c = np.ones(ALL)
    c[1:4], c[4:7], c[8:11] = x[:3], x[6:9], x[3:6]
    return c


@inlined
def by_second(sums: Array, c: Array, p: int, out: Array) -> None:
    """Sums (3, 3) of vector p with the joint's acceleration by the second sensor."""
    for i in range(3):
        for j in range(3):
            out[i, j] = 0.0
            for q in range(SECOND):
                out[i, j] += c[FIRST + q] * sums[3 * p + i, 3 * q + j]


@inlined
def find_rotation(cross: Array, c: Array, R: Array) -> None:
    """Rotation that takes accelerations by the second sensor best to those by the first."""
    P, part = np.zeros((3, 3)), np.zeros((3, 3))
    for p in range(FIRST):
        by_second(cross, c, p, part)
        P += c[p] * part
    U, _, Vt = np.linalg.svd(P)
    if np.linalg.det(U) * np.linalg.det(Vt) < 0:
        U[:, 2] *= -1.0
    R[:] = U @ Vt


@inlined
def turn_rows(cross: Array, outer: Array, c: Array, R: Array, total: Array) -> None:
    """First three rows of the normal matrix (14, 14): of a small turn with itself and with all vectors."""
    part, b = np.zeros((3, 3)), np.zeros((3, 3))
    for q in range(SECOND):
        by_second(outer, c, q, part)
        for k in range(3):
            e, f = (k + 1) % 3, (k + 2) % 3
            for m in range(3):
                b[k, m] += c[FIRST + q] * part[k, m]
                total[m, 3 + FIRST + q] -= R[m, k] * (part[e, f] - part[f, e])
    turned(b, R, part)
    for k in range(3):
        for m in range(3):
            inner = R[k, 0] * part[0, m] + R[k, 1] * part[1, m] + R[k, 2] * part[2, m]
            total[k, m] = -inner
        total[k, k] += b[0, 0] + b[1, 1] + b[2, 2] + RIDGE
    for p in range(FIRST):
        by_second(cross, c, p, part)
        turned(part, R, b)
        for k in range(3):
            e, f = (k + 1) % 3, (k + 2) % 3
            total[k, 3 + p] = b[e, f] - b[f, e]


@inlined
def turned(part: Array, R: Array, out: Array) -> None:
    """A matrix (3, 3) times the rotation's transpose."""
    for i in range(3):
        for j in range(3):
            out[i, j] = part[i, 0] * R[j, 0] + part[i, 1] * R[j, 1] + part[i, 2] * R[j, 2]


@inlined
def follow_rotation(cross: Array, outer: Array, c: Array, R: Array) -> None:
    """Turn a window's rotation to where the unknowns now have it."""
    total = np.zeros((3, 3 + ALL))
    turn_rows(cross, outer, c, R, total)
    right = np.zeros(3)
    for k in range(3):
        for p in range(ALL):
            right[k] -= total[k, 3 + p] * c[p]
    v = np.linalg.solve(np.ascontiguousarray(total[:, :3]), right)
    angle = np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    if not angle < FARTHEST:
        find_rotation(cross, c, R)
        return
    if angle > 0.0:
        s, t = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2
        V = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
        R[:] = R + s * (V @ R) + t * (V @ (V @ R))


@inlined
def fill_vectors(gram: Array, cross: Array, outer: Array, R: Array, total: Array) -> None:
    """The rest of the normal matrix: of all vectors with each other, those of the second sensor turned and negated."""
    for p in range(FIRST):
        for q in range(FIRST):
            total[3 + p, 3 + q] = gram[p, q]
        for q in range(SECOND):
            off = 0.0
            for i in range(3):
                for j in range(3):
                    off += R[i, j] * cross[3 * p + i, 3 * q + j]
            total[3 + p, 3 + FIRST + q] = total[3 + FIRST + q, 3 + p] = -off
    for p in range(SECOND):
        for q in range(SECOND):
            total[3 + FIRST + p, 3 + FIRST + q] = (
                outer[3 * p, 3 * q] + outer[3 * p + 1, 3 * q + 1] + outer[3 * p + 2, 3 * q + 2]
            )


@inlined
def square_up(gram: Array, cross: Array, outer: Array, c: Array, R: Array, out: Array) -> None:
    """Sums (10, 10) of the products of derivatives by the unknowns and of the residual, the rotation projected out."""
    total = np.zeros((3 + ALL, 3 + ALL))
    turn_rows(cross, outer, c, R, total)
    fill_vectors(gram, cross, outer, R, total)
    for k in range(3):  # Gauss's elimination of the turn
        for p in range(k + 1, 3 + ALL):
            share = total[k, p] / total[k, k]
            for q in range(k + 1, 3 + ALL):
                total[p, q] -= share * total[k, q]
    with_residual(total, c, out)


@inlined
def with_residual(total: Array, c: Array, out: Array) -> None:
    """Pick the unknowns' sums (10, 10), the residual's at the end."""
    square = 0.0
    for p in range(ALL):
        along = 0.0
        for q in range(ALL):
            along += total[3 + p, 3 + q] * c[q]
        square += c[p] * along
        total[3 + p, 0] = along
    for i in range(UNKNOWNS):
        p = 3 + COLUMNS[i]
        out[i, UNKNOWNS] = out[UNKNOWNS, i] = total[p, 0]
        for j in range(UNKNOWNS):
            out[i, j] = total[p, 3 + COLUMNS[j]]
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
        x[:] = np.linalg.solve(normal + np.diag(weight), right + weight * centre)
        off = x - centre
        near, far = np.sqrt((off[:3] ** 2).sum()), np.sqrt((off[3:6] ** 2).sum())
        if near <= reach[0] and far <= reach[1]:
            break
    return x


@inlined
def add_up(
    sums: Array, at: Array, x: Array, weight: Array, floor: float, count: float, gradient: Array
) -> tuple[Array, Array]:
    """Normal matrix (9, 9) and right side (9,) of windows' sums (K, 10, 10) that were formed where the unknowns were `at`; those that fit badly count less (Cauchy)."""
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
    """Unknowns (9,), normal matrix (9, 9), gradients (K, 9), sums (K, 10, 10) of every window; windows count less by their sum of squares over `count`."""
    K = len(weight)
    R, sums = np.zeros((K, 3, 3)), np.zeros((K, UNKNOWNS + 1, UNKNOWNS + 1))
    gradient, x = np.zeros((K, UNKNOWNS)), centre.copy()
    for step in range(STEPS + 1):
        c = factors(x)
        for k in range(K):
            if weight[k] > 0.0 or step == STEPS:
                if step == 0 or weight[k] <= 0.0:
                    find_rotation(cross[k], c, R[k])
                else:
                    follow_rotation(cross[k], outer[k], c, R[k])
                square_up(gram[k], cross[k], outer[k], c, R[k], sums[k])
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
    """Rotations (K, 3, 3) at given unknowns (9,), and sums of squares (K,) that are left over."""
    K = len(gram)
    R, out = np.zeros((K, 3, 3)), np.zeros((UNKNOWNS + 1, UNKNOWNS + 1))
    rest, c = np.zeros(K), factors(x)
    for k in range(K):
        find_rotation(cross[k], c, R[k])
        square_up(gram[k], cross[k], outer[k], c, R[k], out)
        rest[k] = out[UNKNOWNS, UNKNOWNS]
    return R, rest
