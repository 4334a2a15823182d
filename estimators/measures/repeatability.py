"""Repeatability: how far the same posture, or the same person's figure, comes out alike when measured again.

Within a trial   range and SD of each joint's angle over the holds of a trial (six seconds each, ten in a row), then the mean over the trials
Over sessions    intraclass correlation, standard error of measurement (SEM), minimal detectable change (MDC95 = 1.96 sqrt(2) SEM)
Source           Kortier, thesis 2.2 and Table 2.3 after Wise et al. 1990; Shrout & Fleiss 1979, Psychol Bull 86:420; which form when:
                 Koo & Li 2016, J Chiropr Med 15:155; SEM for agreement: de Vet et al. 2006, J Clin Epidemiol 59:1033
Limits           the thesis does not say what a hold's angle is: we take its mean. Ten values of a normal distribution have a range of 3.1 SD; the table's
                 ranges are 2.6-3.5 SD, as ranges over ten holds are, not over thousands of samples
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, fdtri

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import DOF_NAMES, JOINTS
from handscope.estimators.numerics.typing import Array

CONFIDENCE = 0.95
# of a difference of two measurements that is beyond 95 % of what chance gives
MDC = 1.96 * np.sqrt(2.0)
SETTLING = 1.0  # s at each end of a hold that is left out: the hand still moves there; ours


@dataclass(frozen=True)
class Spread:
    """Table 2.3 for one posture: what a joint's angle varies by within a trial; SI units."""

    names: tuple[str, ...]  # of the angles
    ranges: Array  # (trials, angles) largest minus smallest hold
    sds: Array  # (trials, angles) over the holds of a trial

    @property
    def range(self) -> Array:
        """Mean over the trials (angles,); NaN where an angle was never measured."""
        return _mean(self.ranges)

    @property
    def sd(self) -> Array:
        return _mean(self.sds)

    @property
    def overall(self) -> tuple[float, float]:
        """Mean range and SD over all trials and angles: one subject's row of Table 2.3."""
        return float(np.nanmean(self.ranges)), float(np.nanmean(self.sds))


@dataclass(frozen=True)
class Interval:
    """A value with its confidence interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Reliability:
    """What n targets (people, hands) measured in k sessions tell of the instrument; SEM and MDC in the values' unit."""

    targets: int
    sessions: int
    icc_agreement: Interval  # ICC(2,1): two-way random, absolute agreement, single measurement
    icc_consistency: Interval  # ICC(3,1): two-way mixed, consistency, single measurement
    sem: Interval  # for agreement: differences between the sessions count
    sem_consistency: Interval  # without what all targets changed by from session to session
    mdc95: Interval  # from `sem`


@dataclass(frozen=True)
class Within:
    """SEM and MDC from groups of repeated measurements of unequal size, each group of one person while nothing changed; in the values' unit."""

    measurements: int  # in groups of two and more
    freedom: int  # measurements less groups
    sem: Interval
    mdc95: Interval


def held_angles(
    moved: Trajectory, holds: Sequence[tuple[float, float]], settling: float = SETTLING
) -> Array:
    """Mean of every freedom's angle (holds, DOF_NAMES) rad over each hold (start, stop) s, its ends left out; NaN where not measured."""
    columns = [(j, a) for j, joint in enumerate(JOINTS) for a in joint.dofs]
    j, a = np.array(columns).T
    found = np.full((len(holds), len(columns)), np.nan)
    for k, (start, stop) in enumerate(holds):
        if stop - start <= 2 * settling:
            raise InputError(
                "measure.hold_too_short", start=start, stop=stop - start, settling=settling
            )
        found[k] = _mean(moved.between(start + settling, stop - settling).angles[:, j, a])
    return found


def posture_spread(held: Array, names: Sequence[str] = DOF_NAMES) -> Spread:
    """Range and SD within each trial from held angles (trials, holds, angles)."""
    if held.ndim != 3 or held.shape[1] < 2 or held.shape[2] != len(names):
        raise InputError("measure.too_few_holds")
    return Spread(tuple(names), held.max(axis=1) - held.min(axis=1), held.std(axis=1, ddof=1))


def reliability(values: Array) -> Reliability:
    """ICC, SEM and MDC of values (targets, sessions), one measurement a cell; targets with a missing session are left out.

    A single target (one patient measured k times) gives SEM and MDC; an ICC needs two targets.
    """
    complete = values[np.isfinite(values).all(axis=1)] if values.ndim == 2 else np.empty((0, 0))
    n, k = complete.shape
    if n < 1 or k < 2:
        raise InputError("measure.too_few_sessions")
    grand, row, column = complete.mean(), complete.mean(axis=1), complete.mean(axis=0)
    # = EMS + (JMS - EMS) / n: variance of the sessions and of the rest
    within = ((complete - row[:, None]) ** 2).sum() / (n * (k - 1))
    nothing = Interval(np.nan, np.nan, np.nan)
    if n < 2:
        sem = _sem(within, k - 1)
        return Reliability(n, k, nothing, nothing, sem, nothing, _scale(sem, MDC))
    bms = k * ((row - grand) ** 2).sum() / (n - 1)
    jms = n * ((column - grand) ** 2).sum() / (k - 1)
    free = (n - 1) * (k - 1)
    ems = ((complete - row[:, None] - column + grand) ** 2).sum() / free
    ems = ems if ems > 1e-12 * (bms + jms) else 0.0  # rounding
    satterthwaite = (
        within**2 / ((jms / n) ** 2 / (k - 1) + ((n - 1) * ems / n) ** 2 / free)
        if within > 0
        else float(n * (k - 1))
    )
    sem = _sem(within, satterthwaite)
    return Reliability(
        n,
        k,
        _icc21(bms, jms, ems, n, k),
        _icc31(bms, ems, n, k),
        sem,
        _sem(ems, free),
        _scale(sem, MDC),
    )


def within_groups(groups: Sequence[Sequence[float]]) -> Within | None:
    """The pooled standard deviation within groups (Bland & Altman 1996, BMJ 312:1654); of equal groups it is `reliability`'s SEM for agreement.

    A group of one has no spread and is left out; None where none is left.
    """
    repeated = [np.asarray(g, float) for g in groups if len(g) > 1]
    if not repeated:
        return None
    n = sum(len(g) for g in repeated)
    freedom = n - len(repeated)
    sem = _sem(sum(float(((g - g.mean()) ** 2).sum()) for g in repeated) / freedom, freedom)
    return Within(n, freedom, sem, _scale(sem, MDC))


def _icc21(bms: float, jms: float, ems: float, n: int, k: int) -> Interval:
    """Shrout & Fleiss 1979: ICC(2,1) with its approximate interval (Satterthwaite; McGraw & Wong 1996, case 2A)."""
    below = bms + (k - 1) * ems + k * (jms - ems) / n
    if not below > 0:
        return Interval(np.nan, np.nan, np.nan)
    icc = float((bms - ems) / below)
    if ems == 0 or icc >= 1:
        return Interval(icc, np.nan, np.nan)  # no error variance: the F distributions do not exist
    a = k * icc / (n * (1 - icc))
    b = 1 + k * icc * (n - 1) / (n * (1 - icc))
    v = (a * jms + b * ems) ** 2 / ((a * jms) ** 2 / (k - 1) + (b * ems) ** 2 / ((n - 1) * (k - 1)))
    tail = 1 - (1 - CONFIDENCE) / 2
    lower, upper = fdtri(n - 1, v, tail), fdtri(v, n - 1, tail)
    rest = k * jms + (k * n - k - n) * ems
    return Interval(
        icc,
        float(n * (bms - lower * ems) / (lower * rest + n * bms)),
        float(n * (upper * bms - ems) / (rest + n * upper * bms)),
    )


def _icc31(bms: float, ems: float, n: int, k: int) -> Interval:
    """Shrout & Fleiss 1979: ICC(3,1) with its exact interval."""
    if not bms + (k - 1) * ems > 0:
        return Interval(np.nan, np.nan, np.nan)
    icc = float((bms - ems) / (bms + (k - 1) * ems))
    if ems == 0:
        return Interval(icc, np.nan, np.nan)
    tail = 1 - (1 - CONFIDENCE) / 2
    low = bms / ems / fdtri(n - 1, (n - 1) * (k - 1), tail)
    high = bms / ems * fdtri((n - 1) * (k - 1), n - 1, tail)
    return Interval(icc, float((low - 1) / (low + k - 1)), float((high - 1) / (high + k - 1)))


def _sem(variance: float, freedom: float) -> Interval:
    """Square root of a variance with its interval from chi-squared."""
    tail = (1 - CONFIDENCE) / 2
    low, high = (np.sqrt(variance * freedom / chdtri(freedom, p)) for p in (tail, 1 - tail))
    return Interval(float(np.sqrt(variance)), float(low), float(high))


def _scale(x: Interval, factor: float) -> Interval:
    return Interval(float(factor * x.value), float(factor * x.low), float(factor * x.high))


def _mean(values: Array) -> Array:
    """Mean over the first axis of what is finite; NaN where nothing is."""
    known = np.isfinite(values)
    n = known.sum(axis=0)
    return np.where(n > 0, np.where(known, values, 0.0).sum(axis=0) / np.maximum(n, 1), np.nan)
