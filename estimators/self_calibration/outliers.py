"""Outliers: a sensor was hit, or turned faster than its gyroscope can measure.

In      a Problem, a place, residuals of the accelerations there (posterior.acceleration_deviations)
Out     ImpactDetection: which accelerations and turns to down-weight, and by how much; Outlier: which sensor, and when
Source  ours; weights of accelerations where it lasts: Huber's loss; squared of the worst turn, 3 deg that never were still pulled by 4 of 0.7 deg
Limits  in a brief impact neither accelerometer nor gyroscope is used; in a longer one the accelerometers determine how the sensor turned
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from handscope.estimators.numerics.intervals import find_runs
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.self_calibration import residuals
from handscope.estimators.self_calibration.problem import Problem, Unknowns
from handscope.estimators.self_calibration.uncertainty import posterior

GROSS = 10.0  # usual errors: smaller residuals are down-weighted and are no impact; skin under the hand's sensor, moved by other fingers, gives 6
OPENED = 1e3  # times the error of a turn while its gyroscope is tested for an impact: half a degree
MISSING = 1e3  # times the error of an acceleration in an impact
BESIDE = 3  # turns on either side of a strange acceleration: a rate enters four of them, three samples an acceleration
BRIEF = 0.1  # s, longest impact; a gyroscope may be at its limit for longer
LEAST_OUTLIER_TURN = np.radians(0.2)  # 20 deg/s for 10 ms: smaller ones are not reported
SHOCK = 20.0  # usual errors: smaller ones are not reported
MEDIAN_OF_THREE = 0.888  # of the length of three independent errors against its RMS
CHUNK = 1024  # samples whose derivatives are in memory at once
Kind = Literal["gyr", "acc"]


@dataclass(frozen=True)
class Outlier:
    """A reading that contradicts the other sensors: a turn against the accelerations, or an acceleration against those of its neighbours."""

    sensor: int
    sample: int
    kind: Kind


@dataclass(frozen=True)
class ImpactDetection:
    """Outliers detected so far."""

    in_impact: Bools  # (n,) samples of brief impacts, whose readings are not used
    suspect: Bools  # (n-1,) turns beside strange accelerations
    newly_suspect: Bools  # (n-1,) of them those found in the last pass
    doubt: Array  # (n, S) factors on the errors of accelerations, from the last pass


def none_detected(samples: int) -> ImpactDetection:
    """The result for so many samples without an outlier."""
    still = np.zeros(samples - 1, bool)
    return ImpactDetection(np.zeros(samples, bool), still, still, np.ones((samples, 1)))


def detect_outliers(
    before: ImpactDetection, off: Array, limit: float, dt: float, free: Bools
) -> ImpactDetection:
    """Add the outliers among residuals off (n, S), in standard deviations: those beyond `limit` times what is usual where movement is `free` (n,)."""
    doubt = np.maximum(off / (usual_deviations(off, free) + 1e-300) / limit, 1.0)
    strange = np.asarray((doubt > 1).any(axis=1) & (limit * doubt >= GROSS).any(axis=1))
    hit = np.zeros(len(off), bool)
    for first, stop in find_runs(strange, BESIDE):
        hit[first:stop] = (stop - first) * dt <= BRIEF
    doubt[hit] = MISSING
    doubt[before.in_impact] = 1.0  # not used anyway
    beside = _adjacent_turns(strange)
    return ImpactDetection(
        before.in_impact | hit, before.suspect | beside, beside & ~before.suspect, doubt
    )


def usual_deviations(off: Array, free: Bools) -> Array:
    """The usual size (S,) of residuals off (n, S): skin and a coarse rate err with movement, and a hand that holds contacts still is no measure of them."""
    return np.asarray(np.median(off[free], axis=0) / MEDIAN_OF_THREE)


def turn_noise_factors(
    detection: ImpactDetection, base: Problem, at: Unknowns, limit: float
) -> Array:
    """Factors on the errors of turns (n-1, S): newly suspect ones are free, of the others those that fit get their weight back; the worst of a moment weighs less the further it is off.

    `base` has the prior errors of the gyroscopes.
    """
    off = np.where(detection.suspect[:, None], posterior.turn_deviations(base, at), 0.0)
    doubt = np.maximum(off / limit, 1.0)
    worst = off == off.max(axis=1, keepdims=True)
    return np.where(detection.newly_suspect[:, None], OPENED, np.where(worst, doubt**2, doubt))


def list_outliers(
    detection: ImpactDetection, base: Problem, at: Unknowns, off: Array, free: Bools
) -> tuple[Outlier, ...]:
    """Outliers by sensor, at the minimum; `off` (n, S) and `free` (n,) as of `detect_outliers`, with errors of accelerations as without impacts."""
    usual = usual_deviations(off, free)
    outliers = []
    for first, stop in find_runs(detection.suspect):
        turned = _turn_residuals(base, at, first, stop)
        size, whole = np.linalg.norm(turned, axis=2), np.linalg.norm(turned.sum(axis=0), axis=1)
        brief = bool(detection.in_impact[first : stop + 1].any())
        gyroscopes = np.flatnonzero(
            whole > LEAST_OUTLIER_TURN if brief else (size > LEAST_OUTLIER_TURN).any(axis=0)
        )
        outliers += [
            Outlier(
                int(s),
                (first + stop) // 2
                if brief
                else first + int(np.argmax(size[:, s] > LEAST_OUTLIER_TURN)),
                "gyr",
            )
            for s in gyroscopes
        ]
        if brief and not len(gyroscopes):
            share = off[first : stop + 1] / usual
            k, s = np.unravel_index(int(np.argmax(share)), share.shape)
            outliers += [Outlier(int(s), first + int(k), "acc")] if share[k, s] > SHOCK else []
    return tuple(sorted(outliers, key=lambda outlier: (outlier.sensor, outlier.sample)))


def _adjacent_turns(strange: Bools) -> Bools:
    """Turns (n-1,) beside outlying accelerations (n,): the accelerometer or the gyroscope may be wrong."""
    marked = np.zeros(len(strange) - 1, bool)
    marked[
        np.clip(np.flatnonzero(strange)[:, None] + np.arange(-BESIDE, BESIDE), 0, len(marked) - 1)
    ] = True
    return marked


def _turn_residuals(problem: Problem, at: Unknowns, first: int, stop: int) -> Array:
    """Turns of the sensors less those of their gyroscopes (m, S, 3) rad."""
    r = residuals.gyroscope_residuals(problem, at, first, stop)
    return np.asarray(r.reshape(len(r), -1, 3) * problem.turn_sd[first : first + len(r), :, None])
