"""Gyroscopes at rest: sensors that hardly turn show their bias, and from rest to rest how far such rates are to be trusted.

In      what the sensors of a chain seem to have turned by over a window, their biases as they are known
Out     the error states put right, and what the next rest needs: rates of the last one, how much they differ from rest to rest
Source  zero-rate updates as VQF has them (Laidig & Seel 2023); the variance of what comes one after the other from their differences: von Neumann 1941,
        Ann Math Stat 12:367. A bias is the same in both, what a person creeps is not, nor is noise
Limits  what creeps alike for many seconds looks like a bias: only one that is unlikely, as the bias is known, is held against it
"""

import math

import numpy as np

from handscope.estimators.finger_ekf.measurements import CREEPING, REST_RATE
from handscope.estimators.finger_ekf.sensor_to_segment import SIZE, put_right
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined
from handscope.estimators.numerics.kalman import correct
from handscope.estimators.numerics.typing import Array

REST = 1.5  # s that a sensor has to rest before its rate counts as bias: VQF's restMinT
ASSUMED = 12.0  # differences that the option counts as: those of one rest of a chain's sensors
UNLIKELY = 9.0  # times its variance, squared: a rate so far from the bias is less trusted


@inlined
def rested_row(
    p: Array, turned: Array, bias_time: Array, span: float, rates: Array,
    q: Array, bias: Array, seat: Array, skin: Array, apart: Array, P: Array, rest: Array, crept: Array, rested: Array, creep: Array,
) -> None:  # fmt: skip
    """A mean rate over every REST seconds is a measurement of the bias; what is between those of one rest and the next its noise.

    `crept` (4, 3) rad in `rest` (4,) s with the bias in it; `rested` (4, 3) rad/s at the rest before, NaN without; `creep` (2,): half the sum of
    squared differences, their number.
    """
    due, some, turn = np.zeros(4), False, np.empty(3)
    for s in range(4):
        still = bias_time[s] > 0 and rates[s] < p[REST_RATE]
        quat.log_row(turned[s], turn, turn)
        rest[s] = rest[s] + span if still else 0.0
        for a in range(3):
            crept[s, a] = crept[s, a] + turn[a] + bias[s, a] * bias_time[s] if still else 0.0
        if rest[s] >= REST - 1e-9:
            due[s], some = 1.0, True
    if some:
        missed, H, noise, change = (
            np.zeros(12),
            np.zeros((12, SIZE)),
            np.zeros((12, 12)),
            np.empty(SIZE),
        )
        learnt_row(crept, rest, due, rested, creep)
        resting_row(p, crept, rest, due, bias, P, creep, missed, H, noise)
        correct(P, missed, H, noise, change)
        put_right(q, bias, seat, skin, apart, change)
        for s in range(4):
            if due[s] > 0:
                rest[s] = 0.0
                for a in range(3):
                    crept[s, a] = 0.0


@inlined
def learnt_row(crept: Array, rest: Array, due: Array, rested: Array, creep: Array) -> None:
    """How much the rates of rests differ from those before; of the sensors that are `due` (4,)."""
    for s in range(4):
        for a in range(3 if due[s] > 0 else 0):
            rate = crept[s, a] / rest[s]
            if math.isfinite(rested[s, a]):
                creep[0] += 0.5 * (rate - rested[s, a]) ** 2
                creep[1] += 1.0
            rested[s, a] = rate


@inlined
def resting_row(
    p: Array,
    crept: Array,
    rest: Array,
    due: Array,
    bias: Array,
    P: Array,
    creep: Array,
    missed: Array,
    H: Array,
    noise: Array,
) -> None:
    """Three rows a sensor: what it seemed to turn by, (4, 3) rad in `rest` (4,) s, was its bias; of those that are `due`."""
    variance = (ASSUMED * p[CREEPING] ** 2 + creep[0]) / (ASSUMED + creep[1])
    for s in range(4):
        for a in range(3):
            row = 3 * s + a
            noise[row, row] = variance
            if due[s] > 0:
                missed[row], H[row, 9 + row] = crept[s, a] / rest[s] - bias[s, a], 1.0
                known = P[9 + row, 9 + row]
                if missed[row] ** 2 > UNLIKELY * (variance + known):
                    noise[row, row] = missed[row] ** 2 - known
