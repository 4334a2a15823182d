"""Short turns about the axis of flexion that one sensor's gyroscope reads and its neighbours' do not: those of a sensor that turns on its segment, or of a single segment.

In      pairs of sensors (sensor_pairs.py)
Out     where such turns may be; which share of a given turn a sensor's rates show
Source  ours: a joint that bends carries what is beyond it, so that neighbours' rates have most of a movement in common; linear regression on them, on what goes on evenly and on the turn's course
Limits  where each joint moves as fast for itself there are such turns all the time; about other axes than that of flexion neighbours' rates are compared as if joints were straight
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours import joint_windows
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

BESIDE = 0.15  # s, before a turn and after it, that are looked at with it
TAKEN = 0.2  # s, that a turn takes, about: twice or half as long ones are found, too
STEP = 8  # samples from one instant that is asked to the next
RATE_NOISE = 0.1  # rad/s, that neighbours' rates are not proportional to each other; ours
SHARED_SD = 3.0  # times a neighbour's rate that a sensor's may be, so that what both have goes to the neighbour; ours
LEAST = np.radians(4.0)  # turns that are looked for
FEWEST = 4.0  # standard deviations that they have to be larger than none


@dataclass(frozen=True)
class IsolatedTurn:
    """A turn of a sensor that its neighbours do not share."""

    window: int  # its number
    middle: float  # s, from the window's beginning
    angle: float  # rad, about the axis of flexion


def find(pairs: Pairs, sensor: str) -> list[IsolatedTurn]:
    """Of each window of a sensor the turn that is larger than none most certainly, where one is."""
    count = round((TAKEN + 2 * BESIDE) * joint_windows.RATE)
    at = np.arange(count) / joint_windows.RATE
    axes = np.linalg.qr(_evenly(at))[0]
    rest = np.eye(count) - axes @ axes.T  # without what goes on evenly
    starts = np.arange(0, round(joint_windows.LENGTH * joint_windows.RATE) - count + 1, STEP)
    flexion = np.array([0.0, 0.0, 1.0])
    own, *others = (
        _pieces(pairs, rate_about(pairs, n, flexion), starts, count) @ rest
        for n in (sensor, *neighbours_of(pairs, sensor))
    )
    course = np.broadcast_to(rest @ turn_rate(at, BESIDE, TAKEN), own.shape)
    by = np.stack([course, *others], axis=-1)
    prior = np.diag([1.0, *[SHARED_SD**-2] * len(others)])
    normal = np.swapaxes(by, -1, -2) @ by + RATE_NOISE**2 * prior
    right = (own[..., None, :] @ by)[..., 0, :]
    inverse = np.linalg.inv(normal)
    share = (inverse @ right[..., None])[..., 0]
    left = np.maximum((own**2).sum(axis=-1) - (share * right).sum(axis=-1), 0.0)
    sd = np.sqrt((left / count + RATE_NOISE**2) * inverse[..., 0, 0])
    turn = np.abs(share[..., 0])
    sure = np.where(turn > LEAST, turn / sd, 0.0)
    best = sure.argmax(axis=1)
    return [
        IsolatedTurn(
            int(k),
            float(starts[best[k]] / joint_windows.RATE + BESIDE + TAKEN / 2),
            float(share[k, best[k], 0]),
        )
        for k in np.flatnonzero(sure.max(axis=1) > FEWEST)
    ]


def _pieces(pairs: Pairs, rate: Array, starts: NDArray[np.int_], count: int) -> Array:
    """Of rates (n,) in each window the pieces (K, starts, count) from some samples on."""
    first = pairs.series.chosen * round(joint_windows.LENGTH * joint_windows.RATE)
    rows = first[:, None, None] + starts[:, None] + np.arange(count)
    return np.asarray(rate[np.minimum(rows, len(rate) - 1)])


def share_seen(
    pairs: Pairs, sensor: str, window: int, turn: Array, begin: float, length: float
) -> tuple[float, float]:
    """Which share of a turn (3,) rad in its frame, `begin` s after a window's beginning, a sensor's rates show about its axis beyond what they have in common with its neighbours', and the standard deviation of that share."""
    series = pairs.series
    at = np.arange(begin - BESIDE, begin + length + BESIDE, 1 / joint_windows.RATE)
    first = round(series.chosen[window] * joint_windows.LENGTH * joint_windows.RATE)
    rows = first + np.round(at * joint_windows.RATE).astype(int)
    kept = (rows >= 0) & (rows < len(series.t))
    at, rows, size = at[kept], rows[kept], float(np.linalg.norm(turn))
    axis = quat.rotate(pairs.q_BS[sensor], turn / size)
    others = [rate_about(pairs, n, axis)[rows] for n in neighbours_of(pairs, sensor)]
    course = size * turn_rate(at, begin, length)
    by = np.stack([course, *_evenly(at).T, *others], axis=1)
    prior = np.diag([1.0, 1.0, 1.0, 1.0, *[SHARED_SD**-2] * len(others)])
    normal = by.T @ by + RATE_NOISE**2 * prior
    own = rate_about(pairs, sensor, axis)[rows]
    share = np.linalg.solve(normal, by.T @ own)
    left = float(((own - by @ share) ** 2).mean()) + RATE_NOISE**2
    return float(share[0]), float(np.sqrt(left * np.linalg.inv(normal)[0, 0]))


def neighbours_of(pairs: Pairs, sensor: str) -> Sequence[str]:
    """The sensors that it shares a joint with."""
    return [n for joint in pairs.joints_of(sensor) for n in joint if n != sensor]


def turn_rate(at: Array, begin: float, length: float) -> Array:
    """Rates (n,) 1/s of a turn of 1 at some instants (s), as that of a cubic from `begin` (s) on."""
    u = np.clip((at - begin) / length, 0.0, 1.0)
    return np.asarray(6 * u * (1 - u) / length)


def rate_about(pairs: Pairs, sensor: str, axis: Array) -> Array:
    """A sensor's rates (n,) rad/s about an axis (3,) of its segment."""
    own = quat.rotate(quat.conjugate(pairs.q_BS[sensor]), axis)
    return np.asarray(pairs.series.gyr[:, pairs.series.sensors.index(sensor)] @ own)


def _evenly(at: Array) -> Array:
    """What goes on evenly (n, 3): constant, linear and quadratic."""
    along = (at - at.mean()) / BESIDE
    return np.stack([np.ones_like(at), along, along**2], axis=1)
