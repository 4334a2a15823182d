"""Gyroscopes that read too much or too little, one or all: the joints around them fit only where their rates are divided by a gain.

In      pairs of sensors (sensor_pairs.py)
Out     which sensor, and how many times the true rate it reads; or how many times too much all of them turn, as where the file's rate is told wrong
Source  ours: the acceleration of a common joint at the gain that leaves least; test: paired_test.py
Limits  gains between `GAINS`; a joint that rests, or turns little within a second, tells nothing. Gravity tells gains of slow movement: single_sensors/
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours import paired_test
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.numerics.typing import Array

GAINS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.5, 1.8, 2.2)
TOLERATED = 0.07  # of a gain: calibration, a joint that lies a little elsewhere
MARGIN = 0.4  # of the mean log ratio of a joint, as for delays (delays.py)
LEAST_SURE = 0.01  # probability from which on a gain is looked at no further
COMMON, FARTHER = (0.9, 1.1), (0.4, 0.5, 0.65, 0.8, 1.25, 1.5, 2.0, 2.5)  # of all gyroscopes
FINE = np.array([0.95, 1.0, 1.05])  # times the gain that was found
CALIBRATED = 0.03  # so far off gyroscopes may be that were calibrated
FEWEST = 4  # joints that tell it: one gyroscope alone has two
JOINTS_OF_SENSOR = 2.0  # at least: what it errs by is in all of them
EXPLAINED = 4.0  # times their noise that joints leave at the gain: of what leaves more, a gain is not the cause


@dataclass(frozen=True)
class Gain:
    """A gyroscope that reads `gain` times the true rate."""

    sensor: str
    gain: float
    p_value: float
    evidence: float  # log ratio of what is left over, all windows and joints


def find(pairs: Pairs) -> Gain | None:
    """The most certain gain, with the probability of such evidence without any."""
    doubtful = [j for j in pairs.joints if pairs.is_doubtful(*j)]
    suspects = [s for s in pairs.series.sensors if any(s in j for j in doubtful)]
    count = _count(pairs)
    tried = [_best(pairs, s) for s in suspects]
    sure = [g for g in tried if g.p_value * count < LEAST_SURE]
    if not sure:
        return None
    best = max(sure, key=lambda g: g.evidence)
    return replace(best, p_value=best.p_value * count)


def find_common(pairs: Pairs) -> tuple[float, float]:
    """The gain that all gyroscopes have in common, with the probability of such evidence without any: 1 where none explains the joints better.

    The arm's acceleration is the same in both sensors of a joint, so that it looks like no gain, as it may to gravity. Every joint tells a gain; of a joint of which the movement tells nothing it may be any.
    """
    if len(pairs.joints) < FEWEST:
        return 1.0, 1.0
    turning = np.array([pairs.use(*j) & pairs.turns(*j) for j in pairs.joints])
    if turning.any(axis=1).sum() < FEWEST:
        return 1.0, 1.0
    noise = np.array([pairs.joint(*j).noise for j in pairs.joints])

    def left_at(gain: float) -> Array:
        """What each joint that turns (J,) leaves over at a gain: the sum over windows of log(1 + rest / noise).

        Noise is that of the rates as they are: more skin movement is expected of larger rates, which says nothing for them. Where the joint lies is not told: rates that are too large would show it too near.
        """
        divided = pairs if gain == 1.0 else pairs.with_common_gain(gain)
        rest = np.array([divided.joint(*j).rest for j in pairs.joints])
        total = np.where(turning, np.log1p(rest / noise), 0.0).sum(axis=1)
        return np.asarray(total[turning.any(axis=1)])

    near = {g: left_at(g) for g in (1.0, *COMMON)}
    if abs(np.median(_gain_of_each(near)) - 1.0) <= CALIBRATED:
        return 1.0, 1.0
    of_joint = _gain_of_each(near | {g: left_at(g) for g in FARTHER})
    gain = float(np.median(of_joint))
    if abs(gain - 1.0) <= TOLERATED or gain in (min(FARTHER), max(FARTHER)):
        return 1.0, 1.0
    off = np.sign(gain - 1.0) * (of_joint - 1.0)
    gain = float(np.median(_gain_of_each({g: left_at(g) for g in gain * FINE})))
    return gain, min(1.0, 2 * paired_test.trimmed_p_value(off, CALIBRATED, JOINTS_OF_SENSOR))


def _gain_of_each(totals: Mapping[float, Array]) -> Array:
    """The gain that explains each joint best."""
    gains = np.array(sorted(totals))
    return np.array([_lowest(gains, each) for each in np.array([totals[g] for g in gains]).T])


def _lowest(gains: Array, left: Array) -> float:
    k = int(np.clip(np.argmin(left), 1, len(gains) - 2))
    return vertex(gains[k - 1 : k + 2], left[k - 1 : k + 2])


def p_value_of(wrong: Pairs, right: Pairs, sensor: str, gain: float) -> float:
    """Probability that `find` would tell of a gain, by readings with it and without."""
    if not any(wrong.is_doubtful(*j) for j in wrong.joints_of(sensor)):
        return 1.0
    judged = _judged(sensor, gain, *(_left(p, p.joints_of(sensor)) for p in (wrong, right)))
    return min(1.0, judged.p_value * _count(right))


def _count(pairs: Pairs) -> int:
    """Gains that are looked for in a recording."""
    return len(pairs.series.sensors) * (len(GAINS) + 2)


def _best(pairs: Pairs, sensor: str) -> Gain:
    """The gain of a sensor that explains its joints best, those tried and one between them."""
    joints = pairs.joints_of(sensor)
    before = _left(pairs, joints)
    after = {g: _left(pairs.with_gain(sensor, g), joints) for g in GAINS}
    gains = sorted([*GAINS, 1.0])
    totals = [_total(before if g == 1.0 else after[g]) for g in gains]
    k = int(np.argmin(totals))
    if abs(gains[k] - 1.0) <= TOLERATED or k in (0, len(gains) - 1):
        return Gain(sensor, 1.0, 1.0, 0.0)
    gain = vertex(np.array(gains[k - 1 : k + 2]), np.array(totals[k - 1 : k + 2]))
    between = _left(pairs.with_gain(sensor, gain), joints)
    if _total(between) > totals[k]:
        gain, between = gains[k], after[gains[k]]
    return _judged(sensor, gain, before, between)


def _left(
    pairs: Pairs, joints: Sequence[tuple[str, str]]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """What joints (J, K) leave over, the noise in it, and where both sensors have samples and turn."""
    fits = [pairs.joint(*j, j) for j in joints]
    use = [pairs.use(*j) & pairs.turns(*j) for j in joints]
    return np.array([f.rest for f in fits]), np.array([f.noise for f in fits]), np.array(use)


def _total(left: tuple[Array, Array, NDArray[np.bool_]]) -> float:
    rest, noise, use = left
    return float((paired_test.log_rest(rest, noise) * use).sum())


def _judged(
    sensor: str,
    gain: float,
    declared: tuple[Array, Array, NDArray[np.bool_]],
    other: tuple[Array, Array, NDArray[np.bool_]],
) -> Gain:
    """The paired test of a gain against none, over windows."""
    (before, noise, use), (after, _, _) = declared, other
    gained = np.where(
        use, paired_test.log_rest(before, noise) - paired_test.log_rest(after, noise), 0.0
    ).sum(axis=0)
    shown = np.clip(np.maximum(before, after) / noise, 0.0, 1.0)  # what skin may make tells less
    weight = np.where(use, shown, 0.0).max(axis=0)
    if float((weight * after * use).sum()) > EXPLAINED * float((weight * noise * use).sum()):
        return Gain(sensor, 1.0, 1.0, 0.0)
    p = paired_test.p_value(gained / np.maximum(use.sum(axis=0), 1), MARGIN, weight)
    return Gain(sensor, gain, p, float(gained @ (weight > 0)))


def vertex(x: Array, y: Array) -> float:
    """Where the parabola through three points has its least."""
    a, b, _ = np.polyfit(x - x[1], y, 2)
    return float(np.clip(x[1] - b / (2 * max(a, 1e-9)), x[0], x[2]))
