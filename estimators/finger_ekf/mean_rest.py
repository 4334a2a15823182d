"""Rest of a hand that trembles: where it stays in one place its mean rate is zero, and measures the bias.

In      rotation of a chain's sensors at every sample
Out     mean rates for a zero-rate update, and since when the chain has stayed where it is
Source  Hann's window as a low pass: Harris 1978, Proc IEEE 66:51. The rotation is integrated before it is averaged: rates about two axes that tremble out of phase turn a
        sensor though their means are zero (coning: Bortz 1971, IEEE Trans AES 7:61). Ours: a chain stays where smoothed rates of all its sensors are below the threshold of rest
Limits  movement slower than that looks like a bias, as in every zero-rate update; tremor below 3 Hz passes the shorter window
"""

import math

import numpy as np

from handscope.estimators.finger_ekf.chain_state import (
    BEGUN,
    HALVES,
    NEWEST,
    SINCE,
    ChainState,
)
from handscope.estimators.finger_ekf.kernel_params import KernelParams
from handscope.estimators.finger_ekf.zero_rate_update import LONG, zero_rate_correction_row
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.typing import Array

# s of the windows, each half over the next, that tell whether a sensor stays: of 4 Hz they pass 1/500
SHORT = 1.2
COMPLETE = 0.95  # share of a window in which a gyroscope must have given samples of its own


@looped
def accumulate(
    t: Array, turn: Array, bias_time: Array, rest_rate: float, chains: ChainState
) -> None:
    """Add rows at t (n,) s to the windows of all chains in place: turn (n, F, 4, 3) rad, bias_time (n, F, 4) s; rest_rate rad/s."""
    step, q, w = np.empty(4), np.empty(4), np.empty(3)
    weights = np.empty(3)
    for f in range(turn.shape[1]):
        clock = chains.stay_clock[f]
        for n in range(t.shape[0]):
            if not math.isfinite(clock[BEGUN]):
                _begin_row(t[n], clock, chains, f)
                continue
            dt, since = t[n] - clock[NEWEST], t[n] - clock[BEGUN]
            clock[NEWEST] = t[n]
            halves = math.floor(since / (0.5 * SHORT) + 1e-7)
            if halves > clock[HALVES]:
                _close_short_row(rest_rate, halves, clock, chains, f)
            weights[0] = _slope_weight(since, LONG) * dt
            weights[1] = _slope_weight(since % SHORT, SHORT) * dt
            weights[2] = _slope_weight((since + 0.5 * SHORT) % SHORT, SHORT) * dt
            for s in range(4):
                quat.exp_row(turn[n, f, s], step, step)
                quat.multiply_row(chains.stay_rotation[f, s], step, q)
                for a in range(4):
                    chains.stay_rotation[f, s, a] = q[a]
                quat.log_row(q, w, w)
                chains.stay_time[f, s] += bias_time[n, f, s]
                for k in range(3):
                    for a in range(3):
                        chains.stay_sums[f, s, k, a] += weights[k] * w[a]


@inlined
def _begin_row(t: float, clock: Array, chains: ChainState, f: int) -> None:
    """A window begins at a sample, at t s."""
    if not math.isfinite(clock[SINCE]):
        clock[SINCE] = t
    clock[BEGUN], clock[NEWEST], clock[HALVES] = t, t, 0.0
    for s in range(4):
        chains.stay_time[f, s] = 0.0
        for a in range(4):
            chains.stay_rotation[f, s, a] = 1.0 if a == 0 else 0.0
        for k in range(3):
            for a in range(3):
                chains.stay_sums[f, s, k, a] = 0.0


@inlined
def _slope_weight(since: float, length: float) -> float:
    """What a rotation counts for in the mean rate by Hann's window: the window's derivative, with the opposite sign, 1/s^2."""
    if since >= length:
        return 0.0
    return -2 * math.pi / length**2 * math.sin(2 * math.pi * since / length)


@inlined
def _close_short_row(
    rest_rate: float, halves: float, clock: Array, chains: ChainState, f: int
) -> None:
    """A short window is over; the chain has moved if a sensor was too fast in it, but for the bias. The first half of one is none."""
    k = 1 if halves % 2 == 0 else 2
    for s in range(4):
        squared = 0.0
        for a in range(3):
            squared += (chains.stay_sums[f, s, k, a] - chains.bias[f, s, a]) ** 2
            chains.stay_sums[f, s, k, a] = 0.0
        if halves > 1 and squared > rest_rate**2:
            clock[SINCE] = clock[NEWEST]
    clock[HALVES] = halves


@inlined
def mean_rest_row(p: KernelParams, chain: ChainState) -> None:
    """Where the chain has stayed for a long window, the mean rates of sensors that were not seen at rest meanwhile measure their biases."""
    clock = chain.stay_clock
    if not math.isfinite(clock[BEGUN]):
        return
    span = clock[NEWEST] - clock[BEGUN]
    if clock[SINCE] > clock[BEGUN]:
        clock[BEGUN] = math.nan
    elif span >= LONG - 1e-6:
        clock[BEGUN] = math.nan
        due, some, rates, one = np.zeros(4), False, np.empty((4, 3)), np.ones(4)
        for s in range(4):
            if chain.stay_time[s] > COMPLETE * span:
                due[s], some = 1.0, True
            for a in range(3):
                rates[s, a] = chain.stay_sums[s, 0, a]
        if some:
            zero_rate_correction_row(p, rates, one, due, chain)


@inlined
def joint_correlation(p: KernelParams, span: float, stay_clock: Array) -> float:
    """Over how many updates, each after `span` s, errors of a joint's forbidden angles are alike: over `correlation`; in a chain that stays, for longer than a window, as long as it does."""
    stayed = stay_clock[NEWEST] - stay_clock[SINCE]
    return max(1.0, (max(p.correlation, stayed) if stayed > LONG else p.correlation) / span)
