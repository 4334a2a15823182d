"""Sensors and strips that are late against what moves together with them, by correlation of angular rates: for gentle movement, and where the hand rests.

In      pairs of sensors (sensor_pairs.py)
Out     who is late, by how much, from when to when
Source  ours: sensors of one finger, and fingers that open and close the hand, turn at rates that are proportional to each other, less what the hand turns about
        the axis of flexion; test of a lag against none: paired_test.py
Limits  at least two other strips (of a single sensor four others, or the two others of its finger) have to move together and all to
        show the same lag; strips that move in turn, or each by itself, tell nothing. Lags below `LEAST` may be a person's own
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from handscope.estimators.fault_detection.neighbours import joint_windows, paired_test
from handscope.estimators.fault_detection.neighbours.delays import Delay
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

FURTHEST, STEP = 0.36, 0.02  # s
ONSET_SD = 0.02  # s, standard deviation of the onsets of fingers that a person moves together: assumed, no published figure was found
LEAST = (
    0.08  # s: 3.5 times that of one finger against two others, sqrt(1 + 1/2) ONSET_SD: 2 in 10 000
)
SPREAD = 0.03  # s, by which the lags against several others may differ
INCONSISTENT = (
    0.085  # s: 3 times sqrt(2) ONSET_SD, beyond which one coherent other contradicts the lag
)
NEAR_ZERO = 0.03  # s: lags that are none
FALSE_ALARM = 1e-3  # of all fingers of one recording
MARGIN = 0.4  # of the mean log ratio, as for delays (delays.py)
NOISE, GAIN_ERROR = (
    0.03,
    0.1,
)  # rad/s; share of a rate that is the finger's own: assumed
EXPLAINED = 0.2  # largest share of a rate's variance that stays unexplained at the lag
PREFILTER = 0.3  # the same without weights, for the quick test that comes first
SIGNIFICANT = 0.01  # p-value of the lag against one single other
PARTS = 8  # of the recording, at whose edges a lag may begin or end
FEWEST = 2  # others that have to confirm a strip's lag
FEWEST_OF_ONE = 4  # others that have to confirm that of a single sensor, but for the two others of its finger (_are_sufficient)
RESTING = 0.1  # largest share of a sensor's rate, root mean square in a window, that a resting hand has: a hand that turns shifts the phase of a rhythm
_Comparison = tuple[
    tuple[str, ...], list[tuple[str, ...]]
]  # a group, and the others that it is compared with
MOVING = 0.1  # rad/s, root mean square
FLEXING = 0.7  # cosine of the angle between the main axis and that of flexion, from which on the finger bends; ours
MISALIGNED = 0.1  # of the hand's rate, that it leaves about the axis of flexion: sensors 6 deg off
CLEAR = 3.0  # times that, from which on a finger bends by itself
TREMOR = 3.5  # Hz, from which on a rhythm is none that is meant: fingers tremble out of phase


@dataclass(frozen=True)
class _LagFit:
    """The lag of a group against one other group."""

    other: tuple[str, ...]
    lag: float  # s, at which it fits best
    rest: Array  # (lags, K) mean square residual of each window
    noise: Array  # (K,)
    variance: float  # of the group's rate, summed over the windows of the fit

    @cached_property
    def total(self) -> Array:
        """Misfit of each lag (lags,): logarithm of the residual, summed over the windows."""
        return np.asarray(np.log(self.rest + self.noise).sum(axis=1))


@dataclass(frozen=True)
class Signals:
    """Rates about each sensor's main axis, rad/s, in the chosen windows; a strip's are those of its last sensor, which turns with all joints."""

    lags: Array  # (L,) s
    now: dict[str, Array]  # by sensor (K, m)
    later: dict[str, Array]  # by sensor (L, K, m), read later by each lag
    t: Array  # (K,) s
    use: dict[str, Array]  # by sensor (K,)
    hand_leakage: dict[
        str, Array
    ]  # by sensor (K,) mean square rate that a hand that turns may leave
    flexing: frozenset[
        str
    ]  # sensors of fingers whose main axis is that of flexion, flexion being positive

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.now)

    def unexplained_shares(self, spans: Sequence[tuple[float, float]]) -> list[Array]:
        """Share (S, L, S) of each sensor's variance, read later by a lag, that each sensor's rate leaves within each span."""
        use = np.array([self.use[s] for s in self.names])
        now = np.array([self.now[s] for s in self.names])
        later = np.array([self.later[s] for s in self.names])
        edges = np.unique(spans)  # the sums of a part between two are those of many spans
        rows = np.searchsorted(self.t, edges)
        parts = [
            _second_moments(later[:, :, a:b], now[:, a:b], use[:, a:b]) for a, b in pairwise(rows)
        ]
        return [
            _unexplained_share(*(np.sum(each, axis=0) for each in zip(*parts[slice(*which)])))
            for which in np.searchsorted(edges, spans)
        ]


def _second_moments(later: Array, now: Array, use: Array) -> tuple[Array, Array, Array]:
    """Sums over the windows that both sensors of a pair have: of the product (S, L, S) of one rate later by a lag with the other, and of the squares (S, L, S), (S, 1, S)."""
    S, L = later.shape[:2]
    product = (later * use[:, None, :, None]).reshape(S * L, -1) @ (
        (now * use[..., None]).reshape(S, -1).T
    )
    of_later = ((later**2).sum(axis=3) * use[:, None]).reshape(S * L, -1) @ use.T
    of_now = use @ ((now**2).sum(axis=2) * use).T
    return product.reshape(S, L, S), of_later.reshape(S, L, S), of_now[:, None]


def _unexplained_share(product: Array, later: Array, now: Array) -> Array:
    return np.asarray(1.0 - product**2 / np.maximum(later * now, 1e-12))


def find(signals: Signals | None, faulty: Sequence[str] = ()) -> list[Delay]:
    """Late sensors of fingers, else late strips, with the probability of such lags if nothing is late.

    Fingers with a sensor that is known to be faulty are left out.
    """
    if signals is None:
        return []
    free = {
        f: tuple(s for s in chain if s in signals.now)
        for f, chain in CHAINS.items()
        if not set(chain) & set(faulty)
    }
    alone: list[_Comparison] = [
        ((s,), [(o,) for o in chain if o != s] + [c for c in free.values() if c and c is not chain])
        for chain in free.values()
        for s in chain
    ]
    spans = _spans(signals.t)
    unexplained = signals.unexplained_shares(spans)
    single = _best_spans(signals, alone, spans, unexplained)
    odd = {s.partition("_")[0] for d in single for s in d.sensors}
    strips = [c for f, c in free.items() if c and f not in odd]
    together: list[_Comparison] = [
        (strip, [o for o in strips if o is not strip]) for strip in strips
    ]
    return [*single, *_best_spans(signals, together, spans, unexplained)]


def comparable_fingers(signals: Signals | None, lags: Sequence[float]) -> list[str]:
    """Fingers whose strip moves together with enough others for these lags (s) to show: a rhythm looks the same half a period later, but for its sign."""
    if signals is None:
        return []
    last = {f: chain[-1] for f, chain in CHAINS.items() if set(chain) <= set(signals.names)}
    (whole,) = signals.unexplained_shares(_spans(signals.t)[:1])
    in_time = np.abs(signals.lags[whole.argmin(axis=1)]) < LEAST - SPREAD
    at_lags = [int(np.argmin(np.abs(signals.lags - lag))) for lag in lags]
    left = np.log(whole + GAIN_ERROR**2)
    differs = (left[:, at_lags].min(axis=1) - left.min(axis=1)) > 2 * MARGIN
    coherent = (whole.min(axis=1) < PREFILTER) & in_time & differs
    columns = [signals.names.index(s) for s in last.values()]
    enough = coherent[columns][:, columns].sum(axis=1) - 1 >= FEWEST
    return [finger for finger, is_enough in zip(last, enough) if is_enough]


def signals_of(pairs: Pairs) -> Signals | None:
    """Rates of what bends, for several checks of one recording; None where there is too little of them, or no hand's."""
    if "hand" not in pairs.series.sensors:
        return None
    signals = _signals(pairs)
    return signals if signals.now and len(signals.t) >= paired_test.FEWEST else None


def _signals(pairs: Pairs) -> Signals:
    s = pairs.series
    m, by = round(joint_windows.LENGTH * joint_windows.RATE), joint_windows.AVERAGED
    names = [n for chain in CHAINS.values() for n in chain if n in s.sensors]
    hand = s.gyr[:, s.sensors.index("hand")]
    steps = round(FURTHEST / STEP)
    lags = STEP * np.arange(-steps, steps + 1, dtype=float)
    shift = np.round(lags * joint_windows.RATE).astype(int)
    first = s.chosen[
        (s.chosen * m + shift[0] >= 0) & (s.chosen * m + m + shift[-1] + by < len(s.t))
    ]
    rows = first[:, None] * m + np.arange(0, m, by)
    now, later, use, hand_leakage, flexing = {}, {}, {}, {}, set()
    about_z = _about_z(pairs, "hand", by)
    of_hand = np.sqrt((hand[rows] ** 2).sum(axis=2).mean(axis=1))
    for name in names:
        k = s.sensors.index(name)
        gyr = s.gyr[:, k]
        seen = gyr[(first[:, None] * m + np.arange(m)).ravel()]
        axis = np.linalg.eigh(seen.T @ seen)[1][:, -1]
        along = float(quat.rotate(pairs.q_BS[name], axis)[2])  # segments flex about z
        if abs(along) > FLEXING and not name.startswith("thumb"):
            flexing.add(name)
            axis = np.sign(along) * axis
        rate = np.convolve(gyr @ axis, np.full(by, 1.0 / by), "full")[by - 1 :]
        now[name], later[name] = rate[rows], rate[rows + shift[:, None, None]]
        there = s.whole[rows, k].mean(axis=1) > 1 - joint_windows.MOST_MISSING
        own = np.sqrt((gyr[rows] ** 2).sum(axis=2).mean(axis=1))
        rests = of_hand < RESTING * own
        use[name], hand_leakage[name] = (there & rests).astype(float), np.zeros(len(rows))
        if not name.startswith("thumb") and np.count_nonzero(there & rests) < 0.5 * len(rows):
            flexing.add(name)
            rate = _about_z(pairs, name, by)
            now[name] = rate[rows] - about_z[rows]
            later[name] = rate[rows + shift[:, None, None]] - about_z[rows]
            use[name], hand_leakage[name] = there.astype(float), (MISALIGNED * of_hand) ** 2
    return Signals(lags, now, later, s.t[first * m], use, hand_leakage, frozenset(flexing))


def _about_z(pairs: Pairs, name: str, by: int) -> Array:
    """Rate (n,) of a segment about its axis of flexion, averaged over `by` samples: a finger that bends keeps that axis in the hand, too."""
    s = pairs.series
    axis = quat.rotate(quat.conjugate(pairs.q_BS[name]), np.array([0.0, 0.0, 1.0]))
    return np.asarray(
        np.convolve(s.gyr[:, s.sensors.index(name)] @ axis, np.full(by, 1.0 / by), "full")[by - 1 :]
    )


def _spans(t: Array) -> list[tuple[float, float]]:
    if len(t) == 0:
        return []
    begin, end = float(t[0]), float(t[-1]) + joint_windows.LENGTH
    edges = [float(e) for e in np.linspace(begin, end, PARTS + 1)[1:-1]]
    return [(begin, end), *((e, end) for e in edges), *((begin, e) for e in edges)]


def _best_spans(
    signals: Signals,
    groups: Sequence[_Comparison],
    spans: Sequence[tuple[float, float]],
    unexplained: Sequence[Array],
) -> list[Delay]:
    """The span with the clearest lag of each group that has one; `unexplained` shares of each."""
    tests = len(groups) * round(2 * FURTHEST / LEAST)  # lags nearer are one
    found = []
    for group, others in groups:
        own, *columns = (signals.names.index(g[-1]) for g in (group, *others))
        tried = [
            _test_span(signals, group, others, span)
            for span, rest in zip(spans, unexplained)
            if _may_have_lag(signals.lags, rest[own][:, columns], group, others)
        ]
        sure = [d for d in tried if d is not None]
        if sure:
            best = max(sure, key=lambda d: d.gain)
            nearer = [
                _test_span(signals, group, others, s) for s in _refined_spans(signals, others, best)
            ]
            best = min([best, *(d for d in nearer if d is not None)], key=lambda d: d.p_value)
            others_looked_at = len(spans) + 1  # half of what is expected is expected of the whole
            p = best.p_value * tests * 2 * (1 if best.span == spans[0] else others_looked_at)
            p = min(1.0, p)
            found.append(Delay(group, best.late, p, best.gain, best.span))
    return found


def _refined_spans(
    signals: Signals, others: list[tuple[str, ...]], found: Delay
) -> Iterator[tuple[float, float]]:
    """The two parts of a span, from some window on and up to some window, that gain most by the lag."""
    inside = ((signals.t >= found.span[0]) & (signals.t < found.span[1])).astype(float)
    k, zero = int(np.argmin(abs(signals.lags - found.late))), len(signals.lags) // 2
    fits = [s for o in others if (s := _fit_lag(signals, found.sensors, o, inside)) is not None]
    gain = np.sum([np.log((s.rest[zero] + s.noise) / (s.rest[k] + s.noise)) for s in fits], axis=0)
    after, until = np.cumsum(gain[::-1])[::-1], np.cumsum(gain)
    yield float(signals.t[int(np.argmax(after))]), found.span[1]
    yield found.span[0], float(signals.t[int(np.argmax(until))]) + joint_windows.LENGTH


def _may_have_lag(
    lags: Array, unexplained: Array, group: tuple[str, ...], others: Sequence[tuple[str, ...]]
) -> bool:
    """Whether enough others explain the rate of a group within a span (`unexplained` shares (L, others) of it), and best with a lag."""
    lag = np.abs(lags[unexplained.argmin(axis=0)])
    coherent = (unexplained.min(axis=0) < PREFILTER) & (lag >= LEAST - SPREAD)
    return _are_sufficient(group, [o for o, tells in zip(others, coherent) if tells])


def _are_sufficient(group: tuple[str, ...], coherent: Sequence[tuple[str, ...]]) -> bool:
    """Whether these others are sufficient evidence that a group is late.

    The two other sensors of a finger suffice for its middle and distal one: joints that follow each other put the sensors off in the order in which they lie,
    a middle segment never behind both its neighbours, and a distal one by a quarter of what its joint is late. A proximal segment that follows may be the person's.
    """
    if len(group) > 1:
        return len(coherent) >= FEWEST
    (sensor,) = group
    own = [o for o in coherent if o[0].partition("_")[0] == sensor.partition("_")[0]]
    is_outer = sensor.endswith(("_middle", "_distal")) and not sensor.startswith("thumb")
    return len(coherent) >= FEWEST_OF_ONE or (is_outer and len(own) >= 2)


def _test_span(
    signals: Signals,
    group: tuple[str, ...],
    others: list[tuple[str, ...]],
    span: tuple[float, float],
) -> Delay | None:
    """The lag of a group within a span that enough others confirm and none contradicts."""
    inside = ((signals.t >= span[0]) & (signals.t < span[1])).astype(float)
    fits = [s for o in others if (s := _fit_lag(signals, group, o, inside)) is not None]
    coherent = [s for s in fits if _least_residual(s).sum() < EXPLAINED * s.variance]
    if not coherent:
        return None
    consensus = _consensus_lag(np.array([s.lag for s in coherent]))
    coherent = [s for s in coherent if not _is_half_a_period_off(signals, group, s, consensus)]
    lags = np.array([s.lag for s in coherent])
    if (
        not _are_sufficient(group, [s.other for s in coherent])
        or np.any(np.sign(lags) != np.sign(lags[0]))
        or abs(lags).min() < LEAST - SPREAD
    ):
        return None
    late = _consensus_lag(lags)
    near = [s for s in coherent if abs(s.lag - late) <= SPREAD + 1e-9]
    if (
        not _are_sufficient(group, [s.other for s in near])
        or abs(lags - late).max() > INCONSISTENT + 1e-9
    ):
        return None
    if not LEAST - 1e-9 <= abs(late) <= FURTHEST - STEP:
        return None
    k = int(np.argmin(abs(signals.lags - late)))
    gains = [_paired_gain(signals.lags, s, k) for s in near]
    significant = [paired_test.p_value(g, MARGIN, w) < SIGNIFICANT for g, w in gains]
    if not _are_sufficient(
        group, [s.other for s, is_significant in zip(near, significant) if is_significant]
    ):
        return None
    gain, weight = np.mean([g for g, _ in gains], axis=0), np.max([w for _, w in gains], axis=0)
    p = paired_test.p_value(gain, MARGIN, weight)
    return Delay(group, float(late), p, float(gain @ (weight > 0)) * len(near), span)


def _is_half_a_period_off(
    signals: Signals, group: tuple[str, ...], fit: _LagFit, lag: float
) -> bool:
    """Whether another lag explains a rhythm as well with the other sign, where the sign is not known: such a fit neither confirms the lag nor contradicts it."""
    if {group[-1], fit.other[-1]} <= signals.flexing or abs(fit.lag - lag) <= SPREAD + 1e-9:
        return False
    rest = fit.rest[int(np.argmin(abs(signals.lags - lag)))]
    return bool(rest.sum() < EXPLAINED * fit.variance) and np.sign(fit.lag) != np.sign(lag)


def _consensus_lag(lags: Array) -> float:
    """The lag about which most others lie."""
    count = [np.count_nonzero(abs(lags - lag) <= SPREAD + 1e-9) for lag in lags]
    best = lags[int(np.argmax(count))]
    return float(lags[abs(lags - best) <= SPREAD + 1e-9].mean())


def _fit_lag(
    signals: Signals, group: tuple[str, ...], other: tuple[str, ...], inside: Array
) -> _LagFit | None:
    """Residual of a group's rate after regression on another group's, at every lag; None where either hardly moves, or trembles."""
    use = (inside * np.prod([signals.use[s] for s in (*group, *other)], axis=0)).astype(bool)
    if np.count_nonzero(use) < paired_test.FEWEST:
        return None
    x, Y = signals.now[other[-1]][use].ravel(), signals.later[group[-1]][:, use]
    variance, of_other = float((Y**2).mean()), float(x @ x / len(x))
    speed = 2 * np.pi * _frequency(Y[len(Y) // 2])  # rad/s of the rhythm
    turned = np.maximum(signals.hand_leakage[group[-1]], signals.hand_leakage[other[-1]])
    moving = max(MOVING**2, CLEAR**2 * float(turned[use].mean()))
    if min(variance, of_other) < moving or speed > 2 * np.pi * TREMOR:
        return None
    flat = Y.reshape(len(Y), -1)
    share = flat @ x / (x @ x)
    if group[-1] in signals.flexing and other[-1] in signals.flexing:
        share = np.maximum(share, 0.0)  # what moves together bends together
    residual = ((flat - share[:, None] * x) ** 2).reshape(Y.shape).mean(axis=2)
    noise = NOISE**2 + (GAIN_ERROR**2 + (0.5 * STEP * speed) ** 2) * variance + turned
    rest = np.zeros((len(Y), len(use)))
    rest[:, use] = residual
    total = np.log(residual + noise[use]).sum(axis=1)
    of_group = float((signals.now[group[-1]][use] ** 2).mean(axis=1).sum())
    return _LagFit(other, float(signals.lags[int(np.argmin(total))]), rest, noise, of_group)


def _frequency(rate: Array) -> float:
    """Mean frequency, Hz, of a rate in windows (K, m)."""
    dt = joint_windows.AVERAGED / joint_windows.RATE
    return float(np.sqrt(np.mean(np.diff(rate) ** 2) / np.mean(rate**2)) / (2 * np.pi * dt))


def _least_residual(fits: _LagFit) -> Array:
    return np.asarray(fits.rest[int(np.argmin(fits.total))])


def _paired_gain(lags: Array, fits: _LagFit, k: int) -> tuple[Array, Array]:
    """Log ratio by window of the residuals without a lag and with it, and the weights of the windows; the nearest minimum of a rhythm counts as no lag."""
    none = [i for i in range(1, len(lags) - 1) if _counts_as_zero(lags, fits.total, i)]
    least = min(none, key=lambda i: fits.total[i])
    before, after = fits.rest[least], fits.rest[k]
    gain = paired_test.log_rest(before, np.full_like(before, fits.noise)) - paired_test.log_rest(
        after, np.full_like(after, fits.noise)
    )
    return gain, paired_test.weight(before, after, np.full_like(before, fits.noise))


def _counts_as_zero(lags: Array, total: Array, i: int) -> bool:
    is_valley = total[i] <= min(total[i - 1], total[i + 1])
    return bool(abs(lags[i]) <= NEAR_ZERO or (is_valley and abs(lags[i]) < LEAST))
