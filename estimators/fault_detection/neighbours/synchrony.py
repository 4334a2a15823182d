"""Sensors and strips that are late against what moves together with them, told by angular rates: for gentle movement, and where the hand rests.

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
OWN_SD = 0.02  # s, standard deviation of when fingers begin that a person moves together; ours
LEAST = (
    0.08  # s: 3.5 times that of one finger against two others, sqrt(1 + 1/2) OWN_SD: 2 in 10 000
)
SPREAD = 0.03  # s, by which others may differ in the lag that they show
FAR = 0.085  # s: 3 times sqrt(2) OWN_SD, by which none that tells a lag may differ
NEAR_ZERO = 0.03  # s: lags that are none
FALSE_ALARM = 1e-3  # of all fingers of one recording
MARGIN = 0.4  # of the mean log ratio, as for delays (delays.py)
NOISE, SHARE = (
    0.03,
    0.1,
)  # rad/s; of a rate that others do not tell, as fingers bend each a little by itself: ours
EXPLAINED = 0.2  # share of a rate's variance that others may leave at the lag
SOME = 0.3  # the same before windows are weighed: from here on it is looked at
SURE = 0.01  # probability from which on one other is counted as showing the lag, or as showing none
PARTS = 8  # of the recording, at whose edges a lag may begin or end
FEWEST = 2  # others that show a strip's lag
FEWEST_OF_ONE = (
    4  # others that show a single sensor's, but for the two others of its finger (_are_enough)
)
RESTING = 0.1  # of a sensor's rate, root mean square in a window, up to which the hand's is rest: what it turns shifts the phase of a rhythm
_Asked = tuple[
    tuple[str, ...], list[tuple[str, ...]]
]  # a group, and the others of which each may tell its lag
MOVING = 0.1  # rad/s, root mean square
FLEXING = 0.7  # cosine of the angle between the main axis and that of flexion, from which on the finger bends; ours
MISALIGNED = 0.1  # of the hand's rate, that it leaves about the axis of flexion: sensors 6 deg off
CLEAR = 3.0  # times that, from which on a finger bends by itself
TREMOR = 3.5  # Hz, from which on a rhythm is none that is meant: fingers tremble out of phase


@dataclass(frozen=True)
class _Shown:
    """What one other tells of a group's lag."""

    other: tuple[str, ...]
    lag: float  # s, at which it fits best
    rest: Array  # (lags, K) what it leaves in each window
    noise: Array  # (K,)
    variance: float  # of the group's rate, summed over the windows that were asked

    @cached_property
    def total(self) -> Array:
        """How badly each lag fits (lags,): the logarithm of what it leaves, summed over the windows."""
        return np.asarray(np.log(self.rest + self.noise).sum(axis=1))


@dataclass(frozen=True)
class _Signals:
    """Rates about each sensor's main axis, rad/s, in the windows that are looked at; a strip's are those of its last sensor, which turns with all joints."""

    lags: Array  # (L,) s
    now: dict[str, Array]  # by sensor (K, m)
    later: dict[str, Array]  # by sensor (L, K, m), read later by each lag
    t: Array  # (K,) s
    use: dict[str, Array]  # by sensor (K,)
    leak: dict[str, Array]  # by sensor (K,) mean square rate that a hand that turns may leave
    flexing: frozenset[
        str
    ]  # sensors of fingers whose main axis is that of flexion, flexion being positive

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.now)

    def left(self, spans: Sequence[tuple[float, float]]) -> list[Array]:
        """Share (S, L, S) of each sensor's variance, read later by a lag, that each sensor's rate leaves within each span."""
        use = np.array([self.use[s] for s in self.names])[..., None]
        now = np.array([self.now[s] for s in self.names]) * use
        later = np.array([self.later[s] for s in self.names]) * use[:, None]
        edges = np.unique(spans)  # the sums of a part between two are those of many spans
        rows = np.searchsorted(self.t, edges)
        parts = [_sums(later[:, :, a:b], now[:, a:b]) for a, b in pairwise(rows)]
        return [
            _share_left(*(np.sum(each, axis=0) for each in zip(*parts[slice(*which)])))
            for which in np.searchsorted(edges, spans)
        ]


def _sums(later: Array, now: Array) -> tuple[Array, Array, Array]:
    """Sums over windows of products of rates: (S, L, S) later by a lag and now, (S, L) later, (S,) now."""
    S, L = later.shape[:2]
    product = later.reshape(S * L, -1) @ now.reshape(S, -1).T
    return product.reshape(S, L, S), (later**2).sum(axis=(2, 3)), (now**2).sum(axis=(1, 2))


def _share_left(product: Array, later: Array, now: Array) -> Array:
    return np.asarray(1.0 - product**2 / np.maximum(later[..., None] * now, 1e-12))


def find(pairs: Pairs, accused: Sequence[str] = ()) -> list[Delay]:
    """Late sensors of fingers, else late strips, with the probability of such lags where nothing is late.

    Fingers of sensors that are accused already are not asked.
    """
    if "hand" not in pairs.series.sensors:
        return []
    signals = _signals(pairs)
    if len(signals.t) < paired_test.FEWEST or not signals.now:
        return []
    free = {
        f: tuple(s for s in chain if s in signals.now)
        for f, chain in CHAINS.items()
        if not set(chain) & set(accused)
    }
    alone: list[_Asked] = [
        ((s,), [(o,) for o in chain if o != s] + [c for c in free.values() if c and c is not chain])
        for chain in free.values()
        for s in chain
    ]
    spans = _spans(signals.t)
    left = signals.left(spans)
    single = _latest(signals, alone, spans, left)
    odd = {s.partition("_")[0] for d in single for s in d.sensors}
    strips = [c for f, c in free.items() if c and f not in odd]
    together: list[_Asked] = [(strip, [o for o in strips if o is not strip]) for strip in strips]
    return [*single, *_latest(signals, together, spans, left)]


def _signals(pairs: Pairs) -> _Signals:
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
    now, later, use, leak, flexing = {}, {}, {}, {}, set()
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
        use[name], leak[name] = (there & rests).astype(float), np.zeros(len(rows))
        if not name.startswith("thumb") and np.count_nonzero(there & rests) < 0.5 * len(rows):
            flexing.add(name)
            rate = _about_z(pairs, name, by)
            now[name] = rate[rows] - about_z[rows]
            later[name] = rate[rows + shift[:, None, None]] - about_z[rows]
            use[name], leak[name] = there.astype(float), (MISALIGNED * of_hand) ** 2
    return _Signals(lags, now, later, s.t[first * m], use, leak, frozenset(flexing))


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


def _latest(
    signals: _Signals,
    groups: Sequence[_Asked],
    spans: Sequence[tuple[float, float]],
    left: Sequence[Array],
) -> list[Delay]:
    """Of each group the span that shows a lag best, where one does; `left` of each span."""
    tests = len(groups) * round(2 * FURTHEST / LEAST)  # lags nearer are one
    found = []
    for group, others in groups:
        tried = [
            _judged(signals, group, others, span)
            for span, rest in zip(spans, left)
            if _shows_a_lag(signals, rest, group, others)
        ]
        sure = [d for d in tried if d is not None]
        if sure:
            best = max(sure, key=lambda d: d.gain)
            nearer = [_judged(signals, group, others, s) for s in _begun(signals, others, best)]
            best = min([best, *(d for d in nearer if d is not None)], key=lambda d: d.p_value)
            others_looked_at = len(spans) + 1  # half of what is expected is expected of the whole
            p = best.p_value * tests * 2 * (1 if best.span == spans[0] else others_looked_at)
            p = min(1.0, p)
            found.append(Delay(group, best.late, p, best.gain, best.span))
    return found


def _begun(
    signals: _Signals, others: list[tuple[str, ...]], found: Delay
) -> Iterator[tuple[float, float]]:
    """The part of a span from the window on, and that up to the window, which gains most by the lag."""
    inside = ((signals.t >= found.span[0]) & (signals.t < found.span[1])).astype(float)
    k, zero = int(np.argmin(abs(signals.lags - found.late))), len(signals.lags) // 2
    shown = [s for o in others if (s := _shown(signals, found.sensors, o, inside)) is not None]
    gain = np.sum([np.log((s.rest[zero] + s.noise) / (s.rest[k] + s.noise)) for s in shown], axis=0)
    after, until = np.cumsum(gain[::-1])[::-1], np.cumsum(gain)
    yield float(signals.t[int(np.argmax(after))]), found.span[1]
    yield found.span[0], float(signals.t[int(np.argmax(until))]) + joint_windows.LENGTH


def _shows_a_lag(
    signals: _Signals, left: Array, group: tuple[str, ...], others: Sequence[tuple[str, ...]]
) -> bool:
    """Whether enough others tell the rate of a group within a span (`left` of it), and best with a lag."""
    own = signals.names.index(group[-1])
    of_others = left[own][:, [signals.names.index(o[-1]) for o in others]]
    lag = np.abs(signals.lags[of_others.argmin(axis=0)])
    telling = (of_others.min(axis=0) < SOME) & (lag >= LEAST - SPREAD)
    return _are_enough(group, [o for o, tells in zip(others, telling) if tells])


def _are_enough(group: tuple[str, ...], telling: Sequence[tuple[str, ...]]) -> bool:
    """Whether these others suffice to tell that a group is late.

    The two other sensors of a finger suffice for its middle and distal one: joints that follow each other put the sensors off in the order in which they lie,
    a middle segment never behind both its neighbours, and a distal one by a quarter of what its joint is late. A proximal segment that follows may be the person's.
    """
    if len(group) > 1:
        return len(telling) >= FEWEST
    (sensor,) = group
    own = [o for o in telling if o[0].partition("_")[0] == sensor.partition("_")[0]]
    is_outer = sensor.endswith(("_middle", "_distal")) and not sensor.startswith("thumb")
    return len(telling) >= FEWEST_OF_ONE or (is_outer and len(own) >= 2)


def _judged(
    signals: _Signals,
    group: tuple[str, ...],
    others: list[tuple[str, ...]],
    span: tuple[float, float],
) -> Delay | None:
    """The lag of a group within a span that enough others show and none contradicts."""
    inside = ((signals.t >= span[0]) & (signals.t < span[1])).astype(float)
    shown = [s for o in others if (s := _shown(signals, group, o, inside)) is not None]
    telling = [s for s in shown if _least(s).sum() < EXPLAINED * s.variance]
    lags = np.array([s.lag for s in telling])
    if (
        not _are_enough(group, [s.other for s in telling])
        or np.any(np.sign(lags) != np.sign(lags[0]))
        or abs(lags).min() < LEAST - SPREAD
    ):
        return None
    late = _shared_lag(lags)
    near = [s for s in telling if abs(s.lag - late) <= SPREAD + 1e-9]
    if not _are_enough(group, [s.other for s in near]) or abs(lags - late).max() > FAR + 1e-9:
        return None
    if not LEAST - 1e-9 <= abs(late) <= FURTHEST - STEP:
        return None
    k = int(np.argmin(abs(signals.lags - late)))
    gains = [_gain(signals.lags, s, k) for s in near]
    surely = [paired_test.p_value(g, MARGIN, w) < SURE for g, w in gains]
    if not _are_enough(group, [s.other for s, is_sure in zip(near, surely) if is_sure]):
        return None
    gain, weight = np.mean([g for g, _ in gains], axis=0), np.max([w for _, w in gains], axis=0)
    p = paired_test.p_value(gain, MARGIN, weight)
    return Delay(group, float(late), p, float(gain @ (weight > 0)) * len(near), span)


def _shared_lag(lags: Array) -> float:
    """The lag about which most others lie."""
    count = [np.count_nonzero(abs(lags - lag) <= SPREAD + 1e-9) for lag in lags]
    best = lags[int(np.argmax(count))]
    return float(lags[abs(lags - best) <= SPREAD + 1e-9].mean())


def _shown(
    signals: _Signals, group: tuple[str, ...], other: tuple[str, ...], inside: Array
) -> _Shown | None:
    """What another group's rate leaves of a group's at every lag; None where either hardly moves, or trembles."""
    use = (inside * np.prod([signals.use[s] for s in (*group, *other)], axis=0)).astype(bool)
    if np.count_nonzero(use) < paired_test.FEWEST:
        return None
    x, Y = signals.now[other[-1]][use].ravel(), signals.later[group[-1]][:, use]
    variance, of_other = float((Y**2).mean()), float(x @ x / len(x))
    speed = 2 * np.pi * _frequency(Y[len(Y) // 2])  # rad/s of the rhythm
    turned = np.maximum(signals.leak[group[-1]], signals.leak[other[-1]])
    moving = max(MOVING**2, CLEAR**2 * float(turned[use].mean()))
    if min(variance, of_other) < moving or speed > 2 * np.pi * TREMOR:
        return None
    flat = Y.reshape(len(Y), -1)
    share = flat @ x / (x @ x)
    if group[-1] in signals.flexing and other[-1] in signals.flexing:
        share = np.maximum(share, 0.0)  # what moves together bends together
    left = ((flat - share[:, None] * x) ** 2).reshape(Y.shape).mean(axis=2)
    noise = NOISE**2 + (SHARE**2 + (0.5 * STEP * speed) ** 2) * variance + turned
    rest = np.zeros((len(Y), len(use)))
    rest[:, use] = left
    total = np.log(left + noise[use]).sum(axis=1)
    of_group = float((signals.now[group[-1]][use] ** 2).mean(axis=1).sum())
    return _Shown(other, float(signals.lags[int(np.argmin(total))]), rest, noise, of_group)


def _frequency(rate: Array) -> float:
    """Mean frequency, Hz, of a rate in windows (K, m)."""
    dt = joint_windows.AVERAGED / joint_windows.RATE
    return float(np.sqrt(np.mean(np.diff(rate) ** 2) / np.mean(rate**2)) / (2 * np.pi * dt))


def _least(shown: _Shown) -> Array:
    return np.asarray(shown.rest[int(np.argmin(shown.total))])


def _gain(lags: Array, shown: _Shown, k: int) -> tuple[Array, Array]:
    """How much better (mean log ratio by window) the lag explains than none does, and how much each window tells; a rhythm's other lag near zero counts as none."""
    none = [i for i in range(1, len(lags) - 1) if _is_none(lags, shown.total, i)]
    least = min(none, key=lambda i: shown.total[i])
    before, after = shown.rest[least], shown.rest[k]
    gain = paired_test.log_rest(before, np.full_like(before, shown.noise)) - paired_test.log_rest(
        after, np.full_like(after, shown.noise)
    )
    return gain, paired_test.weight(before, after, np.full_like(before, shown.noise))


def _is_none(lags: Array, total: Array, i: int) -> bool:
    is_valley = total[i] <= min(total[i - 1], total[i + 1])
    return bool(abs(lags[i]) <= NEAR_ZERO or (is_valley and abs(lags[i]) < LEAST))
