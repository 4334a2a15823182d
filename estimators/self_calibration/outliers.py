"""Samples that fit nowhere: a sensor was knocked, or turned faster than its gyroscope can tell.

In      a Problem, a place, how far each acceleration is off there (posterior.strange)
Out     Knocks: which accelerations and turns are not to be believed, and how little; Jolt: which sensor it was, and when
Source  ours; weights of accelerations where it lasts: Huber's loss; squared of the worst turn, 3 deg that never were still pulled by 4 of 0.7 deg
Limits  in a brief knock neither accelerometer nor gyroscope is believed; where it lasts accelerometers say how the sensor turned
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from handscope.estimators.numerics.intervals import find_runs
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.self_calibration import residuals
from handscope.estimators.self_calibration.problem import Problem, Unknowns
from handscope.estimators.self_calibration.uncertainty import posterior

GROSS = 10.0  # usual errors: what is off by less is trusted less, and no knock: skin under the hand's sensor, that other fingers move, is off by 6
OPENED = 1e3  # times the error of a turn while it is asked whether its gyroscope was knocked: half a degree
MISSING = 1e3  # times the error of an acceleration in a knock
BESIDE = 3  # turns on either side of a strange acceleration: a rate enters four of them, three samples an acceleration
BRIEF = 0.1  # s: a knock is over by then, a gyroscope at its limit need not be
JOLT = np.radians(0.2)  # 20 deg/s for 10 ms: what is worth a word
SHOCK = 20.0  # usual errors: what is worth a word
MEDIAN_OF_THREE = 0.888  # of the length of three independent errors against its RMS
CHUNK = 1024  # samples whose derivatives are in memory at once
Kind = Literal["gyr", "acc"]


@dataclass(frozen=True)
class Jolt:
    """What contradicts the other sensors for a moment: turns that accelerations contradict, or an acceleration that its neighbours do."""

    sensor: int
    sample: int
    kind: Kind


@dataclass(frozen=True)
class Knocks:
    """What was found strange so far."""

    hit: Bools  # (n,) samples of brief knocks: what was read there is not believed
    knocked: Bools  # (n-1,) turns beside strange accelerations
    fresh: Bools  # (n-1,) of them those that are so since the last look
    doubt: Array  # (n, S) factors on the errors of accelerations, since the last look


def none(samples: int) -> Knocks:
    still = np.zeros(samples - 1, bool)
    return Knocks(np.zeros(samples, bool), still, still, np.ones((samples, 1)))


def looked(before: Knocks, off: Array, limit: float, dt: float) -> Knocks:
    """With what is strange now: off (n, S) standard deviations, by more than `limit` usual ones of its sensor."""
    doubt = np.maximum(off / (np.median(off, axis=0) / MEDIAN_OF_THREE + 1e-300) / limit, 1.0)
    strange = np.asarray((doubt > 1).any(axis=1) & (limit * doubt >= GROSS).any(axis=1))
    hit = np.zeros(len(off), bool)
    for first, stop in find_runs(strange, BESIDE):
        hit[first:stop] = (stop - first) * dt <= BRIEF
    doubt[hit] = MISSING
    doubt[before.hit] = 1.0  # not believed already
    beside = _beside(strange)
    return Knocks(before.hit | hit, before.knocked | beside, beside & ~before.knocked, doubt)


def turn_doubt(knocks: Knocks, base: Problem, at: Unknowns, limit: float) -> Array:
    """Factors on the errors of turns (n-1, S): fresh ones are open, of the others those that fit are believed again; the worst of a moment pulls less the further it is off.

    `base` has the gyroscopes' errors as they were believed first.
    """
    off = np.where(knocks.knocked[:, None], posterior.strange_turns(base, at), 0.0)
    doubt = np.maximum(off / limit, 1.0)
    worst = off == off.max(axis=1, keepdims=True)
    return np.where(knocks.fresh[:, None], OPENED, np.where(worst, doubt**2, doubt))


def jolts(knocks: Knocks, base: Problem, at: Unknowns, off: Array) -> tuple[Jolt, ...]:
    """By sensor, at the minimum; `off` (n, S) as of `looked`, with errors of accelerations as they are where nothing is knocked."""
    usual = np.median(off, axis=0) / MEDIAN_OF_THREE
    found = []
    for first, stop in find_runs(knocks.knocked):
        turned = _turned(base, at, first, stop)
        size, whole = np.linalg.norm(turned, axis=2), np.linalg.norm(turned.sum(axis=0), axis=1)
        brief = bool(knocks.hit[first : stop + 1].any())
        gyroscopes = np.flatnonzero(whole > JOLT if brief else (size > JOLT).any(axis=0))
        found += [
            Jolt(
                int(s),
                (first + stop) // 2 if brief else first + int(np.argmax(size[:, s] > JOLT)),
                "gyr",
            )
            for s in gyroscopes
        ]
        if brief and not len(gyroscopes):
            share = off[first : stop + 1] / usual
            k, s = np.unravel_index(int(np.argmax(share)), share.shape)
            found += [Jolt(int(s), first + int(k), "acc")] if share[k, s] > SHOCK else []
    return tuple(sorted(found, key=lambda jolt: (jolt.sensor, jolt.sample)))


def _beside(strange: Bools) -> Bools:
    """Turns (n-1,) beside strange accelerations (n,): accelerometer or gyroscope may be to blame."""
    found = np.zeros(len(strange) - 1, bool)
    found[
        np.clip(np.flatnonzero(strange)[:, None] + np.arange(-BESIDE, BESIDE), 0, len(found) - 1)
    ] = True
    return found


def _turned(problem: Problem, at: Unknowns, first: int, stop: int) -> Array:
    """How sensors turned otherwise than gyroscopes say (m, S, 3) rad."""
    r = residuals.turning(problem, at, first, stop).r
    return np.asarray(r.reshape(len(r), -1, 3) * problem.turn_sd[first : first + len(r), :, None])
