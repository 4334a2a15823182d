"""From one rest of a sensor to the next: gravity, turned by the gyroscope, must arrive where the accelerometer sees it. One movement between two rests is enough.

In      cells of readings of S sensors
Out     sensors of which it does not arrive there, by how much, between when and when, and the sign, order or unit of axes under which it does
Source  two rests show gravity within `REST_SD`; the angle between two directions that err so has Rayleigh's distribution
Limits  a movement without rests, or a turn about the vertical, tells nothing; after a long one gains of a few percent count, and only coarse faults show
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.single_sensors.cells import CELL, Cells
from handscope.estimators.fault_detection.single_sensors.gyroscope_faults import (
    Fault,
    discrete_faults,
    share_of,
)
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array

REST = 30  # cells: 0.6 s
TREMBLES = 20  # cells: 0.4 s, over which a tremor is averaged
STILL = 0.06  # rad/s, standard deviation of each averaged rate in a rest, and how far its mean may be from the sensor's bias
STEADY = 0.15  # m/s^2, standard deviation of each averaged acceleration in a rest
SWING = np.radians(2.0)  # standard deviation of the angle about each axis in a rest
SIZE = 0.5  # m/s^2, by which a rest's acceleration may differ from what the sensor usually reads of gravity
BADLY_CALIBRATED = 1.0  # m/s^2, by which that may differ from gravity's size
LONGEST = 500  # cells between two rests: 10 s
# of gravity in a rest: 50 mg, the offset of a part that is not calibrated, and what a hand that is carried evenly adds
REST_SD = np.radians(3.0)
GAIN_SD = 0.03  # of a path: scale and cross-axis errors of a gyroscope that is right
# rad/s: how much a bias may differ from that of the rests, beyond what these differ from each other and from the others
DRIFT_SD = np.radians(0.5)
MISSES = 3.0  # standard deviations from which on gravity does not arrive
AWAY = 10  # cells at either end of a rest that are left alone: movements begin slowly
GAINS = (0.4, 0.5, 0.6, 0.7, 0.8, 1.25, 1.4, 1.6, 2.0, 2.5)
USUAL = (
    "gyroscope_sign",
    "gyroscope_negated",
    "gyroscope_exchange",
    "gyroscope_unit",
)  # that are named: one turn may look like a rare fault by chance
NAMED = 0.9  # probability, among all signs, orders and units, from which on one is named


@dataclass(frozen=True)
class RestTurn:
    """Two rests between which a gyroscope does not turn as gravity does."""

    sensor: int  # column of the cells
    off: float  # rad, by which gravity arrives elsewhere
    rests: tuple[float, float]  # s, middle of the one and of the other
    since: float  # s, the first rest from which on it does
    p_value: float  # of any pair of rests of any sensor


@dataclass(frozen=True)
class _Pair:
    """What one sensor reads from one rest to the next."""

    rates: Array  # (n, 3) rad/s, as read, bias taken away
    before: Array  # (3,) direction of gravity in the first rest
    after: Array  # (3,) in the second
    cells: tuple[int, int]  # middle of either rest
    drift_sd: float  # rad/s: how far the bias may be off, as of a sensor that turns slowly while it seems to rest

    def sd(self, M: Array) -> float:
        """Standard deviation (rad) of the angle's components."""
        path = CELL * float(np.linalg.norm(self.rates @ M.T, axis=1).sum())
        seconds = CELL * len(self.rates)
        return float(
            np.sqrt(2 * REST_SD**2 + (GAIN_SD * path) ** 2 + (self.drift_sd * seconds) ** 2)
        )

    def off(self, M: Array) -> float:
        """Angle (rad) between gravity as it is turned by rates M w and as it is seen."""
        q = _product(quat.exp(CELL * self.rates @ M.T))
        there = quat.rotate(quat.conjugate(q), self.before)
        return float(np.arccos(np.clip(there @ self.after, -1.0, 1.0)))


IDENTITY = np.eye(3)
Rests = dict[int, list[_Pair]]  # by column of the cells


def _product(q: Array) -> Array:
    """Product (4,) of rotations (n, 4) in order, of neighbours first."""
    while len(q) > 1:
        pairs, last = len(q) // 2 * 2, q[len(q) // 2 * 2 :]
        q = np.concatenate([quat.multiply(q[:pairs:2], q[1:pairs:2]), last])
    return q[0] if len(q) else quat.IDENTITY


def find(
    cells: Cells, asked: NDArray[np.bool_], M: Array = IDENTITY, known: Rests | None = None
) -> list[RestTurn]:
    """Gyroscopes that do not turn gravity from one rest to the next.

    Parameters
    ----------
    cells : Cells
        Readings of S sensors in SI units.
    asked : array (S,)
        Whose gyroscopes are asked.
    M : array (3, 3)
        By which the readings are multiplied first.
    known : dict, optional
        Rests of the same cells, found before; those that are missing are added.
    """
    known = {} if known is None else known
    columns = [int(k) for k in np.flatnonzero(asked)]
    known.update({k: list(_pairs(cells, k)) for k in columns if k not in known})
    pairs = {k: known[k] for k in columns}
    tests, found = max(1, sum(len(p) for p in pairs.values())), []
    for k, own in pairs.items():
        if not own:
            continue
        off = np.array([p.off(M) for p in own])
        z = off / [p.sd(M) for p in own]
        worst, first = int(np.argmax(z)), int(np.argmax(z > MISSES))
        rests = [
            (cells.start + CELL * a, cells.start + CELL * b) for a, b in (p.cells for p in own)
        ]
        since = -np.inf if first == 0 else rests[first][0]
        p_value = float(min(1.0, tests * np.exp(-0.5 * z[worst] ** 2)))
        found.append(RestTurn(k, float(off[worst]), rests[worst], since, p_value))
    return found


def explain(cells: Cells, turn: RestTurn) -> Fault | None:
    """The sign, order or unit under which gravity arrives in every rest of the sensor; None where none does, or several do."""
    own, faults = list(_pairs(cells, turn.sensor)), [*discrete_faults()[1:], *_gains()]
    z = np.array([[p.off(f.matrix) / p.sd(np.eye(3)) for p in own] for f in faults])
    fits = (z < MISSES).all(axis=1)
    weight = np.where(
        fits,
        [share_of(f.code) / (len(GAINS) if f.code == "gyroscope_gain" else 1) for f in faults],
        0.0,
    ) * np.exp(-0.5 * ((z**2).sum(axis=1) - (z**2).sum(axis=1).min()))
    best = int(np.argmax(weight))
    sure = weight[best] > NAMED * weight.sum() > 0 and faults[best].code in USUAL
    return faults[best] if sure else None


def _gains() -> list[Fault]:
    """Gains that may explain what a sign or an order seems to."""
    return [Fault("gyroscope_gain", (("gain", 1 / g),), g * np.eye(3)) for g in GAINS]


def without_bias(cells: Cells) -> Cells:
    """Readings of which each gyroscope's usual rate in its rests is taken away: what is compared with gravity is first order in the rest of the bias."""
    if len(cells.gyr) < REST:
        return cells
    of_each = zip(*(np.swapaxes(v, 0, 1) for v in (cells.gyr, cells.acc, cells.valid)))
    bias = np.array([_still(*one)[1] for one in of_each]).reshape(-1, 3)
    return replace(cells, gyr=cells.gyr - bias)


def _pairs(cells: Cells, k: int) -> Iterator[_Pair]:
    """Rests of a sensor, each with the next."""
    gyr, acc, valid = cells.gyr[:, k], cells.acc[:, k], cells.valid[:, k]
    if len(gyr) < 2 * REST:
        return
    still, usual = _still(gyr, acc, valid)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    rests = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2])]
    for (a, b), (c, d) in zip(rests, rests[1:]):
        first, last = max(a, b - REST - AWAY), min(d, c + REST + AWAY)
        b, c = first + REST, last - REST
        i, j = first + REST // 2, last - REST // 2
        if j - i > LONGEST or not valid[i:j].all():
            continue
        at_rest = gyr[first:b].mean(axis=0), gyr[c:last].mean(axis=0)
        bias = 0.5 * (at_rest[0] + at_rest[1])
        unlike = np.array([at_rest[1] - at_rest[0], bias - usual])
        before, after = acc[first:b].mean(axis=0), acc[c:last].mean(axis=0)
        yield _Pair(
            gyr[i:j] - bias,
            before / np.linalg.norm(before),
            after / np.linalg.norm(after),
            (i, j),
            float(np.hypot(DRIFT_SD, np.linalg.norm(unlike))),
        )


def _still(gyr: Array, acc: Array, valid: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], Array]:
    """Cells (n,) that lie in a rest of REST cells, and the rate (3,) that is usual there; a sensor that trembles rests where it is on average."""
    whole = np.convolve(valid, np.ones(REST), "valid") > REST - 0.5
    rate, rate_sd = _moments(_smooth(gyr))
    force, force_sd = _moments(_smooth(acc))
    quiet = whole & (rate_sd < STILL).all(axis=1) & (force_sd < STEADY).all(axis=1)
    if quiet.any():
        size = np.linalg.norm(force, axis=1)
        usual = np.clip(np.median(size[quiet]) - GRAVITY, -BADLY_CALIBRATED, BADLY_CALIBRATED)
        quiet &= np.abs(size - GRAVITY - usual) < SIZE
    if not quiet.any():
        return np.zeros(len(gyr), bool), np.zeros(3)
    bias = np.median(rate[quiet], axis=0)
    swing = _moments(np.cumsum(CELL * (gyr - bias), axis=0))[1]
    quiet &= (np.abs(rate - bias) < STILL).all(axis=1) & (swing < SWING).all(axis=1)
    out = np.zeros(len(gyr) + 1)
    np.add.at(out, np.flatnonzero(quiet), 1)
    np.add.at(out, np.flatnonzero(quiet) + REST, -1)
    return np.asarray(np.cumsum(out)[:-1] > 0.5), bias


def _smooth(x: Array) -> Array:
    """Values (n, 3) averaged over TREMBLES cells."""
    padded = np.pad(x, ((TREMBLES // 2, TREMBLES - 1 - TREMBLES // 2), (0, 0)), mode="edge")
    total = np.cumsum(np.concatenate([np.zeros((1, 3)), padded]), axis=0)
    return np.asarray((total[TREMBLES:] - total[:-TREMBLES]) / TREMBLES)


def _moments(x: Array) -> tuple[Array, Array]:
    """Mean and standard deviation (n - REST + 1, 3) of values (n, 3) in every REST cells."""
    total = np.cumsum(np.concatenate([np.zeros((1, 3)), x]), axis=0)
    square = np.cumsum(np.concatenate([np.zeros((1, 3)), x**2]), axis=0)
    mean = (total[REST:] - total[:-REST]) / REST
    variance = (square[REST:] - square[:-REST]) / REST - mean**2
    return mean, np.sqrt(np.maximum(variance, 0.0))
