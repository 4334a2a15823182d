"""Readings of all sensors cut into short windows, each sensor's in the frame that it had where its window began.

In      blocks of all inertial streams, gyroscope biases where known
Out     per window and sensor: specific force, and what an arm of one metre along each axis would add to it, as time series in a frame that does not turn
Source  acceleration of a point of a rigid body; rates integrated within a window only, so that biases do not accumulate
Limits  samples that are missing are bridged by splines, no more than `LONGEST_GAP`; of a window with longer gaps, or saturated samples, counts the longest piece without one
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.fault_detection.neighbours.window_kernels import (
    evaluate_spline,
    fill_windows,
    spline_slopes,
)
from handscope.estimators.fault_detection.single_sensors.cells import sensor_groups, taken
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors.mean_readings import correct_means
from handscope.estimators.sensors.missing_samples import is_complete

RATE = 100.0  # Hz, of the common time base
LENGTH = 1.0  # s, of a window
MOST_WINDOWS = 60  # of a recording, those with most movement: what longer ones cost
AVERAGED = 4  # samples of the common time base that make one of a window's: 25 Hz
INSTANTS = round(LENGTH * RATE) // AVERAGED  # of a window
# s, or a usual interval and a half: no spline knows what a finger does meanwhile
LONGEST_GAP = 0.021
MOST_MISSING = 0.3  # of a second of which no piece, but the whole is asked
# share of what derivatives by every second sample are off, that those by all may be: of smooth movement an eighth, of a kink more
BY_HALF = 0.15
LEAST_PIECE = 10  # instants of a window between two gaps
QUIET = 0.06  # rad/s, largest standard deviation of a rate's axis in a second of rest
BIAS = 0.2  # rad/s, largest zero-rate level that a second of rest may tell


@dataclass(frozen=True)
class Series:
    """All sensors on one time base: a whole recording, or of a long one the seconds about the windows that are looked at."""

    t: Array  # (n,) s
    sensors: tuple[str, ...]
    gyr: Array  # (n, S, 3) rad/s, biases removed
    change: Array  # (n, S, 3) rad/s^2, derivative of the rates
    acc: Array  # (n, S, 3) m/s^2
    whole: NDArray[np.bool_]  # (n, S) near a sample that is there
    doubt: Array  # (n, S) rad/s^2, by which the derivative may be off between samples
    chosen: NDArray[np.int_]  # (K,) numbers of the windows that are looked at, in order
    span: tuple[float, float]  # s, of the whole recording
    count: int  # samples of the whole recording


@dataclass(frozen=True)
class Windows:
    """K windows of m instants, of sensors in their frames at the beginning of the window."""

    t: Array  # (K,) s, beginnings
    force: Array  # (K, m, 3) m/s^2
    arm: Array  # (K, m, 3, 3) m/s^2 for an arm of 1 m along the sensor's x, y, z
    turned: Array  # (K, m, 3, 3) sensor frame at the window's beginning <- sensor frame
    rate: Array  # (K, m, 3) rad/s
    doubt: Array  # (K,) 1/s^2, by which what an arm of 1 m along an axis adds may be off, root mean square
    share: Array  # (K, m) of the samples that are there
    weight: Array  # (K, m) of the instants: 0 where they are left out, else so that the mean of the squares is 1

    def within(self, first: int, count: int) -> "Windows":
        """A part of each window's instants, in the frames of the whole."""
        part = slice(first, first + count)
        of_instants = ("force", "arm", "turned", "rate", "share", "weight")
        return replace(self, **{name: getattr(self, name)[:, part] for name in of_instants})

    @cached_property
    def vectors(self) -> Array:
        """Vectors (K, m, 3, 7) of a joint's acceleration by this sensor: force, arms, and axes of the frame, negated."""
        each = np.concatenate([self.force[..., None], self.arm, -self.turned], axis=-1)
        return np.asarray(self.weight[..., None, None] * each)

    @cached_property
    def weighted_arm(self) -> Array:
        """The arms (K, m, 3, 3) by the weights."""
        return np.asarray(self.weight[..., None, None] * self.arm)

    @cached_property
    def gram(self) -> Array:
        """Sums (K, 7, 7) of the vectors' scalar products."""
        flat = self.vectors.reshape(len(self.force), -1, 7)
        return np.asarray(np.swapaxes(flat, 1, 2) @ flat)

    @cached_property
    def outer(self) -> Array:
        """Sums (K, 21, 21) of the products of their components."""
        flat = by_vector(self.vectors)
        return np.asarray(np.swapaxes(flat, 1, 2) @ flat)

    @cached_property
    def turning(self) -> Array:
        """How much each window (K,) adds to an arm of 1 m, root mean square over instants and axes, 1/s^2."""
        return np.asarray(np.sqrt((self.weighted_arm**2).mean(axis=(1, 2, 3)) * 3))

    @cached_property
    def arms(self) -> Array:
        """What arms of 1 m add (K, 3, 3), mean over instants of squares and products along the sensor's axes, 1/s^4."""
        return squares(self.weighted_arm)

    @cached_property
    def turn(self) -> Array:
        """How far (K,) rad the sensor turns about its mean orientation, root mean square."""
        by = self.weight[..., None, None] ** 2
        off = self.turned - (by * self.turned).mean(axis=1, keepdims=True)
        return np.asarray(np.sqrt((by * off**2).sum(axis=(2, 3)).mean(axis=1) / 2))


def longest_pieces(whole: NDArray[np.bool_]) -> Array:
    """Weights (K, m) of the instants of each window by its longest piece in which all are whole (K, m); all 0 where that is shorter than LEAST_PIECE."""
    K, m = whole.shape
    run = np.zeros((K, m), int)
    run[:, 0] = whole[:, 0]
    for k in range(1, m):
        run[:, k] = np.where(whole[:, k], run[:, k - 1] + 1, 0)
    last = run.argmax(axis=1)[:, None]
    length = run.max(axis=1)[:, None]
    inside = (np.arange(m) <= last) & (np.arange(m) > last - length) & (length >= LEAST_PIECE)
    return np.where(inside, np.sqrt(m / np.maximum(length, 1)), 0.0)


def squares(arms: Array) -> Array:
    """Mean over instants (K, 3, 3) of the products of what arms along each axis add (K, m, 3, 3), summed over components."""
    flat = arms.reshape(len(arms), -1, 3)
    return np.asarray(np.swapaxes(flat, 1, 2) @ flat / arms.shape[1])


def by_vector(vectors: Array) -> Array:
    """Components (K, m, 3 v) of vectors (K, m, 3, v), one vector after the other."""
    return np.swapaxes(vectors, 2, 3).reshape(*vectors.shape[:2], -1)


def common_series(
    blocks: Sequence[Block], bias: Mapping[str, Array], behind: float = 0.0
) -> Series | None:
    """Bring the segments' sensors to one time base.

    Parameters
    ----------
    blocks : sequence of Block
        Samples of any streams, in order for each stream.
    bias : mapping
        Gyroscope biases (3,) rad/s by segment; of others the quietest second tells it, where there is one.
    behind : float
        Samples by which the gyroscopes' readings are behind the accelerometers': half a one where they are the mean rates since the sample before.

    Returns
    -------
    Series or None
        None where fewer than two sensors have a window in common.
    """
    inertial = [
        b
        for b in whole_streams(list(blocks))
        if b.stream.inertial and len(b.t) > 2 * RATE * LENGTH * 0.2
    ]
    if len({s for b in inertial for s in b.stream.sensors} & set(SEGMENTS)) < 2:
        return None
    begin, end = min(float(b.t[0]) for b in inertial), max(float(b.t[-1]) for b in inertial)
    t = begin + np.arange(int((end - begin) * RATE)) / RATE
    worn = {s for b in inertial for s in b.stream.sensors}
    names = tuple(s for s in SEGMENTS if s in worn)
    chosen = np.arange(len(t) // round(LENGTH * RATE))
    if len(chosen) > MOST_WINDOWS:
        turned = np.empty((len(chosen), len(names)))
        for group in _sensors_read(inertial, names, bias, t, behind):
            turned[:, group.columns] = _turning(group.gyr)
        chosen = most_moved(turned)
    rows, first = _rows_about(chosen, len(t))
    gyr, change, acc = np.empty((3, len(rows), len(names), 3))
    whole, doubt = np.empty((len(rows), len(names)), bool), np.empty((len(rows), len(names)))
    for group in _sensors_read(inertial, names, bias, t, behind):
        k = group.columns
        gyr[:, k], change[:, k], acc[:, k] = group.gyr[rows], group.change[rows], group.acc[rows]
        whole[:, k], doubt[:, k] = group.near[rows, None], group.doubt[rows]
    span = (float(t[0]), float(t[-1]))
    return Series(t[rows], names, gyr, change, acc, whole, doubt, first, span, len(t))


def _rows_about(chosen: NDArray[np.int_], count: int) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Of `count` samples those of the chosen windows and of a second on either side of each, more than any delay that is tried, with what is behind the last full second; the windows' numbers among these."""
    m = round(LENGTH * RATE)
    beside = np.unique(chosen[:, None] + np.arange(-1, 2))
    kept = beside[(beside >= 0) & (beside * m < count)]
    rows = (kept[:, None] * m + np.arange(m)).ravel()
    return rows[rows < count], np.searchsorted(kept, chosen)


def liveliest(series: Series, most: int) -> Series:
    """The same with the few windows in which sensors turn most."""
    m = round(LENGTH * RATE)
    turned = _turning(series.gyr[(series.chosen[:, None] * m + np.arange(m)).ravel()])
    return replace(series, chosen=series.chosen[most_moved(turned, most)])


def most_moved(turned: Array, most: int = MOST_WINDOWS) -> NDArray[np.int_]:
    """Numbers (K,) of the windows in which sensors turn most (mean squares (windows, S)), each against its own whole recording."""
    share = (turned / np.maximum(turned.sum(axis=0), 1e-12)).sum(axis=1)
    return np.sort(np.argsort(-share, kind="stable")[:most])


def _turning(gyr: Array) -> Array:
    """Mean squares (windows, S) of rates (n, S, 3)."""
    m, S = round(LENGTH * RATE), gyr.shape[1]
    count = len(gyr) // m
    squares = (gyr[: count * m] ** 2).sum(axis=2)
    return np.asarray(squares.reshape(count, m, S).mean(axis=1))


@dataclass(frozen=True)
class _Group:
    """Some sensors of a stream that miss the same samples, on the common time base."""

    columns: NDArray[np.int_]  # (S,) numbers of the sensors
    gyr: Array  # (n, S, 3) rad/s, biases removed
    change: Array  # (n, S, 3) rad/s^2
    acc: Array  # (n, S, 3) m/s^2
    near: NDArray[np.bool_]  # (n,) where samples are near
    doubt: Array  # (n, S) rad/s^2


def _sensors_read(
    blocks: Sequence[Block],
    names: Sequence[str],
    bias: Mapping[str, Array],
    t: Array,
    behind: float,
) -> Iterator[_Group]:
    """The sensors, a few at a time: splines of all take several times the memory of the recording."""
    for block in blocks:
        clipped = block.at_limit(GYR) | block.at_limit(ACC)
        good = is_complete(block) & ~clipped
        good &= np.concatenate([[True], np.diff(block.t) > 0])[:, None]
        later = t + behind * float(np.median(np.diff(block.t)))
        worn = np.flatnonzero([s in names for s in block.stream.sensors])
        for there, own in sensor_groups(good, worn):
            at = np.ascontiguousarray(block.t[there])
            rates = taken(block, GYR, there, own)
            if behind > 0:  # means since the sample before
                rates = correct_means(rates, np.inf)
            gyr, change, near = _spline(at, rates, later)
            half = _spline(np.ascontiguousarray(at[::2]), rates[::2], later)[1]
            doubt = BY_HALF * np.linalg.norm(change - half, axis=2)
            acc, _, also_near = _spline(at, taken(block, ACC, there, own), t)
            near &= also_near & ~_beside(np.asarray(clipped[:, own].any(axis=1)), there, at, t)
            columns = [names.index(block.stream.sensors[k]) for k in own]
            level = _resting_rates(gyr, near)
            known = [bias.get(names[k], one) for k, one in zip(columns, level)]
            yield _Group(np.array(columns), gyr - known, change, acc, near, doubt)


def _spline(at: Array, values: Array, t: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Values (n, S, 3) at other instants, their derivatives, and where samples are near (n,)."""
    shape = (len(t), *values.shape[1:])
    if len(at) < 10:
        return np.zeros(shape), np.zeros(shape), np.zeros(len(t), bool)
    inside = np.clip(t, at[0], at[-1])
    after = np.clip(np.searchsorted(at, t), 1, len(at) - 1)
    flat = np.ascontiguousarray(values.reshape(len(at), -1))
    both, change = evaluate_spline(at, flat, spline_slopes(at, flat), inside, after)
    longest = max(LONGEST_GAP, 1.5 * float(np.median(np.diff(at))))
    near = (at[after] - at[after - 1] < longest) & (t >= at[0]) & (t <= at[-1])
    return both.reshape(shape), change.reshape(shape), near


def _beside(
    clipped: NDArray[np.bool_], there: NDArray[np.bool_], at: Array, t: Array
) -> NDArray[np.bool_]:
    """Which instants (n,) lie between two samples `there`, at times `at`, that are parted by a clipped one: it read most of all, which no spline knows."""
    if not clipped.any() or len(at) < 2:
        return np.zeros(len(t), bool)
    before = np.cumsum(clipped)[there]
    after = np.clip(np.searchsorted(at, t), 1, len(at) - 1)
    return np.asarray(before[after] > before[after - 1])


def _resting_rates(gyr: Array, near: NDArray[np.bool_]) -> Array:
    """Mean rates (S, 3) of the quietest second; zero where no second is quiet."""
    half, S = round(RATE / 2), gyr.shape[1]
    count = len(gyr) // half
    if count < 2:
        return np.zeros((S, 3))
    part = gyr[: count * half].reshape(count, half, S, 3)
    there = near[: count * half].reshape(count, half).mean(axis=1)
    mean, square = ((v[1:] + v[:-1]) / 2 for v in (part.mean(axis=1), (part**2).mean(axis=1)))
    spread = np.sqrt(np.maximum(square - mean**2, 0.0)).max(axis=2)
    spread[np.minimum(there[1:], there[:-1]) < 1 - MOST_MISSING] = np.inf
    best = np.argmin(spread, axis=0)
    level, least = mean[best, np.arange(S)], spread[best, np.arange(S)]
    small = (least <= QUIET) & (np.linalg.norm(level, axis=1) < BIAS)
    return np.where(small[:, None], level, 0.0)


def cut(
    series: Series,
    sensors: Sequence[str],
    around: int = 0,
    later: int = 0,
    averaged: int = AVERAGED,
) -> list[Windows]:
    """Cut sensors' series into windows, each as many averaged instants longer at either end, and as many samples later."""
    columns = np.array([series.sensors.index(s) for s in sensors])
    first = series.chosen * round(LENGTH * RATE)
    shape = (len(columns), len(first), round(LENGTH * RATE) // averaged + 2 * around)
    force, rate, share = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape)
    arm, turned = np.zeros((*shape, 3, 3)), np.zeros((*shape, 3, 3))
    readings = (
        np.ascontiguousarray(v) for v in (series.gyr, series.change, series.acc, series.whole)
    )
    begin = first - around * averaged + later
    filled = force, arm, turned, rate, share
    fill_windows(*readings, begin, columns, 1.0 / RATE, averaged, *filled)
    t, weight = series.t[np.minimum(first, len(series.t) - 1)], np.ones(shape[1:])
    inside = np.minimum(first[:, None] + np.arange(round(LENGTH * RATE)), len(series.t) - 1)
    doubt = np.sqrt((series.doubt[inside][..., columns] ** 2).mean(axis=1)).T
    return [
        Windows(t, force[s], arm[s], turned[s], rate[s], doubt[s], share[s], weight)
        for s in range(len(columns))
    ]
