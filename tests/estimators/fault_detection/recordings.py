"""Recordings for the tests of the checks, made once, and what can be wrong with them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.movements import free_movement
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import SensorErrors

Spoil = Callable[[Array], Array]


@cache
def moved_freely(seed: int = 3, duration: float = 20.0) -> tuple[Block, ...]:
    """A hand that moves freely, without a forearm's sensor."""
    geometry = sized("right")
    made = free_movement.record_trial(
        np.random.default_rng(seed), SensorErrors(), "right", geometry, geometry, duration=duration
    )
    return tuple(made.blocks())


@cache
def performed(*tasks: str) -> tuple[Block, ...]:
    """Tasks one after the other."""
    return tuple(
        simulate(tasks, "left", sized("left"), np.random.default_rng(8), SensorErrors()).blocks()
    )


def with_readings(
    blocks: Sequence[Block],
    quantity: str,
    spoil: Spoil,
    sensor: str | None = None,
    since: float = 0.0,
) -> list[Block]:
    """Blocks whose readings (n, 3) of a quantity, of one sensor or of all, are spoilt from an instant on."""
    out = []
    for block in blocks:
        values, rows = block.values.copy(), block.t >= since
        for k, name in enumerate(block.stream.sensors):
            if sensor in (None, name):
                axes = block.stream.axes(quantity)
                values[rows, k, axes] = spoil(values[rows, k, axes])
        out.append(replace(block, values=values))
    return out


def by_matrix(M: Array) -> Spoil:
    return lambda readings: readings @ M.T


def without_rows(blocks: Sequence[Block], start: float, stop: float) -> list[Block]:
    """Rows dropped, the times going on as if nothing were missing."""
    return [
        replace(b, values=b.values[rows := (b.t < start) | (b.t >= stop)], t=b.t[: rows.sum()])
        for b in blocks
    ]


def frozen(blocks: Sequence[Block], start: float, stop: float) -> list[Block]:
    """All readings held for a while."""
    out = []
    for block in blocks:
        rows, values = np.flatnonzero((block.t >= start) & (block.t < stop)), block.values.copy()
        values[rows] = values[rows[0]]
        out.append(replace(block, values=values))
    return out


__all__ = [
    "ACC",
    "GYR",
    "by_matrix",
    "frozen",
    "moved_freely",
    "performed",
    "with_readings",
    "without_rows",
]
