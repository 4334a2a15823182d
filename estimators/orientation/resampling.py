"""One time base: orientations of sensors with different rates and clocks, brought to the instants
of the fastest stream.

In      oriented samples of each stream, in order per stream, interleaved anyhow
Out     q_GS of every segment at every sample of the reference stream, as soon as every stream has
        got that far
Limits  a silent stream holds the rows up until `release` leaves it behind: its segments are then
        held and marked missing
"""

# of a few samples; numpy's search would hand the interpreter to another thread each time
from bisect import (
    bisect_left,
    bisect_right,
)
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.samples import Block, Stream
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.orientation import fusion as orientation_fusion
from handscope.estimators.orientation import given_orientations
from handscope.estimators.orientation.fusion import Oriented

# of one stream's sensors
SensorsState = orientation_fusion.StreamState | given_orientations.State
S = TypeVar("S", bound=SensorsState)
Places = slice | Indices
SCATTERS = 4.0  # standard deviations of steps between samples that no jitter makes
NOTICED = 1e-3  # of the rate: over a turn of 90 deg it makes a tenth of a degree


@dataclass(frozen=True)
class Waiting:
    """Oriented samples of a stream that are still needed; the first may lie before the next row to
    give."""

    stream: Stream
    data: Oriented

    @property
    def newest(self) -> float:
        return float(self.data.t[-1]) if len(self.data.t) else -np.inf


@dataclass(frozen=True)
class State:
    """Samples that wait until every stream has reached them."""

    reference: str  # name of the stream whose samples make the rows
    waiting: Mapping[str, Waiting]
    t: float = -np.inf  # newest row given


@dataclass(frozen=True)
class Rows:
    """Orientations q_GS at the reference stream's instants, with variances in rad^2."""

    t: Array  # (n,)
    q_GS: Array  # (n, segments, 4), NaN where no sensor
    flags: NDArray[np.uint8]  # (n, segments)
    # (n, segments) rad^2, variance of the heading that gaps have cost each sensor so far
    rotation_variance: Array

    def between(self, part: slice) -> "Rows":
        """Some of the rows."""
        return Rows(self.t[part], self.q_GS[part], self.flags[part], self.rotation_variance[part])


def start(streams: Iterable[Stream]) -> State:
    """Begin with the inertial streams of a recording; the fastest makes the rows, with the hand's
    sensor where rates are equal."""
    inertial = [s for s in streams if s.inertial and set(s.sensors) & set(SEGMENTS)]
    return State(
        _reference(inertial), {s.name: Waiting(s, _empty_waiting(len(s.sensors))) for s in inertial}
    )


def step(state: State, *fresh: tuple[Stream, Oriented]) -> tuple[State, Rows]:
    """Take fresh orientations of streams and give out the rows that are complete."""
    waiting = dict(state.waiting)
    for stream, oriented in fresh:
        before = waiting.get(stream.name)
        same = before is not None and before.stream.sensors == stream.sensors
        data = _append(before.data, oriented) if before is not None and same else oriented
        waiting[stream.name] = Waiting(stream, data)
    return _give(State(state.reference, waiting, state.t), np.inf)


def release(state: State, patience: float) -> tuple[State, Rows]:
    """Give out rows older than `patience` s against the newest, although a silent stream has not
    got that far.

    While the reference itself is silent (its strip was pulled), the fastest stream that is not
    makes the rows.
    """
    newest = max(w.newest for w in state.waiting.values())
    alive = [w.stream for w in state.waiting.values() if w.newest >= newest - patience]
    return _give(replace(state, reference=_reference(alive)), patience)


def finish(state: State) -> tuple[State, Rows]:
    """Give out all rows: nothing more will come."""
    return _give(state, 0.0)


def drain(
    params: orientation_fusion.FusionParams,
    fusions: Mapping[str, S],
    state: State,
) -> tuple[dict[str, S], State, Rows]:
    """What the fusions of all streams and the time base still held back: the states behind it, and
    the rows."""
    after, last = dict(fusions), []
    for name, fusion in fusions.items():
        if isinstance(fusion, given_orientations.State):
            continue  # holds nothing back
        fused, oriented = orientation_fusion.finish(params, fusion)
        after[name] = cast("S", fused)
        state, given = step(state, (fusion.stream, oriented))
        last.append(given)
    state, given = finish(state)
    return after, state, join([*last, given])


def measure_rates(blocks: Iterable[Block]) -> dict[str, float]:
    """Rates (Hz) by stream at which samples come, where they differ from the named ones by more
    than NOTICED; one block a stream, at least a second.

    A line through the samples' times against their numbers: jitter hardly turns it, and missing
    samples are counted by the named period where a step is longer than jitter makes it.
    """
    found = {}
    for block in blocks:
        rate, t = block.stream.rate, block.t
        if block.stream.inertial and len(t) > max(10.0, rate) and t[-1] - t[0] > 1.0:
            measured = float(
                1.0 / np.polynomial.polynomial.polyfit(_numbers(block), t - t[0], 1)[1]
            )
            if abs(measured / rate - 1.0) > NOTICED:
                found[block.stream.name] = measured
    return found


def fit_times(block: Block) -> Array:
    """Times (n,) s of a block's samples on the line through their stamps."""
    numbers = _numbers(block)
    begun, period = np.polynomial.polynomial.polyfit(numbers, block.t - block.t[0], 1)
    return np.asarray(block.t[0] + begun + period * numbers)


def _numbers(block: Block) -> Array:
    """Which of the samples there should be each is (n,): missing ones are counted."""
    steps = np.diff(block.t) * block.stream.rate
    numbers = np.arange(len(block.t), dtype=float)
    if 0.8 < np.median(steps) < 1.25:
        numbers[1:] += np.cumsum(_count_missing(steps))
    return numbers


def _count_missing(steps: Array) -> Array:
    """Samples missing before each step's end, of steps (n,) in periods."""
    # of the shorter ones: what is missing makes none of them
    scatter = float(np.median(steps) - np.quantile(steps, 0.16))
    return np.where(steps > 1.0 + max(0.5, SCATTERS * scatter), np.rint(steps) - 1.0, 0.0)


def join(pieces: list[Rows]) -> Rows:
    """One piece of consecutive pieces."""
    return Rows(*(np.concatenate([getattr(p, f.name) for p in pieces]) for f in fields(Rows)))


def _reference(streams: list[Stream]) -> str:
    """The fastest stream, with the hand's sensor where rates are equal."""
    return max(streams, key=lambda s: (s.rate, "hand" in s.sensors)).name


def _give(state: State, patience: float) -> tuple[State, Rows]:
    newest = state.waiting[state.reference].newest
    slowest = min(w.newest for w in state.waiting.values())
    reached = max(slowest, newest - patience)
    reference = state.waiting[state.reference]
    first, last = (bisect_right(reference.data.t, at) for at in (state.t, reached))
    t = reference.data.t[first:last][reference.data.sampled[first:last]]
    if not len(t):
        return state, _no_rows()
    rows = Rows(
        t,
        np.full((len(t), len(SEGMENTS), 4), np.nan),
        np.zeros((len(t), len(SEGMENTS)), np.uint8),
        np.zeros((len(t), len(SEGMENTS))),
    )
    for waiting in state.waiting.values():
        _place(rows, waiting)
    pruned = {name: _prune(w, reached) for name, w in state.waiting.items()}
    return replace(state, waiting=pruned, t=max(state.t, reached)), rows


def _place(rows: Rows, waiting: Waiting) -> None:
    """Write the stream's segments into the rows, interpolated between the samples around each
    instant; outside them another stream goes first."""
    count, sensors, segments = _sensors_on_hand(waiting.stream.sensors)
    data, t = waiting.data, rows.t
    if not count or not len(t) or not len(data.t):
        return
    first = bisect_left(data.t, t[0])
    own = slice(first, first + len(t))
    if np.array_equal(
        data.t[own], t
    ):  # the stream has samples at just these instants: the same bits without interpolation
        rows.q_GS[:, segments], rows.flags[:, segments] = (
            data.q_GS[own, sensors],
            data.flags[own, sensors],
        )
        rows.rotation_variance[:, segments] = data.rotation_variance[own, sensors]
        return
    after = np.minimum(np.searchsorted(data.t, t), len(data.t) - 1)
    before = np.where(data.t[after] == t, after, np.maximum(after - 1, 0))
    span = data.t[after] - data.t[before]
    weight = np.where(span > 0, (t - data.t[before]) / np.where(span > 0, span, 1.0), 0.0)
    early, late = (
        t < data.t[0] - 1.5 / waiting.stream.rate,
        t > data.t[-1] + 1.5 / waiting.stream.rate,
    )
    q_GS = quat.slerp(
        data.q_GS[before][:, sensors],
        data.q_GS[after][:, sensors],
        np.clip(weight, 0.0, 1.0)[:, None] * np.ones(count),
    )
    q_GS = np.where(early[:, None, None], np.nan, q_GS)
    missing = np.where(early | late, Flag.MISSING, 0).astype(np.uint8)
    flags = data.flags[before][:, sensors] | data.flags[after][:, sensors] | missing[:, None]
    elsewhere = ((t < data.t[0]) | (t > data.t[-1]))[:, None] & np.isfinite(
        rows.q_GS[:, segments, 0]
    )
    rows.q_GS[:, segments] = np.where(elsewhere[..., None], rows.q_GS[:, segments], q_GS)
    rows.flags[:, segments] = np.where(elsewhere, rows.flags[:, segments], flags)
    rows.rotation_variance[:, segments] = np.where(
        elsewhere, rows.rotation_variance[:, segments], data.rotation_variance[after][:, sensors]
    )


@cache
def _sensors_on_hand(sensors: tuple[str, ...]) -> tuple[int, Places, Places]:
    """How many of a stream's sensors sit on the hand, which they are, and on which segments."""
    columns = [k for k, name in enumerate(sensors) if name in SEGMENT]
    return len(columns), _as_slice(columns), _as_slice([SEGMENT[sensors[k]] for k in columns])


def _as_slice(numbers: list[int]) -> Places:
    """What numpy is to be asked for: neighbours as a slice, which it gives without copying."""
    first = numbers[0] if numbers else 0
    return (
        slice(first, first + len(numbers))
        if numbers == list(range(first, first + len(numbers)))
        else np.array(numbers, np.intp)
    )


@cache
def _no_rows() -> Rows:
    return Rows(
        np.empty(0),
        np.empty((0, len(SEGMENTS), 4)),
        np.empty((0, len(SEGMENTS)), np.uint8),
        np.empty((0, len(SEGMENTS))),
    )


def _empty_waiting(sensors: int) -> Oriented:
    return Oriented(
        np.empty(0),
        np.empty((0, sensors, 4)),
        np.empty((0, sensors), np.uint8),
        np.empty((0, sensors)),
        np.empty(0, bool),
    )


def _append(a: Oriented, b: Oriented) -> Oriented:
    return Oriented(*(np.concatenate(both) for both in zip(_as_tuple(a), _as_tuple(b))))


def _prune(waiting: Waiting, t: float) -> Waiting:
    """Forget what lies before the last sample not after t."""
    first = max(bisect_right(waiting.data.t, t) - 1, 0)
    return Waiting(
        waiting.stream, Oriented(*(values[first:] for values in _as_tuple(waiting.data)))
    )


def _as_tuple(data: Oriented) -> tuple[Any, ...]:
    return data.t, data.q_GS, data.flags, data.rotation_variance, data.sampled
