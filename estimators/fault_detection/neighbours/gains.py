"""Gyroscopes that read too much or too little, one or all: the joints around them fit only where their rates are divided by a gain.

In      pairs of sensors (sensor_pairs.py)
Out     which sensor, and how many times the true rate it reads; or how many times too much all of them turn, as where the file's rate is told wrong
Source  ours: the acceleration of a common joint at the gain that leaves least; test: paired_test.py
Limits  gains between `GAINS`; a joint that rests, or turns little within a second, tells nothing. Gravity tells gains of slow movement: single_sensors/
"""

from collections.abc import Sequence
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
COMMON, FARTHER = (0.9, 1.1), (0.8, 1.2)  # of all gyroscopes; gravity tells those still farther off
AGREEING = 2 / 3  # of the joints that tell a gain of all gyroscopes
FEWEST = 4  # joints that tell it: one gyroscope alone has two
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

    The arm's acceleration is the same in both sensors of a joint, so that it looks like no gain, as it may to gravity.
    """
    if len(pairs.joints) < FEWEST:
        return 1.0, 1.0
    rest, noise, use = _left(pairs, pairs.joints)
    before = rest / noise

    def left_at(gain: float) -> Array:
        """What joints (J, K) leave at a gain, in times the noise of the rates as they are: that of larger rates is larger, which says nothing for them."""
        return _left(pairs.with_common_gain(gain), pairs.joints)[0] / noise

    def total(gain: float) -> float:
        return float(np.log1p(left_at(gain))[use].sum())

    totals = {1.0: float(np.log1p(before)[use].sum())} | {g: total(g) for g in COMMON}
    if min(totals, key=totals.__getitem__) == 1.0:
        return 1.0, 1.0
    gains, left_over = zip(*sorted((totals | {g: total(g) for g in FARTHER}).items()))
    k = int(np.argmin(left_over))
    best = float(gains[k])
    if 0 < k < len(gains) - 1:
        best = vertex(np.array(gains[k - 1 : k + 2]), np.array(left_over[k - 1 : k + 2]))
    if abs(best - 1.0) <= TOLERATED:
        return 1.0, 1.0
    left = left_at(best)
    gained = np.log1p(before) - np.log1p(left)
    # what noise may make tells less
    weight = np.where(use, np.clip(np.maximum(before, left), 0.0, 1.0), 0.0)
    of_joint = (weight * gained).sum(axis=1)[weight.any(axis=1)]
    if len(of_joint) < FEWEST or np.mean(of_joint > 0) < AGREEING:
        return 1.0, 1.0
    each = (weight * gained).sum(axis=0) / np.maximum(weight.sum(axis=0), 1e-12)
    tests = len(COMMON + FARTHER)
    return best, min(1.0, tests * paired_test.p_value(each, 0.0, weight.max(axis=0)))


def p_value_of(wrong: Pairs, right: Pairs, sensor: str, gain: float) -> float:
    """Probability that `find` would tell of a gain, by readings with it and without."""
    if not any(wrong.is_doubtful(*j) for j in wrong.joints if sensor in j):
        return 1.0
    judged = _judged(sensor, gain, *(_left(p, _around(p, sensor)) for p in (wrong, right)))
    return min(1.0, judged.p_value * _count(right))


def _count(pairs: Pairs) -> int:
    """Gains that are looked for in a recording."""
    return len(pairs.series.sensors) * (len(GAINS) + 2)


def _best(pairs: Pairs, sensor: str) -> Gain:
    """The gain of a sensor that explains its joints best, those tried and one between them."""
    joints = _around(pairs, sensor)
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


def _around(pairs: Pairs, sensor: str) -> list[tuple[str, str]]:
    """The joints of a sensor."""
    return [j for j in pairs.joints if sensor in j]


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
