"""Simulated recordings for the checks of sensors against each other, and faults put into them."""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.hand.geometry import HandGeometry, sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.simulation.movements import free_movement
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors


@cache
def freely_moved(seed: int = 3, duration: float = 24.0) -> Simulated:
    """A hand that is carried about while every finger bends."""
    geometry: HandGeometry = sized("left")
    return free_movement.record_trial(
        np.random.default_rng(seed), SensorErrors(), "left", geometry, geometry, duration=duration
    )


def exchanged(recording: Simulated, a: str, b: str) -> list[Block]:
    return _changed(recording, lambda block, values: _exchange(block.stream.sensors, values, a, b))


def delayed(recording: Simulated, sensors: Sequence[str], late: float) -> list[Block]:
    def change(block: Block, values: np.ndarray) -> None:
        for name in sensors:
            k = block.stream.sensors.index(name)
            values[:, k] = np.stack(
                [np.interp(block.t - late, block.t, c) for c in values[:, k].T], axis=1
            )

    return _changed(recording, change)


def delayed_from(
    begin: float, recording: Simulated, sensors: Sequence[str], late: float
) -> list[Block]:
    """The same from `begin` s on."""
    blocks = []
    for before, after in zip(recording.blocks(), delayed(recording, sensors, late)):
        rows = (before.t < begin)[:, None, None]
        blocks.append(Block(before.stream, before.t, np.where(rows, before.values, after.values)))
    return blocks


def amplified(
    recording: Simulated, sensor: str, gain: float, span: tuple[float, float] = (-np.inf, np.inf)
) -> list[Block]:
    """A gyroscope that reads too much, within a span (s)."""

    def change(block: Block, values: np.ndarray) -> None:
        rows = (block.t >= span[0]) & (block.t < span[1])
        k, axes = block.stream.sensors.index(sensor), block.stream.axes(GYR)
        values[:, k, axes] *= np.where(rows, gain, 1.0)[:, None]

    return _changed(recording, change)


def loosened(recording: Simulated, sensor: str) -> list[Block]:
    """A sensor that rattles: it sees accelerations that no rigid segment has, with the size of a slow swing."""

    def change(block: Block, values: np.ndarray) -> None:
        k = block.stream.sensors.index(sensor)
        values[:, k, block.stream.axes(ACC)] += 1.5 * np.sin(2 * np.pi * 1.7 * block.t)[:, None]

    return _changed(recording, change)


def knocked(recording: Simulated, sensor: str, at: float) -> list[Block]:
    """A sensor that something knocks against for 0.3 s."""

    def change(block: Block, values: np.ndarray) -> None:
        rows = (block.t >= at) & (block.t < at + 0.3)
        k, axes = block.stream.sensors.index(sensor), block.stream.axes(ACC)
        values[rows, k, axes] += 10.0 * np.sin(2 * np.pi * 5 * block.t[rows])[:, None]

    return _changed(recording, change)


def slipped(recording: Simulated, sensor: str, degrees: float, start: float) -> list[Block]:
    """Turned about the axis of flexion at `start` s."""
    R = quat.matrix(quat.about(2, np.array(np.radians(degrees))))

    def change(block: Block, values: np.ndarray) -> None:
        k, later = block.stream.sensors.index(sensor), block.t >= start
        values[later, k] = (values[later, k].reshape(-1, 2, 3) @ R).reshape(-1, 6)

    return _changed(recording, change)


def _exchange(names: Sequence[str], values: np.ndarray, a: str, b: str) -> None:
    i, j = names.index(a), names.index(b)
    values[:, [i, j]] = values[:, [j, i]]


def _changed(recording: Simulated, change: Callable[[Block, np.ndarray], None]) -> list[Block]:
    found = []
    for block in recording.blocks():
        values = block.values.copy()
        change(block, values)
        found.append(Block(block.stream, block.t, values))
    return found
