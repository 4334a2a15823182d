"""Compliance of a joint about its forbidden axes, learnt from its two sensors while it moves.

In      innovations of the angles that should be zero, their variance from the filter's own errors, how far the joint has turned
Out     variance of such an angle, for the pseudo-measurement that it is zero
Source  covariance matching: Mehra 1972, IEEE Trans Autom Control 17:693; Myers & Tapley 1976, ibid.
        21:520. The squared innovation has the expectation h P h' + R, so R is what h P h' does not explain; samples are weighted by the Fisher information of R, (R / (h P h' + R))^2
Limits  what follows flexion is absorbed by mounting and soft-tissue gain (sensor_to_segment.py) and not seen here, so the option is the smallest value: docs/decisions/0009-sizes-of-errors.md; a joint that does not move adds no information; ranges are not learnt
"""

import math

from handscope.estimators.finger_ekf.kernel_params import KernelParams
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.typing import Array

ASSUMED = 2.0  # weight of the option in samples: one for each axis of a hinge
ANOTHER = 1.0  # rad of joint rotation after which the residual is independent
UNLIKELY = 9.0  # squared sd beyond which a residual is downweighted


@inlined
def compliance_variance_row(p: KernelParams, compliance_stats: Array, variance: Array) -> None:
    """Variance of the forbidden angles of each joint (3,), rad^2; `compliance_stats` (3, 2): weighted sum of estimates of R, and sum of weights."""
    usual = p.dimension_noise**2
    for j in range(3):
        variance[j] = max(
            (ASSUMED * usual + compliance_stats[j, 0]) / (ASSUMED + compliance_stats[j, 1]), usual
        )


@inlined
def update_compliance_row(
    p: KernelParams, q_before: Array, q: Array, own_variance: Array, free: Array, variance: Array, lasts: float,
    innovation: Array, noise: Array, compliance_stats: Array,
) -> None:  # fmt: skip
    """Update `compliance_stats` from rows 9..17, whose variances `own_variance` (9,) the filter's errors make, and enlarge the noise of unlikely residuals. Rotations between sensors (3, 4) before and after the window."""
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
            if own_variance[row - 9] > 0 and free[j, a] == 0:
                own = own_variance[row - 9] + noise[row, row] / lasts - variance[j]
                weight = share * (variance[j] / (own + variance[j])) ** 2
                compliance_stats[j, 0] += weight * (innovation[row] ** 2 - own)
                compliance_stats[j, 1] += weight
                if innovation[row] ** 2 > UNLIKELY * (own + variance[j]):
                    noise[row, row] += lasts * (innovation[row] ** 2 - own - variance[j])
