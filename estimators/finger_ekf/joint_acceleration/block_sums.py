"""Sums over a block of movement of what two sensors feel of their common joint's acceleration.

In      samples of the hand's and the thumb metacarpal's sensor: rotation, specific force, orientation from each sensor's own fusion
Out     normal equations, without a constant and a slope of each component, of what the two differ by at the joint: by lever arms, accelerometer biases and scales, and by the
        heading between the two fusions
Source  acceleration of a joint's centre seen from either segment: Seel et al. 2012, IEEE MSC, 45; Kok et al. 2014, IFAC 47:79 (there a measurement of each sample). Ours: in the
        fusions' frames, in which errors of inclination are slow and go with the constant and the slope
Limits  one joint, that of the thumb's metacarpal on the hand; the skin's slide under a sensor counts as noise; movement faster than 4 Hz counts for nothing, as a
        sensor's rates and forces may be some milliseconds apart (a mean over a sample or its end, delays of their filters)
"""

import math
from typing import NamedTuple

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.jit import inlined, looped
from handscope.estimators.numerics.small_matrices import rigid_acceleration
from handscope.estimators.numerics.typing import Array

# s of a box: its window passes what a hand does on purpose, up to 3 Hz, and not a tremor of 8 to 12 Hz, at which half
# a sample between rates and forces is a third of a right angle
BOX = 0.25
INDEPENDENT = BOX / 1.5  # s of white noise that count in the mean over Hann's window
COMPLETE = 0.75  # share of a box's weight that its samples must have
LEVERS, BIASES, SCALES = 0, 6, 12  # first unknowns of the parts, of the hand's sensor first
UNKNOWNS = 30
# which sensor an unknown is of: 1 the hand's, -1 the metacarpal's
IS_OF = np.repeat([1.0, -1.0, 1.0, -1.0, 1.0, -1.0], [3, 3, 3, 3, 9, 9])
HEADING, DIFFERENCE = UNKNOWNS, UNKNOWNS + 1  # columns behind them
COLUMNS = UNKNOWNS + 2


class Readings(NamedTuple):
    """Of the hand's and the thumb metacarpal's sensor at n rows, in frames aligned with the segments."""

    t: Array  # (n,) s
    turn: Array  # (n, 2, 3) rad, since the row before
    time: Array  # (n, 2) s that it took, 0 where the gyroscope has no sample
    force: Array  # (n, 2, 3) m/s^2, NaN where not known
    q_EB: Array  # (n, 2, 4) by the sensor's own fusion: z up, heading its own


class BlockSums(NamedTuple):
    """What is summed up since a block began, and the sample that waits for the next one's rate."""

    # (6,): begin of the block, t of the waiting sample, s; cosine and sine of the heading between the fusions that is
    # believed; weight of the samples in the box, 1 if none is missing, and when it began, s
    scalars: Array
    rate: Array  # (2, 3) rad/s before the waiting sample, NaN where not known
    force: Array  # (2, 3) m/s^2 of it
    q_EB: Array  # (2, 4)
    box: Array  # (3, COLUMNS) weighted sum over the samples of a box
    normal: Array  # (COLUMNS, COLUMNS) over boxes and components
    trend: Array  # (3, 2, COLUMNS) sums of each component over the boxes, and times the time in the block
    gram: Array  # (3,) number of boxes, sum of their times, and of squares of these


def begin(t: float, heading: float) -> BlockSums:
    """Nothing yet; the second fusion's frame is turned by `heading` rad against the first's, as is believed."""
    return BlockSums(
        np.array([t, -np.inf, math.cos(heading), math.sin(heading), 0.0, t]),
        np.full((2, 3), np.nan),
        np.full((2, 3), np.nan),
        np.tile(quat.IDENTITY, (2, 1)),
        np.zeros((3, COLUMNS)),
        np.zeros((COLUMNS, COLUMNS)),
        np.zeros((3, 2, COLUMNS)),
        np.zeros(3),
    )


@looped
def accumulate(readings: Readings, unknowns: Array, sums: BlockSums) -> None:
    """Add the rows to the sums in place; a sample counts once the rate behind it is known. `unknowns` (UNKNOWNS,) as known so far."""
    columns, rate, R = np.empty((3, COLUMNS)), np.empty((2, 3)), np.empty((3, 3))
    spin, v, change, felt = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty((2, 3))
    for n in range(len(readings.t)):
        dt = readings.t[n] - sums.scalars[1]
        is_known = dt > 0
        for s in range(2):
            time = readings.time[n, s]
            for a in range(3):
                rate[s, a] = readings.turn[n, s, a] / time if time > 0 else math.nan
                is_known = is_known and math.isfinite(
                    rate[s, a] + sums.rate[s, a] + sums.force[s, a]
                )
        if is_known:
            _fill_columns(sums, unknowns, rate, dt, R, spin, v, change, felt, columns)
            _add_sample(sums, dt, columns)
        sums.scalars[1] = readings.t[n]
        for s in range(2):
            for a in range(3):
                sums.rate[s, a], sums.force[s, a] = rate[s, a], readings.force[n, s, a]
            for a in range(4):
                sums.q_EB[s, a] = readings.q_EB[n, s, a]


@inlined
def _fill_columns(
    sums: BlockSums, unknowns: Array, rate: Array, dt: float, R: Array, spin: Array, v: Array, change: Array, felt: Array, columns: Array
) -> None:  # fmt: skip
    """Derivatives (3, COLUMNS) of what both feel at the joint, the first less the second, in the first fusion's frame, with the difference itself last.

    A heading turns the joint's acceleration, the mean of what both tell, and not what a sensor's own turning adds: a hand that rests while the thumb moves tells nothing.
    """
    c, s = sums.scalars[2], sums.scalars[3]
    for k in range(2):
        quat.matrix_row(sums.q_EB[k], v, R)
        if k == 1:
            for b in range(3):
                x, y = R[0, b], R[1, b]
                R[0, b], R[1, b] = c * x - s * y, s * x + c * y
        for a in range(3):
            v[a] = 0.5 * (sums.rate[k, a] + rate[k, a])
            change[a] = (rate[k, a] - sums.rate[k, a]) / dt
        rigid_acceleration(v, change, spin)
        sign = 1.0 if k == 0 else -1.0
        for a in range(3):
            felt[k, a] = 0.0
            for b in range(3):
                arm = R[a, 0] * spin[0, b] + R[a, 1] * spin[1, b] + R[a, 2] * spin[2, b]
                felt[k, a] += R[a, b] * sums.force[k, b]
                columns[a, LEVERS + 3 * k + b] = -sign * arm
                columns[a, BIASES + 3 * k + b] = sign * R[a, b]
                for d in range(3):
                    columns[a, SCALES + 9 * k + 3 * b + d] = sign * R[a, b] * sums.force[k, d]
    for a in range(3):
        columns[a, DIFFERENCE] = felt[0, a] - felt[1, a]
        v[a] = 0.5 * (felt[0, a] + felt[1, a])
        for k in range(UNKNOWNS):
            v[a] -= 0.5 * IS_OF[k] * columns[a, k] * unknowns[k]
    columns[0, HEADING], columns[1, HEADING], columns[2, HEADING] = -v[1], v[0], 0.0


@inlined
def _add_sample(sums: BlockSums, dt: float, columns: Array) -> None:
    """Into its box, dt after the sample before; a box that is over counts first, unless samples are missing in it."""
    if sums.scalars[4] > 0 and sums.scalars[1] - sums.scalars[5] >= BOX - 1e-9:
        _add_box(sums)
    if sums.scalars[4] == 0:
        sums.scalars[5] = sums.scalars[1]
    phase = (sums.scalars[1] - sums.scalars[5] + 0.5 * dt) / BOX
    # Hann's window; never quite zero, which would mean that no box is open
    weight = dt / BOX * (1.0 - math.cos(2.0 * math.pi * min(phase, 1.0)) + 1e-9)
    for a in range(3):
        for k in range(COLUMNS):
            sums.box[a, k] += weight * columns[a, k]
    sums.scalars[4] += weight


@inlined
def _add_box(sums: BlockSums) -> None:
    """Close the open box. Without part of its samples it is no low pass, and is left out."""
    share, u = sums.scalars[4], sums.scalars[5] - sums.scalars[0]
    sums.scalars[4] = 0.0
    if share < COMPLETE:
        sums.box[...] = 0.0
        return
    for a in range(3):
        for k in range(COLUMNS):
            sums.box[a, k] /= share
        for k in range(COLUMNS):
            x = sums.box[a, k]
            sums.trend[a, 0, k] += x
            sums.trend[a, 1, k] += u * x
            if x != 0.0:
                for j in range(k + 1):
                    sums.normal[k, j] += x * sums.box[a, j]
        for k in range(COLUMNS):
            sums.box[a, k] = 0.0
    sums.gram[0] += 1.0
    sums.gram[1] += u
    sums.gram[2] += u * u
