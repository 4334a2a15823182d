"""Each gyroscope against its own accelerometer: which of all signs, orders, units and gains gravity fits best, and how sure that is.

In      cells of readings of S sensors
Out     per sensor the fault that explains the readings better than none, when it holds, and the evidence for it
Source  the likelihood ratio of a fault against none exceeds r with a probability of at most 1 / r where there is none (Vovk & Wang 2021, Ann Stat 49:1736)
Limits  where gravity hardly changes in the sensor's axes nothing is told; a turn about the vertical is not seen
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.single_sensors.cells import Cells, begins
from handscope.estimators.fault_detection.single_sensors.gravity_fit import (
    REPEATED,
    Fit,
    Information,
    fit,
    information_of,
    likelihood_of,
    likelihoods_of,
    priors,
)
from handscope.estimators.fault_detection.single_sensors.gravity_windows import (
    DELAY,
    windows_of,
)
from handscope.estimators.fault_detection.single_sensors.gyroscope_faults import (
    AXES,
    Cause,
    Fault,
    discrete_faults,
    share_of,
)
from handscope.estimators.numerics.typing import Array

CANDIDATES = 4  # faults looked at closely, of the whole and of a stretch
MOVED = 4.0  # log-likelihood that a chain has to lose for its gyroscope to be doubted
SUSPECT = 3.0  # log-likelihood that using the gyroscope has to gain in such a chain
USEFUL = 0.12  # share of what is lost without the gyroscope, that using it has to gain
HOPEFUL = 3.0  # log-likelihood that a fault has to gain at least to be looked at closely: what is told gains four times as much
LOST = 6.0  # log-likelihood, repetitions allowed for, that is lost in such chains
GAINED = 3.0  # log-likelihood that free corrections gain by chance
STARTS = (1.0, 0.25, 0.35, 0.5, 0.7, 1.4, 2.0, 2.8, 4.0)  # gains from which the best is looked for
LEAST_GAIN = 0.2  # and its inverse: gains beyond are told as something else
LARGEST = 0.9  # of a matrix that is off without a name
TIED = 3.0  # log-likelihood by which rivals may be worse than the best ...
NEARLY = 0.2  # ... beside this share of it
# By how much likelihoods overstate what distinguishes two faults: errors of skin and filters last for many windows. With it the
# probability of the true cause is largest, on average of logarithms, in each of three samples of some 600 faults (docs/checks.md)
OVERSTATED = 3.0
ROUNDS, SMALL = 3, 0.01  # of corrections until they are small
# rounds where a matrix is that far off, as of a gyroscope that is turned in its sensor
FURTHER, FAR = 6, 0.3
IDENTITY = np.eye(3)
GAIN = IDENTITY.reshape(9, 1) / np.sqrt(3.0)
AXIS_GAINS = tuple(np.diag(IDENTITY[k]).reshape(9, 1) for k in range(3))
ANYHOW = np.eye(9)


@dataclass(frozen=True)
class Verdict:
    """What the readings of one sensor say for one fault."""

    fault: Fault
    chains: tuple[int, int]  # first, and behind the last
    evidence: float  # logarithm of the likelihood ratio against no fault, repetitions of the movement allowed for
    weight: float  # expected of all faults and stretches to be just this one


@dataclass(frozen=True)
class Judged:
    """What is known of one sensor's gyroscope."""

    verdicts: tuple[Verdict, ...]  # faults that explain the readings better than none, best first
    useful: float  # log-likelihood that the gyroscope gains as it is: negative, the readings would fit better without

    @property
    def surest(self) -> Verdict:
        """The fault that readings without any look least like."""
        return max(self.verdicts, key=lambda v: float(np.log(v.weight)) + v.evidence)

    @property
    def named(self) -> Verdict:
        """The most probable of the faults that explain the readings."""
        return max(self.verdicts, key=log_odds)

    @property
    def causes(self) -> dict[Cause, float]:
        """How probable each cause is, of a fault that explains the readings."""
        top, odds = log_odds(self.named), dict[Cause, float]()
        for v in self.verdicts:
            odds[v.fault.cause] = odds.get(v.fault.cause, 0.0) + float(np.exp(log_odds(v) - top))
        total = sum(odds.values())
        return {cause: each / total for cause, each in odds.items()}

    @property
    def rivals(self) -> list[Verdict]:
        """Faults that explain the readings nearly as well as the best, it included."""
        top = max(v.evidence for v in self.verdicts)
        return [v for v in self.verdicts if v.evidence > (1 - NEARLY) * top - TIED]

    def may_be(self, fault: Fault) -> bool:
        """Whether a fault is among those that explain the readings nearly as well as the best."""
        return any(
            v.fault.code == fault.code and v.fault.values == fault.values for v in self.rivals
        )


def judge(cells: Cells, free: bool = True) -> list[Judged]:
    """Look for faults of every gyroscope that explain its readings better than none.

    Parameters
    ----------
    cells : Cells
        Readings of S sensors.
    free : bool
        Whether gains, cross-axis shares and delays are looked for beside signs, orders and units.

    Returns
    -------
    list of Judged
        By sensor.
    """
    if not len(begins(len(cells.valid))) or not cells.sensors:
        return [Judged((), 0.0) for _ in cells.sensors]
    right = information_of(windows_of(cells, IDENTITY))
    without = likelihood_of(windows_of(cells, 0 * IDENTITY, False))
    as_it_is = fit(right).likelihood
    odd, useless = _odd(right), _useless(as_it_is, without)
    closer = np.flatnonzero(odd | useless)
    found = [Judged((), float(useful)) for useful in (as_it_is - without).sum(axis=0)]
    if len(closer):
        part = cells.of(closer)
        quick = likelihoods_of(part, np.array([f.matrix for f in discrete_faults()]))
        common = np.argsort(-quick.sum(axis=(1, 2)))[:2]
        gains = quick[:1]  # both begin with the identity
        if free:
            scaled = np.array([g * IDENTITY for g in STARTS[1:]])
            gains = np.concatenate([gains, likelihoods_of(part, scaled)])
        for k, sensor in enumerate(closer):
            if not odd[sensor] and _most_gained(quick[:, :, k], gains[:, :, k]) < HOPEFUL:
                continue
            own, one = part.of(np.array([k])), right.part(slice(None), np.array([sensor]))
            all_of = list(_discrete(own, one, quick[:, :, k], common))
            all_of += _continuous(own, one, gains[:, :, k]) if free else ()
            best_first = sorted(
                (v for v in all_of if v.evidence > 0), key=lambda v: -v.evidence - np.log(v.weight)
            )
            found[sensor] = replace(found[sensor], verdicts=tuple(best_first))
    return found


def log_odds(verdict: Verdict) -> float:
    """How probable a fault is against another, logarithm."""
    return float(np.log(verdict.weight)) + verdict.evidence / OVERSTATED


def p_values_of_gain(right: Information, wrong: Information) -> Array:
    """How sure (S,) `judge` would be of a gain, by its whole recording: `right` are the readings without it, `wrong` those with it."""
    none, explained = fit(wrong), fit(right)
    gained = explained.likelihood.sum(axis=0) + fit(right, priors(GAIN)).cost - none.evidence
    evidence = gained / np.maximum(explained.repeats, none.repeats)
    chains, sensors = right.n.shape
    weight = _weight("gyroscope_gain", slice(0, chains), chains, 1)
    return np.asarray(np.minimum(1.0, sensors / weight * np.exp(-np.maximum(evidence, 0.0))))


def stretches(chains: int) -> list[slice]:
    """All chains, halves and quarters of them that hold two or more."""
    cuts = {(0, chains)} | {
        (k * chains // n, (k + 1) * chains // n) for n in (2, 4) for k in range(n)
    }
    return [slice(a, b) for a, b in sorted(cuts) if b - a >= 2 or (a, b) == (0, chains)]


def _odd(right: Information) -> NDArray[np.bool_]:
    """Sensors (S,) whose readings small free corrections of the matrix, or a delay, explain better."""
    odd = np.zeros(right.n.shape[1], bool)
    for stretch in stretches(len(right.n)):
        part = right.part(stretch)
        free, same = fit(part, priors(ANYHOW, delay=True)), fit(part)
        gained = (free.likelihood - same.likelihood).sum(axis=0)
        most = np.maximum(gained - GAINED, free.evidence - same.evidence)
        odd |= most > HOPEFUL * free.repeats
    return odd


def _useless(as_it_is: Array, without: Array) -> NDArray[np.bool_]:
    """Sensors (S,) whose gyroscope explains little, of the likelihoods of their chains (G, S) with and without it: a large fault, or a hand that accelerates hard."""
    bad = (as_it_is - without < np.maximum(SUSPECT, -USEFUL * without)) & (as_it_is < -MOVED)
    return np.asarray(-(as_it_is * bad).sum(axis=0) / (1.0 + REPEATED * bad.sum(axis=0)) > LOST)


def _most_gained(quick: Array, gains: Array) -> float:
    """Log-likelihood that any sign, order, unit or gain gains in any stretch of chains (H, G); the readings as they are come first."""
    return max(best_stretch(each - quick[0])[0] for each in (*quick[1:], *gains[1:]))


def _discrete(
    own: Cells, right: Information, quick: Array, common: NDArray[np.intp]
) -> Iterator[Verdict]:
    """Signs, orders and units that fit best, of one sensor; `quick` (H, G) are their likelihoods without biases and lever arms."""
    faults, gain, as_it_is = discrete_faults(), quick - quick[0], fit(right).likelihood
    chains = len(as_it_is)
    usual = np.log([share_of(f.code) if f.code else 1.0 for f in faults])
    whole, best = (
        value + usual for value in (gain.sum(axis=1), np.array([best_stretch(g)[0] for g in gain]))
    )
    for k in sorted(
        {*np.argsort(-whole)[:CANDIDATES], *np.argsort(-best)[:CANDIDATES], *common} - {0}
    ):
        wrong = information_of(windows_of(own, faults[k].matrix))
        _, first, last = best_stretch((fit(wrong).likelihood - as_it_is)[:, 0])
        if last > first:
            stretch = slice(first, last)
            explained, none = fit(wrong.part(stretch)), fit(right.part(stretch))
            weight = _weight(faults[k].code, stretch, chains, chains * (chains + 1) / 2)
            evidence = _evidence(explained, none, explained.cost)
            yield Verdict(faults[k], (first, last), evidence, weight)


def _continuous(own: Cells, right: Information, gains: Array) -> Iterator[Verdict]:
    """Gains, cross-axis shares and delays, of one sensor, in every stretch; `gains` (starts, G) are likelihoods of the gains of STARTS."""
    chains = len(right.n)
    parts = stretches(chains)
    for stretch in parts:
        as_it_is, span = right.part(stretch), (stretch.start, stretch.stop)
        by_start = gains[:, stretch].sum(axis=1)
        is_hopeful = by_start.max() - by_start[0] > HOPEFUL
        begin = STARTS[int(np.argmax(by_start))] if is_hopeful else 1.0
        none = fit(as_it_is)
        for code, values, prior in FAMILIES:
            free = fit(as_it_is, prior)
            is_whole = stretch.stop - stretch.start == chains
            far = begin != 1.0 and (
                code == "gyroscope_gain" or (code == "gyroscope_axis_gain" and is_whole)
            )
            if free.evidence[0] <= none.evidence[0] and not far:
                continue
            weight = _weight(code, stretch, chains, len(parts))
            if code == "gyroscope_delay":
                late = Fault(code, (("delay", float(free.x[0, DELAY])),), IDENTITY)
                evidence = float((free.evidence[0] - none.evidence[0]) / free.repeats[0])
                yield Verdict(late, span, evidence, weight)
                continue
            at_gain = IDENTITY + (begin - 1.0) * _along(values)
            M, information = at_gain if far else IDENTITY + free.matrix[0], as_it_is
            for k in range(FURTHER):
                is_matrix = code == "gyroscope_matrix"
                if k >= ROUNDS and not (is_matrix and np.abs(M - IDENTITY).max() > FAR):
                    break
                information = information_of(windows_of(own, M, chains=stretch))
                step = fit(information, prior).matrix[0]
                if np.abs(step).max() < SMALL:
                    break
                M = M + step
            if _plausible(code, M):
                evidence = _evidence(fit(information), none, free.cost)
                yield Verdict(_corrected(code, values, M), span, evidence, weight)


FAMILIES = (
    ("gyroscope_gain", (), priors(GAIN)),
    *(("gyroscope_axis_gain", (("axis", AXES[k]),), priors(AXIS_GAINS[k])) for k in range(3)),
    ("gyroscope_delay", (), priors(delay=True)),
    ("gyroscope_matrix", (), priors(ANYHOW)),
)


def _along(values: tuple[tuple[str, float | str], ...]) -> Array:
    """Projection (3, 3) on the axis that a fault is of, else on all."""
    along = dict(values).get("axis")
    return IDENTITY if along is None else np.diag(IDENTITY[AXES.index(str(along))])


def _plausible(code: str, M: Array) -> bool:
    """Whether a free correction is what its family is for."""
    if code == "gyroscope_matrix":
        return bool(np.abs(M - IDENTITY).max() < LARGEST)
    return bool(np.diag(M).min() > LEAST_GAIN and np.diag(M).max() < 1 / LEAST_GAIN)


def _corrected(code: str, values: tuple[tuple[str, float | str], ...], M: Array) -> Fault:
    if code == "gyroscope_matrix":
        return Fault(code, (("percent", float(100 * np.abs(M - IDENTITY).max())),), M)
    along = dict(values).get("axis")
    gain = float(
        np.trace(M) / 3 if along is None else M[AXES.index(str(along)), AXES.index(str(along))]
    )
    return Fault(code, (*values, ("gain", 1.0 / gain)), M)


def _evidence(explained: Fit, none: Fit, cost: Array) -> float:
    """How much better the readings of one sensor are explained than by no fault; `cost` (1,) is that of the fault's corrections."""
    gained = explained.likelihood.sum(axis=0) + cost - none.evidence
    return float(gained[0] / max(explained.repeats[0], none.repeats[0]))


def _weight(code: str, stretch: slice, chains: int, looked_at: float) -> float:
    """What is expected of all faults and stretches to be just this one: half of it of the whole, the rest of all others looked at."""
    whole = stretch.stop - stretch.start == chains
    return share_of(code) * (0.5 if whole else 0.5 / max(looked_at - 1, 1))


def best_stretch(gain: Sequence[float] | Array) -> tuple[float, int, int]:
    """Largest sum of neighbouring gains (G,), and its first and behind its last; nothing where none is positive."""
    best, running, first = (0.0, 0, 0), 0.0, 0
    for k, value in enumerate(gain):
        if running <= 0:
            running, first = 0.0, k
        running += float(value)
        best = max(best, (running, first, k + 1))
    return best
