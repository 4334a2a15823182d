"""Sums over the instants of a window for a joint between two sensors, compiled: most of what the checks cost.

In      one window of two sensors: specific force, what an arm adds to it, frames; the unknowns
Out     products of the joint's accelerations from either side; squares of residuals and derivatives without the window's own rotation
Source  normal equations with a nuisance rotation projected out (Golub & Pereyra 1973, SIAM J Numer Anal 10:413)
Limits  instants of a window weigh alike
"""

import numpy as np

from handscope.estimators.numerics.jit import inlined, rowwise
from handscope.estimators.numerics.typing import Array

UNKNOWNS = (
    9  # place from the first sensor, from the second, difference of biases in the first's frame
)
RIDGE = 1e-6  # (m/s^2)^2, keeps the rotation's square invertible where nothing accelerates


@inlined
def from_first(force: Array, arm: Array, turned: Array, x: Array, i: int, c: int) -> float:
    """Axis c of the joint's specific force at instant i, by the first sensor."""
    a: float = force[i, c]
    for d in range(3):
        a += arm[i, c, d] * x[d] - turned[i, c, d] * x[6 + d]
    return a


@inlined
def from_second(force: Array, arm: Array, x: Array, i: int, c: int) -> float:
    """The same by the second."""
    b: float = force[i, c]
    for d in range(3):
        b += arm[i, c, d] * x[3 + d]
    return b


@rowwise("(m,v),(m,v,v),(m,v,v),(m,v),(m,v,v),(t)->(v,v)")
def products(
    force: Array, arm: Array, turned: Array, force2: Array, arm2: Array, x: Array, out: Array
) -> None:
    """Sums (3, 3) of a b' over a window, m^2/s^4: a by the first sensor, b by the second; x (10,), the unknowns and 1."""
    out[:] = 0.0
    for i in range(force.shape[0]):
        for c in range(3):
            a = from_first(force, arm, turned, x, i, c)
            for d in range(3):
                out[c, d] += a * from_second(force2, arm2, x, i, d)


@inlined
def fill_rows(
    arm: Array, turned: Array, arm2: Array, R: Array, a: Array, b: Array, i: int, rows: Array
) -> None:
    """Three rows of one instant: of a small turn of the rotation (3), of the unknowns (9), the residual (1)."""
    for c in range(3):
        rows[c, 12] = a[c]
        for d in range(3):
            rows[c, 12] -= R[c, d] * b[d]
            rows[c, 3 + d] = arm[i, c, d]
            rows[c, 9 + d] = -turned[i, c, d]
            rows[c, 6 + d] = -(
                R[c, 0] * arm2[i, 0, d] + R[c, 1] * arm2[i, 1, d] + R[c, 2] * arm2[i, 2, d]
            )
        rows[c, c] = 0.0
    for c in range(3):
        e, f = (c + 1) % 3, (c + 2) % 3
        u = R[c, 0] * b[0] + R[c, 1] * b[1] + R[c, 2] * b[2]
        rows[e, f], rows[f, e] = -u, u


@rowwise("(m,v),(m,v,v),(m,v,v),(m,v),(m,v,v),(v,v),(t)->(t,t)")
def squares(
    force: Array,
    arm: Array,
    turned: Array,
    force2: Array,
    arm2: Array,
    R: Array,
    x: Array,
    out: Array,
) -> None:
    """Sums (10, 10) over a window of the products of its derivatives by the unknowns and its residual, the rotation projected out.

    R (3, 3) takes vectors of the second sensor's frame to the first's at the window's beginning; x (10,), the unknowns and 1.
    """
    rows, total = np.zeros((3, 13)), np.zeros((13, 13))
    a, b = np.zeros(3), np.zeros(3)
    for i in range(force.shape[0]):
        for c in range(3):
            a[c] = from_first(force, arm, turned, x, i, c)
            b[c] = from_second(force2, arm2, x, i, c)
        fill_rows(arm, turned, arm2, R, a, b, i, rows)
        for p in range(13):
            for q in range(p, 13):
                total[p, q] += (
                    rows[0, p] * rows[0, q] + rows[1, p] * rows[1, q] + rows[2, p] * rows[2, q]
                )
    for k in range(3):  # Gauss's elimination of the turn
        pivot = total[k, k] + RIDGE
        for p in range(k + 1, 13):
            share = total[k, p] / pivot
            for q in range(p, 13):
                total[p, q] -= share * total[k, q]
    for p in range(10):
        for q in range(p, 10):
            out[p, q] = out[q, p] = total[3 + p, 3 + q]
