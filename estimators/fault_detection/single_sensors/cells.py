"""Inertial readings of all streams on one grid of short cells, whatever their rates and clocks.

In      blocks of inertial streams, one a stream
Out     mean rate and mean specific force of every sensor in every cell, and whether the cell rests on samples
Limits  a gap up to GAP is bridged by a straight line, a longer one leaves its cells without samples
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.samples import ACC, GYR, Block, every
from handscope.estimators.fault_detection.single_sensors.sample_kernels import integrals_at
from handscope.estimators.numerics.typing import Array

CELL = 0.02  # s: a hand turns by less than 0.4 rad meanwhile
BEYOND, OFTEN = (
    1.1,
    1e-3,
)  # of full scale, share of readings: a full scale that readings pass is not theirs
CHAIN, WINDOW, HOP = 250, 50, 25  # cells: 5 s in one frame, averaged over 1 s, every 0.5 s
KNOTS = (CHAIN - WINDOW) // HOP + 1
AT_ONCE = 100_000  # readings of sensors of which something is made at once: a minute of 16
GAP = 0.065  # s bridged by a straight line: six samples at 100 Hz


@dataclass(frozen=True)
class Cells:
    """Readings in cells of CELL s from `start` on."""

    sensors: tuple[str, ...]
    start: float  # s
    gyr: Array  # (n, sensors, 3) rad/s
    acc: Array  # (n, sensors, 3) m/s^2
    valid: NDArray[np.bool_]  # (n, sensors)

    @cached_property
    def unbroken(self) -> NDArray[np.bool_]:
        """Which windows (G, S, KNOTS) belong to the longest run of their chain without missing cells."""
        valid = self.valid[begins(len(self.valid))[:, None] + np.arange(CHAIN)]  # (G, CHAIN, S)
        missing = np.concatenate(
            [np.zeros_like(valid[:, :1], int), np.cumsum(~valid, axis=1)], axis=1
        )
        first = np.arange(KNOTS) * HOP
        begin, end = missing[:, first], missing[:, first + WINDOW]
        whole = begin == end
        run = whole[:, :, None] & whole[:, None] & (begin[:, :, None] == begin[:, None])
        best = np.argmax(run.sum(axis=1), axis=1)
        return np.moveaxis(np.take_along_axis(run, best[:, None, None], axis=1)[:, 0], 1, 2)

    @cached_property
    def path(self) -> Array:
        """Angles (G, S) rad that the gyroscopes read in every chain, summed in order: that of a sensor does not depend on those beside it."""
        turned = CELL * np.linalg.norm(self.gyr, axis=-1)
        of_chain = turned[begins(len(turned))[:, None] + np.arange(CHAIN)]  # (G, CHAIN, S)
        return np.asarray(np.cumsum(of_chain, axis=1)[:, -1])

    def of(self, columns: NDArray[np.intp]) -> "Cells":
        """Of some sensors only."""
        names = tuple(self.sensors[k] for k in columns)
        gyr: Array = np.ascontiguousarray(self.gyr[:, columns])
        acc: Array = np.ascontiguousarray(self.acc[:, columns])
        return Cells(names, self.start, gyr, acc, self.valid[:, columns])


def begins(n: int) -> NDArray[np.intp]:
    """First cells (G,) of as many chains as n cells hold; a last one that lacks a tenth begins a little earlier."""
    count = (n + CHAIN // 10) // CHAIN
    return np.minimum(np.arange(count) * CHAIN, n - CHAIN) if n >= CHAIN else np.zeros(0, np.intp)


def forward_streams(whole: Sequence[Block]) -> list[Block]:
    """Of whole streams those whose times run forward."""
    return [b for b in whole if (np.diff(b.t) > 0).all()]


def cells_of(blocks: Sequence[Block]) -> Cells:
    """All sensors of inertial streams on one grid.

    Parameters
    ----------
    blocks : sequence of Block
        One block a stream; streams without gyroscope or accelerometer are left out.

    Returns
    -------
    Cells
        From the first sample of any stream to the last; cells without samples are not valid.
    """
    inertial = [b for b in blocks if b.stream.inertial and len(b.t) > 1]
    if not inertial:
        return Cells((), 0.0, np.zeros((0, 0, 3)), np.zeros((0, 0, 3)), np.zeros((0, 0), bool))
    start, stop = min(b.t[0] for b in inertial), max(b.t[-1] for b in inertial)
    edges = start + CELL * np.arange(int((stop - start) / CELL) + 1)
    sensors = tuple(s for b in inertial for s in b.stream.sensors)
    gyr, acc = np.empty((2, len(edges) - 1, len(sensors), 3))
    valid, first = np.empty((len(edges) - 1, len(sensors)), bool), 0
    for block in inertial:
        own = slice(first, first + len(block.stream.sensors))
        means, valid[:, own] = means_of(block, (GYR, ACC), edges)
        gyr[:, own], acc[:, own], first = means[..., :3], means[..., 3:], own.stop
    return Cells(sensors, float(start), gyr, acc, valid)


def means_of(
    block: Block, quantities: tuple[str, ...], edges: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Means of quantities (cells, sensors, 3 a quantity) between edges (cells + 1,) s, and whether cells rest on samples (cells, sensors)."""
    usable = np.all([_is_usable(block, q) for q in quantities], axis=0)
    means = np.zeros((len(edges) - 1, usable.shape[1], 3 * len(quantities)))
    valid = np.zeros(means.shape[:2], bool)
    for pattern, columns in sensor_groups(usable):
        if pattern.sum() > 1:
            t = block.t[pattern]
            values = np.concatenate(
                [taken(block, q, pattern, columns) for q in quantities], axis=-1
            )
            means[:, columns], own = _cell_means(t, values, edges)
            valid[:, columns] = own[:, None]
    return means, valid


def _is_usable(block: Block, quantity: str) -> NDArray[np.bool_]:
    """Readings (n, sensors) of a quantity that are there and not at its limit."""
    return np.asarray(every(np.isfinite(block.of(quantity))) & ~_at_limit(block, quantity))


def taken(block: Block, quantity: str, rows: NDArray[np.bool_], columns: NDArray[np.intp]) -> Array:
    """A quantity of some samples and sensors of a group; of all without a copy."""
    values = block.of(quantity)
    values = values if len(columns) == values.shape[1] else values[:, columns]
    return values if rows.all() else values[rows]


def sensor_groups(
    usable: NDArray[np.bool_], sensors: NDArray[np.intp] | None = None
) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.intp]]]:
    """Sensors (all, or these) with the same usable samples (n,), those of one strip mostly; of a long recording a few at a time, as what is made of all takes several times its memory.

    Parameters
    ----------
    usable : Array
        (n, sensors).
    sensors : Array, optional
        Columns of it that are wanted.
    """
    sensors = np.arange(usable.shape[1]) if sensors is None else sensors
    at_once = max(1, AT_ONCE // max(len(usable), 1))
    for pattern, columns in _patterns(usable[:, sensors]):
        for k in range(0, len(columns), at_once):
            yield pattern, sensors[columns[k : k + at_once]]


def _patterns(
    usable: NDArray[np.bool_],
) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.intp]]]:
    """Different columns (n,) of samples that are there, and which sensors have each."""
    if not usable.shape[1]:
        return
    if (usable == usable[:, :1]).all():
        yield usable[:, 0], np.arange(usable.shape[1])
        return
    patterns, of_sensor = np.unique(usable, axis=1, return_inverse=True)
    for k, pattern in enumerate(patterns.T):
        yield pattern, np.flatnonzero(of_sensor.ravel() == k)


def _at_limit(block: Block, quantity: str) -> NDArray[np.bool_]:
    """Readings (n, sensors) at the full scale; none where readings go far beyond it, as they do in another unit."""
    limit = block.stream.full_scale.get(quantity)
    if limit is None:
        return np.zeros(block.values.shape[:2], bool)
    beyond = np.abs(block.of(quantity)).max(axis=-1) > BEYOND * limit  # NaN compares as no
    return block.at_limit(quantity) & (float(beyond.mean()) < OFTEN)


def _cell_means(t: Array, values: Array, edges: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Means between edges of values (n, ...) joined by straight lines, and whether samples lie close enough."""
    steps = np.diff(t)
    before = np.clip(np.searchsorted(t, edges, side="right") - 1, 0, len(t) - 2)
    flat = np.ascontiguousarray(values.reshape(len(t), -1))
    at_edges = integrals_at(np.ascontiguousarray(t), flat, edges, before)
    bridged = np.cumsum(np.concatenate([[0], steps > max(GAP, 2.5 * float(np.median(steps)))]))
    inside = (edges >= t[0] - CELL) & (edges <= t[-1] + CELL)
    close = (steps[before] <= max(GAP, 2.5 * float(np.median(steps)))) & inside
    valid = close[1:] & close[:-1] & (bridged[before[1:]] == bridged[before[:-1]])
    means = np.diff(at_edges, axis=0) / np.diff(edges)[:, None]
    return means.reshape(-1, *values.shape[1:]), valid
