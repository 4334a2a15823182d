"""Zero-rate updates: sensors at rest measure their bias; rate differences between rests give the noise.

In      rotation of a chain's sensors over a window, estimated biases
Out     corrected state, and statistics for the next rest
Source  zero-rate updates as in VQF (Laidig & Seel 2023); variance from successive differences: von Neumann 1941, Ann Math Stat 12:367. Differences cancel the bias and leave slow movement and noise
Limits  a constant slow rotation looks like a bias; only an unlikely rate is downweighted
"""

import math

import numpy as np

from handscope.estimators.finger_ekf.chain_state import NEWEST, SINCE, ChainState
from handscope.estimators.finger_ekf.kernel_params import KernelParams
from handscope.estimators.finger_ekf.sensor_to_segment import ERROR, SIZE, inject_error
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.kalman import correct
from handscope.estimators.numerics.typing import Array

REST = 1.5  # s of rest before a rate measures the bias: VQF's restMinT
LONG = 6.0  # s of a window that measures it of a chain that stays (mean_rest.py)
ASSUMED = 12.0  # weight of the option in differences: one rest of a chain's sensors
UNLIKELY = 9.0  # squared sd beyond which a rate is downweighted


@inlined
def zero_rate_update_row(
    p: KernelParams, delta_q: Array, bias_time: Array, span: float, rates: Array, chain: ChainState
) -> None:
    """The mean rate over REST seconds measures the bias; rate differences between rests give its noise.

    Of a chain that has stayed for longer than LONG only long windows do: how it creeps is alike in successive short rests, so that their differences do not show it.
    """
    due, some, turn = np.zeros(4), False, np.empty(3)
    rest_time, rest_rotation = chain.rest_time, chain.rest_rotation
    stays = chain.stay_clock[NEWEST] - chain.stay_clock[SINCE] > LONG
    for s in range(4):
        still = bias_time[s] > 0 and rates[s] < p.rest_rate and not stays
        quat.log_row(delta_q[s], turn, turn)
        rest_time[s] = rest_time[s] + span if still else 0.0
        for a in range(3):
            rest_rotation[s, a] = (
                rest_rotation[s, a] + turn[a] + chain.bias[s, a] * bias_time[s] if still else 0.0
            )
        if rest_time[s] >= REST - 1e-9:
            due[s], some = 1.0, True
    if some:
        zero_rate_correction_row(p, rest_rotation, rest_time, due, chain)


@inlined
def zero_rate_correction_row(
    p: KernelParams, rotation: Array, time: Array, due: Array, chain: ChainState
) -> None:
    """Correct the chain by the rotation (4, 3) rad in a time (4,) s of the sensors that are `due` (4,), at rest in it; what they have rested counts once."""
    innovation, H, noise, dx = (
        np.zeros(12),
        np.zeros((12, SIZE)),
        np.zeros((12, 12)),
        np.empty(SIZE),
    )
    update_rest_scatter_row(rotation, time, due, chain.previous_rest_rate, chain.rest_rate_scatter)
    zero_rate_rows(
        p, rotation, time, due, chain.bias, chain.P, chain.rest_rate_scatter, innovation, H, noise
    )
    correct(chain.P, innovation, H, noise, dx)
    inject_error(
        chain.q_pc, chain.bias, chain.q_SB, chain.soft_tissue_gain, chain.field_difference, dx
    )
    for s in range(4):
        if due[s] > 0:
            chain.rest_time[s], chain.stay_time[s] = 0.0, -math.inf
            for a in range(3):
                chain.rest_rotation[s, a] = 0.0


@inlined
def update_rest_scatter_row(
    rest_rotation: Array,
    rest_time: Array,
    due: Array,
    previous_rest_rate: Array,
    rest_rate_scatter: Array,
) -> None:
    """Add squared rate differences from the previous rest, for the sensors that are `due` (4,)."""
    for s in range(4):
        for a in range(3 if due[s] > 0 else 0):
            rate = rest_rotation[s, a] / rest_time[s]
            if math.isfinite(previous_rest_rate[s, a]):
                rest_rate_scatter[0] += 0.5 * (rate - previous_rest_rate[s, a]) ** 2
                rest_rate_scatter[1] += 1.0
            previous_rest_rate[s, a] = rate


@inlined
def zero_rate_rows(
    p: KernelParams,
    rest_rotation: Array,
    rest_time: Array,
    due: Array,
    bias: Array,
    P: Array,
    rest_rate_scatter: Array,
    innovation: Array,
    H: Array,
    noise: Array,
) -> None:
    """Three rows a sensor that is `due`: its rotation (4, 3) rad in `rest_time` (4,) s was bias."""
    variance = (ASSUMED * p.creeping**2 + rest_rate_scatter[0]) / (ASSUMED + rest_rate_scatter[1])
    for s in range(4):
        for a in range(3):
            row = 3 * s + a
            noise[row, row] = variance
            if due[s] > 0:
                innovation[row], H[row, ERROR.bias + row] = (
                    rest_rotation[s, a] / rest_time[s] - bias[s, a],
                    1.0,
                )
                known = P[ERROR.bias + row, ERROR.bias + row]
                if innovation[row] ** 2 > UNLIKELY * (variance + known):
                    noise[row, row] = innovation[row] ** 2 - known
