"""Means of one chain with the covariance of their errors, corrected outside of the filter's own updates.

In      a chain, the estimated errors of its 43 error states, their covariance
Out     the chain with the errors taken out
Source  as filter.py, whose State tells shapes and units
"""

from typing import NamedTuple

import numpy as np

from handscope.estimators.finger_ekf.sensor_to_segment import ERROR
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array


class Estimates(NamedTuple):
    """Means of a chain and the covariance of their errors; filter.State tells shapes and units."""

    q_pc: Array
    bias: Array
    q_SB: Array
    soft_tissue_gain: Array
    field_difference: Array
    P: Array


def corrected(chain: Estimates, dx: Array, P: Array) -> Estimates:
    """The chain after errors dx (43,), whose covariance is now P (43, 43)."""
    return Estimates(
        _turned(chain.q_pc, dx[: ERROR.bias]),
        chain.bias + dx[ERROR.bias : ERROR.q_SB].reshape(4, 3),
        _turned(chain.q_SB, dx[ERROR.q_SB : ERROR.soft_tissue]),
        chain.soft_tissue_gain + dx[ERROR.soft_tissue : ERROR.field_difference].reshape(3, 3),
        chain.field_difference + np.array([dx[ERROR.field_difference], 0.0]),
        0.5 * (P + P.T),
    )


def _turned(q: Array, d: Array) -> Array:
    return np.asarray(quat.normalize(quat.multiply(q, quat.exp(d.reshape(-1, 3)))))
