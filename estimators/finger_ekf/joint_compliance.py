"""How much a joint gives about the axes that are none of its freedoms: more than is believed, where its two sensors show it while it moves.

In      by what the angles that should be zero miss it, and by how much the filter's own errors may have made them; how far the joint has turned
Out     the variance of such an angle, for the pseudo-measurement that it is zero
Source  covariance matching: Mehra 1972, IEEE Trans Autom Control 17:693; Myers & Tapley 1976, ibid. 21:520. Of what is missed squared, expected h P h' + R,
        R is what h P h' does not explain; samples count as the likelihood's information of R weighs them, (R / (h P h' + R))^2
Limits  what follows flexion is taken up by skin and seats (ekf_seats.py) and never seen here, so that a joint never counts as giving less than is
        believed: docs/decisions/0009-sizes-of-errors.md; a joint that lies as it lay gives as it gave and tells nothing; ranges are not learnt
"""

import math

import numpy as np

from handscope.estimators.finger_ekf.measurements import CORRELATION, DIMENSION_NOISE
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.small_matrices import variance_of
from handscope.estimators.numerics.typing import Array

ASSUMED = 2.0  # samples that the option counts as: one of each axis of a hinge
ANOTHER = 1.0  # rad that a joint turns by until how it gives is another
UNLIKELY = 9.0  # times its variance, squared: an angle so far off is less trusted


@inlined
def compliance_variance_row(p: Array, compliance_stats: Array, variance: Array) -> None:
    """Of an angle that is no freedom of each joint (3,), rad^2; `compliance_stats` (3, 2): weighted sum of what R seemed to be, and of the weights."""
    usual = p[DIMENSION_NOISE] ** 2
    for j in range(3):
        variance[j] = max(
            (ASSUMED * usual + compliance_stats[j, 0]) / (ASSUMED + compliance_stats[j, 1]), usual
        )


@inlined
def update_compliance_row(
    p: Array, q_before: Array, q: Array, P: Array, free: Array, variance: Array, span: float,
    innovation: Array, H: Array, noise: Array, compliance_stats: Array,
) -> None:  # fmt: skip
    """What rows 9..17 tell of `compliance_stats`; an angle that is unlikely as far off as it is counts as unsure as that. Rotations between sensors (3, 4) before the
    window and after it."""
    lasts = max(1.0, p[CORRELATION] / span)
    for j in range(3):
        cosine = abs(
            q[j, 0] * q_before[j, 0]
            + q[j, 1] * q_before[j, 1]
            + q[j, 2] * q_before[j, 2]
            + q[j, 3] * q_before[j, 3]
        )
        share = min(1.0 / lasts, 2 * math.acos(min(cosine, 1.0)) / ANOTHER)
        for a in range(3):
            row = 9 + 3 * j + a
            if free[j, a] == 0 and np.any(H[row] != 0.0):
                own = variance_of(H[row], P) + noise[row, row] / lasts - variance[j]
                weight = share * (variance[j] / (own + variance[j])) ** 2
                compliance_stats[j, 0] += weight * (innovation[row] ** 2 - own)
                compliance_stats[j, 1] += weight
                if innovation[row] ** 2 > UNLIKELY * (own + variance[j]):
                    noise[row, row] += lasts * (innovation[row] ** 2 - own - variance[j])
