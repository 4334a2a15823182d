"""Gains, delays and other faults of gyroscopes by the rates that neighbours have in common.

In      rates in common (common_rates.py)
Out     gains and delays as gains.py and delays.py have them, joints whose rates no such cause explains as unexplained.py does
Source  ours; test of one description against another: paired_test.py; what joints of intact sensors leave in the `FEW`-th worst window is about lognormal
Limits  those of common_rates.py; a gain of the hand's sensor is one of all fingers, and not looked for
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.fault_detection.neighbours import delays, gains, paired_test
from handscope.estimators.fault_detection.neighbours.common_joint import SKIN
from handscope.estimators.fault_detection.neighbours.delays import Delay
from handscope.estimators.fault_detection.neighbours.gains import Gain
from handscope.estimators.fault_detection.neighbours.rates.common_rates import CommonRates, Joint
from handscope.estimators.fault_detection.neighbours.unexplained import Unexplained, spans_of
from handscope.estimators.numerics.tail_probabilities import normal_sf
from handscope.estimators.numerics.typing import Array

ODD = 1.5  # variances that a window leaves from which on it is odd; as many as paired_test.FEWEST of them make a joint odd
GAINS = (0.02, 0.1, 0.3, *gains.GAINS, 3.0, 10.0, 57.0)
MARGIN = 0.4  # of the mean log ratio, as for delays (delays.py)
STEP = 0.04  # s, of the lags
POSSIBLE = (
    0.5  # probability from which on a delay is looked at no further: it has to come below 1e-6
)
EXPLAINED = 4.0  # variances that joints leave at most where their cause is found
FEW = 3  # windows
BY_SKIN = (
    2 * SKIN
)  # of a gain: a sensor on skin that the joint before its segment pulls turns by so much more, or less, than the segment
# of what intact hinges leave in the FEW-th worst window: of 834 simulated ones 0.20 and 0.56, of freely moved hands with twice the skin 2.7 at most
MEDIAN, SPREAD = 0.4, 0.6


def find_gain(rates: CommonRates) -> Gain | None:
    """The most certain gain of a gyroscope, with the probability of such evidence without any."""
    odd = [j for j in _odd_joints(rates) if j in rates.hinges]  # a gain shows at a hinge, too
    suspects = [s for s in rates.pairs.series.sensors if any(s in j for j in odd) and s != "hand"]
    tried = [_best_gain(rates, s) for s in suspects]
    count = _count_of_gains(rates)
    sure = [
        g for g in tried if g.p_value * count < gains.LEAST_SURE and abs(g.gain - 1.0) > BY_SKIN
    ]
    if not sure:
        return None
    best = max(sure, key=lambda g: g.evidence)
    return replace(best, p_value=best.p_value * count)


def p_value_of_gain(rates: CommonRates, sensor: str, gain: float) -> float:
    """Probability that `find_gain` would tell of a gain put into a sensor."""
    if sensor == "hand":
        return 1.0
    around = [j for j in rates.joints if sensor in j]
    of_joint = [(1.0, 1.0 / gain) if j[1] == sensor else (1.0 / gain, 1.0) for j in around]
    wrong = np.array([rates.left(j, 0.0, *g) for j, g in zip(around, of_joint)])
    is_odd = [j in rates.hinges and _is_odd(left) for j, left in zip(around, wrong)]
    if not any(is_odd):
        return 1.0
    right = np.array([rates.left(j) for j in around])
    return min(1.0, _tested(wrong, right)[0] * _count_of_gains(rates))


def p_value_of_delay(rates: CommonRates, joint: Joint, late: float) -> float:
    """Probability that `find_delays` would tell of a delay put into what is beyond a joint."""
    wrong, right = rates.left(joint, late), rates.left(joint)
    if not _is_odd(wrong):
        return 1.0
    spans = delays.spans(*rates.pairs.series.span)
    return min(1.0, _tested(wrong[None], right[None])[0] * _count_of_delays(rates, spans))


def _lags() -> Array:
    steps = round(delays.FURTHEST / STEP)
    return np.asarray(STEP * np.arange(-steps, steps + 1, dtype=float))


def _count_of_delays(rates: CommonRates, spans: Sequence[tuple[float, float]]) -> int:
    return len(delays.groups(rates.pairs)) * 2 * len(_lags()) * len(spans)


def _count_of_gains(rates: CommonRates) -> int:
    return len(rates.pairs.series.sensors) * len(GAINS)


def _best_gain(rates: CommonRates, sensor: str) -> Gain:
    around = [j for j in rates.joints if sensor in j]

    def left(gain: float) -> Array:
        return np.array(
            [
                rates.left(j, 0.0, gain if j[0] == sensor else 1.0, gain if j[1] == sensor else 1.0)
                for j in around
            ]
        )

    before = left(1.0)
    every = {g: left(g) for g in GAINS}
    totals = [_misfit(every[g]) for g in GAINS]
    k = int(np.argmin(totals))
    gain = GAINS[k]
    if 0 < k < len(GAINS) - 1:
        x, y = np.log(GAINS[k - 1 : k + 2]), np.array(totals[k - 1 : k + 2])
        between = float(np.exp(gains.vertex(x, y)))
        if abs(between - 1.0) > gains.TOLERATED and _misfit(left(between)) < totals[k]:
            gain = between
    p, evidence = _tested(before, left(gain))
    return Gain(sensor, gain, p, evidence)


def find_delays(rates: CommonRates, faulty: Sequence[str] = ()) -> list[Delay]:
    """Late sensors and strips, most certain first; at most one for each joint that shows it."""
    groups = delays.groups(rates.pairs)
    spans = delays.spans(*rates.pairs.series.span)
    lags, count = _lags(), _count_of_delays(rates, spans)
    odd = [j for j in _odd_joints(rates) if not set(j) & set(faulty)]
    odd = [j for j in odd if _may_be_late(rates, j, lags[::2], spans)]
    return delays.most_certain(
        odd,
        groups,
        lambda g: [d for s in spans if (d := _best_delay(rates, lags, g, s))],
        count,
    )


def _may_be_late(
    rates: CommonRates, joint: Joint, lags: Array, spans: Sequence[tuple[float, float]]
) -> bool:
    """Whether a delay may explain what a joint leaves: of a joint that abducts a quick test first, for which nothing is fitted again."""
    if joint in rates.hinges:
        return True
    before = rates.left(joint)
    near = np.array([rates.left_near(joint, float(lag)) for lag in np.round(lags, 6)])
    near = np.where(np.isfinite(near).all(axis=0), near, np.nan)
    for start, stop in spans:
        inside = (rates.t >= start) & (rates.t < stop)
        best = min(near[:, inside], key=_misfit)
        if _tested(before[None, inside], best[None])[0] < POSSIBLE:
            return True
    return False


def _best_delay(
    rates: CommonRates, lags: Array, group: tuple[str, ...], span: tuple[float, float]
) -> Delay | None:
    inside = (rates.t >= span[0]) & (rates.t < span[1])
    around = [j for j in rates.joints if (j[0] in group) != (j[1] in group)]
    if not around or np.count_nonzero(inside) < paired_test.FEWEST:
        return None
    rest = _at_lags(rates, lags, group, around)[:, :, inside]
    rest = np.where(np.isfinite(rest).all(axis=1, keepdims=True), rest, np.nan)
    totals = [_misfit(rest[:, k]) for k in range(len(lags))]
    k, zero = int(np.argmin(totals)), len(lags) // 2
    if k in (0, len(lags) - 1) or abs(lags[k]) < STEP / 2:
        return None
    before = rest[:, zero]
    fine = lags[k] + np.array([-0.5, 0.0, 0.5]) * STEP
    nearer = _at_lags(rates, fine, group, around)[:, :, inside]
    by_fine = np.array([_misfit(nearer[:, i]) for i in range(len(fine))])
    best = int(np.argmin(by_fine))
    after, late = nearer[:, best], delays.vertex(fine, by_fine, best)
    if abs(late) <= delays.TOLERATED:
        return None
    p, evidence = _tested(before, after)
    return Delay(group, late, p, evidence, span)


def _at_lags(
    rates: CommonRates, lags: Array, group: tuple[str, ...], around: Sequence[Joint]
) -> Array:
    """What joints leave (J, L, K) where a group's samples are taken later by each lag."""
    return np.array(
        [
            [rates.left(j, float(np.round(lag if j[1] in group else -lag, 6))) for lag in lags]
            for j in around
        ]
    )


def find_unexplained(rates: CommonRates) -> Iterator[Unexplained]:
    """Hinges whose rates disagree in a few windows at least, more than those of intact sensors do."""
    for joint in rates.hinges if rates.explains else ():
        rest = rates.left(joint)
        if np.count_nonzero(np.isfinite(rest)) < paired_test.FEWEST or _few(rest) <= ODD:
            continue
        ratio = min(_few(rest), *(_few(rates.left(joint, 0.0, *by)) for by in _of_skin()))
        p = float(normal_sf(np.log(max(ratio, 1e-12) / MEDIAN) / SPREAD)) * len(rates.hinges)
        if ratio > ODD:
            yield Unexplained(
                joint, ratio, min(1.0, p), *spans_of(rates.pairs, joint, rest, rest > ODD)
            )


def _few(left: Array) -> float:
    """What (K,) the FEW-th worst window leaves."""
    return float(np.sort(left[np.isfinite(left)])[-FEW])


def _of_skin() -> Iterator[tuple[float, float]]:
    """Gains of parent and child that skin may make."""
    for gain in (1.0 - BY_SKIN, 1.0 + BY_SKIN):
        yield gain, 1.0
        yield 1.0, gain


def _odd_joints(rates: CommonRates) -> list[Joint]:
    return [j for j in rates.joints if _is_odd(rates.left(j))]


def _is_odd(left: Array) -> bool:
    return bool(np.count_nonzero(left > ODD) >= paired_test.FEWEST)


def _misfit(rest: Array) -> float:
    return float(np.nansum(np.log1p(rest)))


def _tested(before: Array, after: Array) -> tuple[float, float]:
    """Paired test of what joints (J, K) leave with a cause against without: probability and log ratio."""
    known = np.isfinite(before + after)
    gain = np.where(known, np.log1p(before) - np.log1p(after), 0.0).sum(axis=0)
    each = np.where(known, paired_test.weight(before, after, np.ones_like(before)), 0.0)
    weight = each.max(axis=0)
    if float(np.nansum(each * after)) > EXPLAINED * float(each.sum()):
        return 1.0, 0.0
    p = paired_test.p_value(gain / np.maximum(known.sum(axis=0), 1), MARGIN, weight)
    return p, float(gain @ (weight > 0))
