"""Streams of trunk and hand, each of its own rate, brought to the instants at which the hand's sensor was read: what magnet_tracking.py takes.

In      blocks of streams: the hand's and the trunk's inertial sensor, magnetometers on the trunk; in any order, cut anywhere
Out     magnet_tracking.Readings at the hand's instants
Source  ours: inertial samples by straight lines between neighbouring ones. A magnetometer's sample is told as it was read, at the first instant of the hand behind it
        and with its age: a line between two samples has less noise than either, and shares it with the next one, so that the filter would be too sure
Limits  a stream that stays away for longer than the patience is missing at those instants, also when its samples come later
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from handscope.estimators.data.samples import (
    ACC,
    GYR,
    MAG,
    TRUNK,
    TRUNK_MAGNETOMETERS,
    Block,
    Stream,
    join,
)
from handscope.estimators.magnet.tracker.tracker import Readings
from handscope.estimators.numerics.typing import Array

HOLE = 2.5  # periods between two samples that are still neighbours
HAND = "hand"


@dataclass(frozen=True)
class Waiting:
    """What was read and not yet told: save it, go on from it."""

    magnetometers: tuple[str, ...]  # in the order of the readings
    held: Mapping[str, Block]  # by stream, from the last sample that was used
    told: float = -np.inf  # s, newest instant told


def concerned(stream: Stream) -> bool:
    """Whether a stream has anything to tell here."""
    inertial = stream.inertial and bool({HAND, TRUNK} & set(stream.sensors))
    return inertial or (
        MAG in stream.quantities and any(p in (TRUNK, *TRUNK_MAGNETOMETERS) for p in stream.sensors)
    )


def magnetometers(streams: Sequence[Stream]) -> tuple[str, ...]:
    """The magnetometers on the trunk that are read, in the order of their numbers."""
    read = {p for s in streams if MAG in s.quantities for p in s.sensors}
    return tuple(p for p in (TRUNK, *TRUNK_MAGNETOMETERS) if p in read)


def take(waiting: Waiting, blocks: Sequence[Block], patience: float) -> tuple[Waiting, Readings]:
    """Take blocks in; tell the instants at which all streams are known, or for which nobody waits any longer (s)."""
    held = dict(waiting.held)
    for block in blocks:
        if concerned(block.stream) and len(block.t):
            name = block.stream.name
            held[name] = (
                join([held[name], block])
                if name in held and held[name].stream == block.stream
                else block
            )
    hand = _of(held, HAND, GYR)
    if hand is None:
        return replace(waiting, held=held), _nothing(len(waiting.magnetometers))
    awaited = [(HAND, GYR), (TRUNK, GYR), *((point, MAG) for point in waiting.magnetometers)]
    newest = [
        -np.inf if (b := _of(held, point, quantity)) is None else float(b.t[-1])
        for point, quantity in awaited
    ]
    known = max(min(newest), max(newest) - patience)
    at = hand.t[(hand.t > waiting.told) & (hand.t <= known)]
    if not len(at):
        return replace(waiting, held=held), _nothing(len(waiting.magnetometers))
    base, target = (_inertial(_of(held, point, GYR), point, at) for point in (TRUNK, HAND))
    read = [
        _magnetic(_of(held, point, MAG), point, at, waiting.told) for point in waiting.magnetometers
    ]
    mag, age = (
        np.stack([values for values, _ in read], axis=1),
        np.stack([old for _, old in read], axis=1),
    )
    kept = {name: _from(b, float(at[-1])) for name, b in held.items()}
    return Waiting(waiting.magnetometers, kept, float(at[-1])), Readings(at, base, target, mag, age)


def rest(waiting: Waiting) -> Readings:
    """The instants still held back: nothing more will come."""
    return take(waiting, [], -np.inf)[1]


def whole(magnetometers: tuple[str, ...], blocks: Sequence[Block], patience: float) -> Readings:
    """All instants of a recording, with those that `take` would hold back."""
    waiting, first = take(Waiting(magnetometers, {}), blocks, patience)
    last = rest(waiting)
    return Readings(
        *(np.concatenate([getattr(first, f.name), getattr(last, f.name)]) for f in fields(Readings))
    )


def _of(held: Mapping[str, Block], point: str, quantity: str) -> Block | None:
    """The stream with this point; of several the newest."""
    found = [
        b for b in held.values() if point in b.stream.sensors and quantity in b.stream.quantities
    ]
    return max(found, key=lambda b: b.t[-1], default=None)


def _inertial(block: Block | None, point: str, at: Array) -> Array:
    """Gyroscope and accelerometer (n, 6) at the instants."""
    if block is None:
        return np.full((len(at), 6), np.nan)
    k = block.stream.sensors.index(point)
    return _between(block, np.concatenate([block.of(GYR)[:, k], block.of(ACC)[:, k]], axis=1), at)


def _magnetic(block: Block | None, point: str, at: Array, told: float) -> tuple[Array, Array]:
    """A magnetometer (n, 3) at the first instant behind each of its samples, NaN at the others; how old they are then (n,) s."""
    if block is None or not len(block.t):
        return np.full((len(at), 3), np.nan), np.zeros(len(at))
    known, before = (
        np.searchsorted(block.t, t, side="right") for t in (at, np.concatenate([[told], at[:-1]]))
    )
    newest = np.maximum(known - 1, 0)
    age = at - block.t[newest]
    fresh = (known > before) & (age < HOLE / block.stream.rate)
    values = block.of(MAG)[newest, block.stream.sensors.index(point)]
    return np.where(fresh[:, None], values, np.nan), np.where(fresh, age, 0.0)


def _between(block: Block, values: Array, at: Array) -> Array:
    """Values (n, k) at the instants by straight lines; NaN in holes, outside, and beside a missing sample."""
    t = block.t
    after = np.clip(np.searchsorted(t, at), 0, len(t) - 1)
    exact = t[after] == at
    before = np.where(exact, after, after - 1)
    step = t[after] - t[before]
    share = np.where(step > 0, at - t[before], 0.0) / np.where(step > 0, step, 1.0)
    found = values[before] + share[:, None] * (values[after] - values[before])
    outside = (before < 0) | (at > t[-1]) | (step > HOLE / block.stream.rate)
    return np.asarray(
        np.where(
            (outside & ~exact)[:, None], np.nan, np.where(exact[:, None], values[after], found)
        )
    )


def _from(block: Block, t: float) -> Block:
    """The samples from the last one up to t on."""
    first = max(int(np.searchsorted(block.t, t, side="right")) - 1, 0)
    return Block(block.stream, block.t[first:], block.values[first:])


def _nothing(count: int) -> Readings:
    return Readings(
        np.empty(0),
        np.empty((0, 6)),
        np.empty((0, 6)),
        np.empty((0, count, 3)),
        np.empty((0, count)),
    )
