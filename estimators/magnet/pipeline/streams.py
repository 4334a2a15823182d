"""Streams of trunk and hand, each at its own rate, brought to the instants of the hand's sensor for
tracker.py.

In      blocks of streams: inertial sensors of hand and trunk, magnetometers on the trunk; in any
        order, cut anywhere
Out     tracker.Readings at the hand's instants
Source  ours: inertial samples by linear interpolation. A magnetometer's sample is assigned
        unchanged to the first instant after it, with its age: interpolated ones have less noise,
        and share it with the next, so that the filter would be overconfident
Limits  a stream that is silent for longer than the patience is missing at those instants, even if
        its samples arrive later
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from handscope.estimators.data.magnet_streams import HAND, is_relevant
from handscope.estimators.data.samples import (
    ACC,
    GYR,
    MAG,
    TRUNK,
    Block,
    join,
)
from handscope.estimators.magnet.tracker.tracker import Readings
from handscope.estimators.numerics.typing import Array

MAX_GAP_PERIODS = 2.5  # periods between two neighbouring samples


@dataclass(frozen=True)
class Waiting:
    """Samples that wait for slower streams: save it, go on from it."""

    magnetometers: tuple[str, ...]  # in the order of the readings
    buffered: Mapping[str, Block]  # by stream, from the last sample that was used
    t_released: float = -np.inf  # s, newest instant released


def take(waiting: Waiting, blocks: Sequence[Block], patience: float) -> tuple[Waiting, Readings]:
    """Add blocks; release the instants at which all streams are known or have been waited for
    (patience, s)."""
    buffered = dict(waiting.buffered)
    for block in blocks:
        if is_relevant(block.stream) and len(block.t):
            name = block.stream.name
            buffered[name] = (
                join([buffered[name], block])
                if name in buffered and buffered[name].stream == block.stream
                else block
            )
    hand = _find_stream(buffered, HAND, GYR)
    if hand is None:
        return replace(waiting, buffered=buffered), _empty_readings(len(waiting.magnetometers))
    awaited = [(HAND, GYR), (TRUNK, GYR), *((point, MAG) for point in waiting.magnetometers)]
    newest = [
        -np.inf if (b := _find_stream(buffered, point, quantity)) is None else float(b.t[-1])
        for point, quantity in awaited
    ]
    known = max(min(newest), max(newest) - patience)
    at = hand.t[(hand.t > waiting.t_released) & (hand.t <= known)]
    if not len(at):
        return replace(waiting, buffered=buffered), _empty_readings(len(waiting.magnetometers))
    base, target = (
        _interpolate_inertial(_find_stream(buffered, point, GYR), point, at)
        for point in (TRUNK, HAND)
    )
    read = [
        _assign_magnetic(_find_stream(buffered, point, MAG), point, at, waiting.t_released)
        for point in waiting.magnetometers
    ]
    mag, age = (
        np.stack([values for values, _ in read], axis=1),
        np.stack([old for _, old in read], axis=1),
    )
    remaining = {name: _drop_before(b, float(at[-1])) for name, b in buffered.items()}
    return Waiting(waiting.magnetometers, remaining, float(at[-1])), Readings(
        at, base, target, mag, age
    )


def flush(waiting: Waiting) -> Readings:
    """The instants still waiting: nothing more will come."""
    return take(waiting, [], -np.inf)[1]


def align_recording(
    magnetometers: tuple[str, ...], blocks: Sequence[Block], patience: float
) -> Readings:
    """All instants of a recording, with those that `take` would hold back."""
    waiting, first = take(Waiting(magnetometers, {}), blocks, patience)
    last = flush(waiting)
    return Readings(
        *(np.concatenate([getattr(first, f.name), getattr(last, f.name)]) for f in fields(Readings))
    )


def _find_stream(buffered: Mapping[str, Block], point: str, quantity: str) -> Block | None:
    """The stream with this point; of several the newest."""
    found = [
        b
        for b in buffered.values()
        if point in b.stream.sensors and quantity in b.stream.quantities
    ]
    return max(found, key=lambda b: b.t[-1], default=None)


def _interpolate_inertial(block: Block | None, point: str, at: Array) -> Array:
    """Gyroscope and accelerometer (n, 6) at the instants."""
    if block is None:
        return np.full((len(at), 6), np.nan)
    k = block.stream.sensors.index(point)
    return _interpolate(
        block, np.concatenate([block.of(GYR)[:, k], block.of(ACC)[:, k]], axis=1), at
    )


def _assign_magnetic(
    block: Block | None, point: str, at: Array, t_released: float
) -> tuple[Array, Array]:
    """A magnetometer (n, 3) at the first instant after each of its samples, NaN at the others; its
    age (n,) s."""
    if block is None or not len(block.t):
        return np.full((len(at), 3), np.nan), np.zeros(len(at))
    known, before = (
        np.searchsorted(block.t, t, side="right")
        for t in (at, np.concatenate([[t_released], at[:-1]]))
    )
    newest = np.maximum(known - 1, 0)
    age = at - block.t[newest]
    fresh = (known > before) & (age < MAX_GAP_PERIODS / block.stream.rate)
    values = block.of(MAG)[newest, block.stream.sensors.index(point)]
    return np.where(fresh[:, None], values, np.nan), np.where(fresh, age, 0.0)


def _interpolate(block: Block, values: Array, at: Array) -> Array:
    """Values (n, k) at the instants by linear interpolation; NaN in gaps, outside, and beside a
    missing sample."""
    t = block.t
    after = np.clip(np.searchsorted(t, at), 0, len(t) - 1)
    exact = t[after] == at
    before = np.where(exact, after, after - 1)
    step = t[after] - t[before]
    share = np.where(step > 0, at - t[before], 0.0) / np.where(step > 0, step, 1.0)
    found = values[before] + share[:, None] * (values[after] - values[before])
    outside = (before < 0) | (at > t[-1]) | (step > MAX_GAP_PERIODS / block.stream.rate)
    return np.asarray(
        np.where(
            (outside & ~exact)[:, None], np.nan, np.where(exact[:, None], values[after], found)
        )
    )


def _drop_before(block: Block, t: float) -> Block:
    """The samples from the last one up to t on."""
    first = max(int(np.searchsorted(block.t, t, side="right")) - 1, 0)
    return Block(block.stream, block.t[first:], block.values[first:])


def _empty_readings(count: int) -> Readings:
    return Readings(
        np.empty(0),
        np.empty((0, 6)),
        np.empty((0, 6)),
        np.empty((0, count, 3)),
        np.empty((0, count)),
    )
