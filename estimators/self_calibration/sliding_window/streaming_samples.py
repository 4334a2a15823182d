"""Even readings of all sensors while they come, as sample_preparation.py makes them of whole streams.

In      inertial blocks in order, cut anywhere; an instant that every stream that is not silent has reached
Out     Nodes at about 100 Hz
Limits  gaps are bridged by straight lines up to a longest; behind that a sensor is lost until it is back
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, Block, Stream, every
from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.self_calibration.sample_preparation import DOUBTFUL, RATE
from handscope.estimators.sensors.mean_readings import correct_means

ROUNDED = 1e-6  # of a period
SILENT = 2.0  # s
KEPT = 1.0  # s of samples behind the last node: more than a gap that is bridged


@dataclass(frozen=True)
class Nodes:
    """By segment; NaN where no sensor."""

    t: Array  # (m,) s
    values: Array  # (m, segments, 6) rad/s, m/s^2
    doubt: Array  # (m, segments, 2) factors on the noise that gyroscope and accelerometer have in a sample at RATE
    lost: Bools  # (m, segments) silent for longer than can be bridged, or not worn


@dataclass(frozen=True)
class PendingSamples:
    """Samples of a stream that may be needed again."""

    stream: Stream
    t: Array  # (n,) s
    values: Array  # (n, sensors, 6)
    sound: Bools  # (n, sensors) whole, and the gyroscope not at its limit
    clipped: Bools  # (n, sensors) the accelerometer is at its limit


@dataclass(frozen=True)
class State:
    """Samples that wait to become even readings."""

    reference: str  # stream whose samples set the pace
    period: float  # s between readings that are averaged
    each: int  # of how many a node is the mean
    begin: float = np.inf  # s, of the first reading
    taken: int = 0  # nodes so far
    waiting: Mapping[str, PendingSamples] = field(default_factory=dict)

    def instants(self, first: int, stop: int) -> Array:
        """Of nodes first to stop - 1, s."""
        return np.asarray(
            self.begin + self.period * (np.arange(first, stop) * self.each + 0.5 * (self.each - 1))
        )


def start(reference: Stream) -> State:
    """Nodes at the pace of a stream, from its first sample on."""
    return State(reference.name, 1 / reference.rate, max(1, round(reference.rate / RATE)))


def store_block(state: State, block: Block) -> State:
    """Keep a block until its nodes are asked for."""
    if not block.stream.inertial or not len(block.t):
        return state
    gyr, acc = block.of(GYR), block.of(ACC)
    sound = every(np.isfinite(gyr)) & every(np.isfinite(acc)) & ~block.at_limit(GYR)
    new = PendingSamples(
        block.stream, block.t, np.concatenate([gyr, acc], axis=2), sound, block.at_limit(ACC)
    )
    before = state.waiting.get(block.stream.name)
    if before is not None and before.stream == block.stream:
        new = PendingSamples(
            block.stream,
            np.concatenate([before.t, new.t]),
            np.concatenate([before.values, new.values]),
            np.concatenate([before.sound, new.sound]),
            np.concatenate([before.clipped, new.clipped]),
        )
    begin = (
        float(block.t[0])
        if block.stream.name == state.reference and not np.isfinite(state.begin)
        else state.begin
    )
    new = new if np.isfinite(begin) else _prune(new, float(block.t[-1]))
    return replace(state, begin=begin, waiting={**state.waiting, block.stream.name: new})


def count_ready(state: State, reached: float) -> int:
    """Number of nodes that are complete when every stream has `reached` an instant: a mean needs the next one, too."""
    if not reached > state.begin:
        return 0
    return max(
        0,
        int(np.floor((reached - state.begin) / state.period + ROUNDED) / state.each)
        - _neighbours_of_mean(state)
        - state.taken,
    )


def resume(state: State, t: float) -> State:
    """Behind a silence of all streams nodes go on at t (s), where that is more than SILENT later than the next."""
    nodes = int((t - state.begin) / (state.period * state.each)) if t > state.begin + SILENT else 0
    return (
        replace(state, taken=nodes)
        if (nodes - state.taken) * state.period * state.each > SILENT
        else state
    )


def take_nodes(state: State, count: int, max_gap: float) -> tuple[State, Nodes]:
    """The next nodes; a sensor silent for longer than `max_gap` s is lost until it is back."""
    beside = _neighbours_of_mean(state)
    first, n = (state.taken - beside) * state.each, (count + 2 * beside) * state.each
    grid = np.asarray(state.begin + state.period * (first + np.arange(n)), float)
    values, doubt = np.full((n, len(SEGMENTS), 6), np.nan), np.ones((n, len(SEGMENTS), 2))
    lost = np.ones((n, len(SEGMENTS)), bool)
    for w in state.waiting.values():
        for k, name in enumerate(w.stream.sensors):
            if name in SEGMENT:
                s = SEGMENT[name]
                values[:, s], doubt[:, s], lost[:, s] = _resample_sensor(
                    w, k, grid, state.period, max_gap
                )
    noisier = 1 / np.sqrt(state.each * state.period * RATE)
    own = slice(beside, beside + count)
    means, doubts = (
        v.reshape(count + 2 * beside, state.each, *v.shape[1:]).mean(axis=1)
        for v in (values, doubt)
    )
    gone = np.asarray(lost.reshape(count + 2 * beside, state.each, -1).any(axis=1))
    nodes = Nodes(
        state.instants(state.taken, state.taken + count),
        _correct_means(means, gone, state.each)[own],
        noisier * doubts[own],
        gone[own],
    )
    kept = {name: _prune(w, float(grid[-1])) for name, w in state.waiting.items()}
    return replace(state, taken=state.taken + count, waiting=kept), nodes


def _neighbours_of_mean(state: State) -> int:
    """Nodes on either side of a mean that tell how the signal bends."""
    return int(state.each > 1)


def _correct_means(means: Array, lost: Bools, each: int) -> Array:
    """As `correct_means`, but means (m, segments, 6) beside a lost one stay uncorrected."""
    alone = np.ones(lost.shape, bool)
    alone[1:-1] = lost[:-2] | lost[2:]
    return np.where(alone[..., None], means, correct_means(means, each))


def _resample_sensor(
    w: PendingSamples, k: int, grid: Array, period: float, max_gap: float
) -> tuple[Array, Array, Bools]:
    """Readings (n, 6), doubt (n, 2) and loss (n,) of one sensor on the grid."""
    rows = np.flatnonzero(w.sound[:, k])
    doubt = np.ones((len(grid), 2))
    if not len(rows):
        return np.zeros((len(grid), 6)), DOUBTFUL * doubt, np.ones(len(grid), bool)
    t = w.t[rows]
    behind = np.searchsorted(t, grid)
    before, after = np.clip(behind - 1, 0, len(t) - 1), np.clip(behind, 0, len(t) - 1)
    span = t[after] - t[before]
    lost = ((behind == 0) & (t[0] > grid + period)) | (behind == len(t)) | (span > max_gap)
    weight = np.where(lost | (span <= 0), 0.0, (grid - t[before]) / np.where(span > 0, span, 1.0))[
        :, None
    ]
    known = w.values[rows, k]
    beside = np.maximum(np.abs(t[after] - grid), np.abs(grid - t[before]))
    doubt[beside > 1.5 / w.stream.rate] = DOUBTFUL
    doubt[w.clipped[rows[before], k] | w.clipped[rows[after], k], 1] = DOUBTFUL
    return known[before] * (1 - weight) + known[after] * weight, doubt, lost


def _prune(w: PendingSamples, t: float) -> PendingSamples:
    """Forget what lies before t by so much that it bridges nothing."""
    first = max(int(np.searchsorted(w.t, t - KEPT)) - 1, 0)
    return PendingSamples(
        w.stream, w.t[first:], w.values[first:], w.sound[first:], w.clipped[first:]
    )
