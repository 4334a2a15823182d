"""Times that run back, stretches in which a stream, or a sensor of it, repeats its last reading, and sensors that repeat another's readings: faults of the file or of the link.

In      blocks, one a stream
Out     suspicions with their spans
Limits  a sensor without noise repeats its reading at rest: the share of repeated rows elsewhere says how unlikely a long run is. Readings without
        noise may be another's: segments that turn together have one rate
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.samples import ORIENTATION, Block
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.fault_detection.single_sensors.significance import FALSE_ALARMS

SHORTEST = 0.1  # s of repeated rows that are worth a word
NEAR = 1.0  # s: a coarse sensor repeats its readings where it rests, those beside it do not
CHANNELS = 3  # at least: the axes of one sensor
SMOOTH = 0.1  # of the usual step: less is readings without noise that come to rest
JUMP, FOLLOWING = 3.0, 5  # times the steps that follow: orientations behind a gap
ROUNDED = 1e-9  # of the largest reading: less is rounding
EVERY = 50  # rows, of which one is compared first, and in which readings have noise or not
MOST_FROZEN = 0.9  # of all rows; what stood still stands beside what moved
_Spans = tuple[tuple[float, float], ...]


def frozen_stretches(blocks: Sequence[Block]) -> list[Suspicion]:
    """Stretches in which all readings of a stream stand still, or those of some of its sensors.

    Parameters
    ----------
    blocks : sequence of Block
        One block a stream.

    Returns
    -------
    list of Suspicion
        `file.frozen`, one a stream, else `sensor.frozen`, one for sensors that stand still at the same time; the probability is that of so many repeated rows by chance.
    """
    found = []
    for block in blocks:
        rows, sensors = block.values.reshape(len(block.t), -1), block.stream.sensors
        whole = _standing_still(block, rows, np.inf)
        if whole is not None:
            found.append(_frozen("file.frozen", sensors, *whole))
        several = len(sensors) > 1 and block.stream.inertial
        together: dict[_Spans, dict[str, float]] = {}  # probability by sensor
        for k, sensor in enumerate(sensors if several else ()):
            alone = _standing_still(block, block.values[:, k], NEAR)
            if (
                alone is not None
                and (whole is None or alone[0] != whole[0])
                and _moves_noisily(block.values[:, k])
            ):
                together.setdefault(alone[0], {})[sensor] = min(1.0, len(sensors) * alone[1])
        found += [
            _frozen("sensor.frozen", tuple(each), spans, math.prod(each.values()))
            for spans, each in together.items()
        ]
    return found


def _standing_still(
    block: Block, values: NDArray[np.float64], near: float
) -> tuple[_Spans, float] | None:
    """When (s) readings (n, channels) stand still, and the probability of such by chance, given those `near` s elsewhere in which most rows are repeated; None where they do not."""
    known = ~np.isnan(values).all(axis=1)  # rows that are lost say nothing of those beside them
    t, values = (block.t, values) if known.all() else (block.t[known], values[known])
    if len(t) < 3 or values.shape[1] < CHANNELS:
        return None
    repeats = _repeats(values)
    runs = [r for r in _runs(repeats) if t[r[1]] - t[r[0]] >= SHORTEST]
    runs = [r for r in runs if _is_cut_off(block, values, r)]
    rows = sum(b - a for a, b in runs)
    if not runs or rows > MOST_FROZEN * len(t):  # what never changes: its sensors are dead
        return None
    others = np.delete(repeats, np.concatenate([np.arange(a, b) for a, b in runs]))
    count = int(np.clip(near / np.median(np.diff(t)), 1, len(others)))
    usual = (float(np.convolve(others, np.ones(count), "valid").max()) + 1.0) / (count + 1.0)
    p = min(1.0, len(values) * usual ** min(b - a for a, b in runs))
    spans = tuple((float(t[a]), float(t[b])) for a, b in runs)
    return (spans, p) if p < FALSE_ALARMS else None


def _frozen(code: str, sensors: Sequence[str], spans: _Spans, p: float) -> Suspicion:
    longest = max(b - a for a, b in spans)
    values: dict[str, float | str] = {
        "seconds": longest,
        "count": float(len(spans)),
        "at": spans[0][0],
    }
    if code.startswith("sensor."):
        values["sensors"] = ", ".join(sensors)
    return Suspicion(Message(code, values, "fault"), tuple(sensors), spans, p)


def backward_times(blocks: Sequence[Block]) -> list[Suspicion]:
    """Streams whose times run back or stand still from one row to the next.

    Parameters
    ----------
    blocks : sequence of Block
        One block a stream.

    Returns
    -------
    list of Suspicion
        One a stream, `file.time_runs_back`; certain.
    """
    found = []
    for block in blocks:
        back = np.flatnonzero(np.diff(block.t) <= 0)
        if len(back):
            spans = tuple(
                (float(min(block.t[k : k + 2])), float(max(block.t[k : k + 2]))) for k in back
            )
            message = Message(
                "file.time_runs_back", {"count": float(len(back)), "at": spans[0][0]}, "fault"
            )
            found.append(Suspicion(message, block.stream.sensors, spans, 0.0))
    return found


def repeated_sensors(blocks: Sequence[Block]) -> list[Suspicion]:
    """Sensors that read the same as another in every sample, noise included: one of them stands for both.

    Parameters
    ----------
    blocks : sequence of Block
        One block a stream.

    Returns
    -------
    list of Suspicion
        One a pair, `sensors.identical`; certain.
    """
    found: list[Suspicion] = []
    every = [
        _Readings(b, k, q)
        for b in blocks
        for k in range(len(b.stream.sensors))
        for q in b.stream.quantities
    ]
    for one, other in itertools.combinations(every, 2):
        pair = (one.sensor, other.sensor)
        is_known = any(pair == s.sensors for s in found)
        if pair[0] != pair[1] and not is_known and one.are(other):
            message = Message("sensors.identical", {"first": pair[0], "second": pair[1]}, "fault")
            span = (float(one.block.t[0]), float(one.block.t[-1]))
            found.append(Suspicion(message, pair, (span,), 0.0))
    return found


@dataclass(frozen=True)
class _Readings:
    """What one sensor of a stream reads of a quantity."""

    block: Block
    column: int
    quantity: str

    @property
    def sensor(self) -> str:
        return self.block.stream.sensors[self.column]

    @cached_property
    def values(self) -> NDArray[np.float64]:
        """(n, axes), 0 where they are missing."""
        return np.nan_to_num(self.block.of(self.quantity)[:, self.column])

    def are(self, other: "_Readings") -> bool:
        """Whether they are the other's, and noisy."""
        few = slice(None, None, EVERY)
        return (
            self.quantity == other.quantity
            and np.array_equal(self.values[few], other.values[few])
            and np.array_equal(self.values, other.values)
            and _is_noisy(self.values)
        )


def _is_noisy(values: NDArray[np.float64]) -> bool:
    """Whether readings (n, axes) have noise of their own: then their fourth differences change sign from row to row more often than not."""
    bends = np.diff(values, 4, axis=0)
    bends = np.where(np.abs(bends) > ROUNDED * np.abs(values).max(initial=0.0), bends, 0.0)
    return bool(np.mean(bends[1:] * bends[:-1] < 0.0) > 0.5) if len(bends) > 1 else False


def _moves_noisily(values: NDArray[np.float64]) -> bool:
    """Whether readings (n, channels) have noise in any EVERY rows in which they do not repeat: a finger without noise that rests reads one value, whatever the others do."""
    known = values[np.isfinite(values).all(axis=1)]
    moving = known[1:][~_repeats(known)]
    return any(_is_noisy(moving[k : k + EVERY]) for k in range(0, len(moving), EVERY))


def _is_cut_off(block: Block, values: NDArray[np.float64], run: tuple[int, int]) -> bool:
    """Whether readings break off at a run of equal rows; those without noise come to rest and start again smoothly.

    Orientations may start abruptly, too; behind a gap they jump by all that was missed.
    """
    steps = np.sqrt(np.nansum(np.diff(values, axis=0) ** 2, axis=1))
    first, last = run
    if not block.stream.inertial and ORIENTATION in block.stream.quantities:
        following = steps[last + 1 : last + 1 + FOLLOWING]
        return bool(len(following) and steps[last] > JUMP * np.median(following))
    beside = [*([steps[first - 1]] if first else ()), *steps[last : last + 1]]
    moving = steps[steps > 0]
    return bool(len(moving) and min(beside, default=0.0) > SMOOTH * np.median(moving))


def _repeats(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which rows (n - 1,) of values (n, channels), each with readings, repeat what every channel of theirs read last."""
    missing = np.isnan(values)
    if not missing.any():
        return np.asarray((values[1:] == values[:-1]).all(axis=1))
    repeats = np.ones(len(values), bool)
    for column, absent in zip(values.T, missing.T):
        there = np.flatnonzero(~absent)
        repeats[there[1:][np.diff(column[there]) != 0.0]] = False
    return repeats[1:]


def _runs(repeats: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last row of every run of rows that are the same."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], repeats.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2])]
