"""Movements known in closed form: any instant of them is exact, whatever the rate."""

from collections.abc import Callable

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import FINGERS, JOINTS, SEGMENTS, Hand
from handscope.estimators.measures.synchronisation import Signal
from handscope.estimators.numerics.typing import Array

Movement = Callable[[Array], Array]  # s -> (n, channels) rad


def movement(seed: int, channels: int = 3, fastest: float = 2.5) -> Movement:
    """Twelve sines a channel of up to `fastest` Hz: repeats itself nowhere."""
    rng = np.random.default_rng(seed)
    frequency, phase = (
        rng.uniform(0.1, fastest, (12, channels)),
        rng.uniform(0, 2 * np.pi, (12, channels)),
    )
    size = rng.uniform(0.02, 0.15, (12, channels))
    return lambda t: (size * np.sin(2 * np.pi * frequency * t[:, None, None] + phase)).sum(axis=1)


def sampled(move: Movement, start: float, stop: float, rate: float, clock: float = 0.0) -> Signal:
    """What happened from `start` to `stop`, told by a clock that reads `clock` less."""
    t = np.arange(start, stop, 1 / rate)
    return Signal(t - clock, move(t))


def moving(t: Array, index: Array, hand: Hand = "left", tips: Array | None = None) -> Trajectory:
    """A trajectory of three angles (n, 3) of the index finger: MCP flexion, MCP deviation, PIP flexion."""
    n = len(t)
    angles = np.full((n, len(JOINTS), 3), np.nan)
    names = [joint.name for joint in JOINTS]
    mcp, pip = names.index("index_mcp"), names.index("index_pip")
    angles[:, mcp, 0], angles[:, mcp, 1], angles[:, pip, 0] = index.T
    places = np.full((n, len(FINGERS), 3), np.nan) if tips is None else tips
    return Trajectory(
        hand,
        t,
        angles,
        np.full((n, len(SEGMENTS), 4), np.nan),
        places,
        np.zeros((n, len(SEGMENTS)), np.uint8),
    )
