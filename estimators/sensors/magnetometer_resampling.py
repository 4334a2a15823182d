"""Bring magnetometer samples to the instants of the inertial samples, whatever stream and rate they
come in.

In      blocks of inertial and magnetic streams, interleaved anyhow
Out     inertial blocks with the magnetometer as a third quantity: the newest sample not after each
        instant, NaN where it is older than MOST_AGE
Limits  an inertial sample waits until the magnetometers of its sensors have got that far; `release`
        stops the waiting of a live view
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, MAG, Block, Stream, join
from handscope.estimators.numerics.typing import Array

MOST_AGE = 0.25  # s that a magnetometer sample counts
MOST_KEPT = 600.0  # s of magnetometer samples that are kept for a stream that has not got that far


@dataclass(frozen=True)
class State:
    """Inertial samples that wait and magnetometer samples that are still needed, by stream name."""

    serving: Mapping[str, tuple[str, int]]  # sensor -> magnetic stream and its column there
    waiting: Mapping[str, Block] = field(default_factory=dict)
    magnetic: Mapping[str, Block] = field(default_factory=dict)
    # s, newest inertial sample given of each stream: others may still come from there on
    given: Mapping[str, float] = field(default_factory=dict)


def start(streams: tuple[Stream, ...]) -> State:
    """Which magnetic stream serves which sensor; a stream that has all three quantities serves
    itself."""
    separate = [s for s in streams if MAG in s.quantities and not s.inertial]
    serving = {sensor: (s.name, k) for s in separate for k, sensor in enumerate(s.sensors)}
    return State(serving, given={s.name: -np.inf for s in streams if s.inertial})


def joined_stream(stream: Stream) -> Stream:
    """The inertial stream as it leaves here."""
    return replace(stream, quantities=(GYR, ACC, MAG))


def step(state: State, *blocks: Block) -> tuple[State, list[Block]]:
    """Take blocks of any streams and give the inertial blocks that are complete."""
    complete = []
    for block in blocks:
        state, given = _take(state, block)
        complete += given
    return state, complete


def _take(state: State, block: Block) -> tuple[State, list[Block]]:
    if not len(block.t):
        return state, []
    if block.stream.inertial:
        waiting = state.waiting.get(block.stream.name)
        block = (
            block if waiting is None or waiting.stream != block.stream else join([waiting, block])
        )
        return _give(
            replace(state, waiting={**state.waiting, block.stream.name: block}), {block.stream.name}
        )
    if MAG not in block.stream.quantities:
        return state, []
    known = state.magnetic.get(block.stream.name)
    block = block if known is None or known.stream != block.stream else join([known, block])
    return _give(
        replace(state, magnetic={**state.magnetic, block.stream.name: block}), set(state.waiting)
    )


def release(state: State, patience: float) -> tuple[State, list[Block]]:
    """Give out inertial samples older than `patience` s against the newest although their
    magnetometer is silent."""
    newest = max((b.t[-1] for b in state.waiting.values()), default=-np.inf)
    return _give(state, set(state.waiting), newest - patience)


def _give(state: State, names: set[str], anyway: float = -np.inf) -> tuple[State, list[Block]]:
    waiting, newest, given = dict(state.waiting), dict(state.given), []
    for name in sorted(names):
        block = waiting.pop(name)
        count = int(
            np.searchsorted(block.t, max(_known_until(state, block.stream), anyway), side="right")
        )
        if count < len(block.t):
            waiting[name] = Block(block.stream, block.t[count:], block.values[count:])
        if count:
            given.append(
                _add_magnetometer(state, Block(block.stream, block.t[:count], block.values[:count]))
            )
            newest[name] = float(block.t[count - 1])
    needed = min(newest.values(), default=-np.inf)
    magnetic = {
        n: _prune(b, max(needed, float(b.t[-1]) - MOST_KEPT)) for n, b in state.magnetic.items()
    }
    return replace(state, waiting=waiting, magnetic=magnetic, given=newest), given


def _known_until(state: State, stream: Stream) -> float:
    """Up to when the magnetometers of a stream's sensors are known."""
    if MAG in stream.quantities:
        return float("inf")
    serving = {state.serving[s][0] for s in stream.sensors if s in state.serving}
    return min(
        (float(state.magnetic[n].t[-1]) if n in state.magnetic else -np.inf for n in serving),
        default=np.inf,
    )


def _add_magnetometer(state: State, block: Block) -> Block:
    stream = joined_stream(block.stream)
    parts = [
        block.of(GYR),
        block.of(ACC),
        block.of(MAG) if MAG in block.stream.quantities else _newest_samples(state, block),
    ]
    return Block(stream, block.t, np.concatenate(parts, axis=-1))


def _newest_samples(state: State, block: Block) -> Array:
    """The newest magnetometer sample of each sensor at each instant (n, sensors, 3)."""
    held = np.full((len(block.t), len(block.stream.sensors), 3), np.nan)
    served: dict[str, list[tuple[int, int]]] = {}
    for k, sensor in enumerate(block.stream.sensors):
        if sensor in state.serving:
            name, column = state.serving[sensor]
            served.setdefault(name, []).append((k, column))
    for name in served.keys() & state.magnetic.keys():
        source, (sensors, columns) = (
            state.magnetic[name],
            (np.array(each) for each in zip(*served[name])),
        )
        newest = np.searchsorted(source.t, block.t, side="right") - 1
        usable = np.flatnonzero(
            (newest >= 0) & (block.t - source.t[np.maximum(newest, 0)] <= MOST_AGE)
        )
        held[usable[:, None], sensors] = source.of(MAG)[newest[usable][:, None], columns]
    return held


def _prune(block: Block, t: float) -> Block:
    """Forget what lies before the last sample not after t."""
    first = max(int(np.searchsorted(block.t, t, side="right")) - 1, 0)
    return Block(block.stream, block.t[first:], block.values[first:])
