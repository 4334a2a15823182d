"""Readings of all sensors cut into short windows, each sensor's in the frame that it had where its window began.

In      blocks of all inertial streams, gyroscope biases where known
Out     per window and sensor: specific force, and what an arm of one metre along each axis would add to it, as time series in a frame that does not turn
Source  acceleration of a point of a rigid body; rates integrated within a window only, so that biases do not accumulate
Limits  samples that are missing or saturated are bridged by splines; windows that miss more than `MOST_MISSING`, or a stretch longer than `LONGEST_GAP`, are left out
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors.missing_samples import is_complete

RATE = 100.0  # Hz, of the common time base
LENGTH = 1.0  # s, of a window
MOST_WINDOWS = 60  # of a recording, those with most movement: what longer ones cost
AVERAGED = 4  # samples of the common time base that make one of a window's: 25 Hz
LONGEST_GAP = 0.08  # s
MOST_MISSING = 0.3
QUIET = 0.06  # rad/s, largest standard deviation of a rate's axis in a second of rest
BIAS = 0.2  # rad/s, largest zero-rate level that a second of rest may tell


@dataclass(frozen=True)
class Series:
    """All sensors on one time base."""

    t: Array  # (n,) s
    sensors: tuple[str, ...]
    gyr: Array  # (n, S, 3) rad/s, biases removed
    change: Array  # (n, S, 3) rad/s^2, derivative of the rates
    acc: Array  # (n, S, 3) m/s^2
    whole: NDArray[np.bool_]  # (n, S) near a sample that is there
    chosen: NDArray[np.int_]  # (K,) numbers of the windows that are looked at, in order


@dataclass(frozen=True)
class Windows:
    """K windows of m instants, of sensors in their frames at the beginning of the window."""

    t: Array  # (K,) s, beginnings
    force: Array  # (K, m, 3) m/s^2
    arm: Array  # (K, m, 3, 3) m/s^2 for an arm of 1 m along the sensor's x, y, z
    turned: Array  # (K, m, 3, 3) sensor frame at the window's beginning <- sensor frame
    rate: Array  # (K, m, 3) rad/s
    valid: NDArray[np.bool_]  # (K,)


def common_series(blocks: Sequence[Block], bias: Mapping[str, Array]) -> Series | None:
    """Bring the segments' sensors to one time base.

    Parameters
    ----------
    blocks : sequence of Block
        Samples of any streams, in order for each stream.
    bias : mapping
        Gyroscope biases (3,) rad/s by segment; of others the quietest second tells it, where there is one.

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
    seen = [
        (b, k, name)
        for b in inertial
        for k, name in enumerate(b.stream.sensors)
        if name in SEGMENTS
    ]
    if len(seen) < 2:
        return None
    begin, end = min(float(b.t[0]) for b in inertial), max(float(b.t[-1]) for b in inertial)
    t = begin + np.arange(int((end - begin) * RATE)) / RATE
    read = {name: _sampled(b, k, t, bias.get(name)) for b, k, name in seen}
    names = tuple(s for s in SEGMENTS if s in read)
    gyr, change, acc, whole = (
        np.stack([read[s][part] for s in names], axis=1) for part in range(4)
    )
    chosen = most_moved(gyr)
    return Series(t, names, gyr, change, acc, whole.astype(bool), chosen)


def most_moved(gyr: Array) -> NDArray[np.int_]:
    """Numbers (K,) of the windows in which sensors turn most, each against its own whole recording; all where they are few."""
    m = round(LENGTH * RATE)
    count = len(gyr) // m
    if count <= MOST_WINDOWS:
        return np.arange(count)
    turned = (gyr[: count * m] ** 2).sum(axis=2).reshape(count, m, -1).mean(axis=1)
    share = (turned / np.maximum(turned.sum(axis=0), 1e-12)).sum(axis=1)
    return np.sort(np.argsort(-share, kind="stable")[:MOST_WINDOWS])


def _sampled(
    block: Block, k: int, t: Array, bias: Array | None
) -> tuple[Array, Array, Array, Array]:
    """Rates, their derivatives, specific forces (n, 3), and where samples are near (n,)."""
    good = is_complete(block)[:, k] & ~block.at_limit(GYR)[:, k] & ~block.at_limit(ACC)[:, k]
    good &= np.concatenate([[True], np.diff(block.t) > 0])
    if good.sum() < 10:
        return (*np.zeros((3, len(t), 3)), np.zeros(len(t)))
    at = block.t[good]
    gyr, acc = block.of(GYR)[good, k], block.of(ACC)[good, k]
    gyr = gyr - (_resting_rate(at, gyr) if bias is None else bias)
    inside = np.clip(t, at[0], at[-1])
    spline = CubicSpline(at, np.concatenate([gyr, acc], axis=1))
    both, slope = spline(inside), spline(inside, 1)
    after = np.clip(np.searchsorted(at, t), 1, len(at) - 1)
    near = (at[after] - at[after - 1] < LONGEST_GAP) & (t >= at[0]) & (t <= at[-1])
    return both[:, :3], slope[:, :3], both[:, 3:], near


def _resting_rate(t: Array, gyr: Array) -> Array:
    """Mean rate (3,) of the quietest second; zero where no second is quiet."""
    edges = np.searchsorted(t, np.arange(t[0], t[-1] - 1.0, 0.5))
    seconds = [gyr[a:b] for a, b in zip(edges, np.searchsorted(t, t[edges] + 1.0)) if b - a > 10]
    spread = [float(s.std(axis=0).max()) for s in seconds]
    if not spread or min(spread) > QUIET:
        return np.zeros(3)
    mean = np.asarray(seconds[int(np.argmin(spread))].mean(axis=0))
    return mean if np.linalg.norm(mean) < BIAS else np.zeros(3)


def cut(series: Series, sensor: int, late: float = 0.0) -> Windows:
    """Cut one sensor's series into windows; with `late` (s) its readings are taken from that much later."""
    m = round(LENGTH * RATE)
    shift, first = round(late * RATE), series.chosen * m
    rows = first[:, None] + np.arange(m) + shift
    inside = (rows >= 0).all(axis=1) & (rows < len(series.t)).all(axis=1)
    rows = np.clip(rows, 0, len(series.t) - 1)
    gyr, change, acc = (v[rows, sensor] for v in (series.gyr, series.change, series.acc))
    valid = inside & (series.whole[rows, sensor].mean(axis=1) > 1 - MOST_MISSING)
    turned = quat.matrix(_integrated(gyr))
    tensor = quat.skew(change) + quat.skew(gyr) @ quat.skew(gyr)
    force, arm = np.einsum("kmij,kmj->kmi", turned, acc), turned @ tensor
    middle = turned[:, AVERAGED // 2 :: AVERAGED]
    return Windows(
        series.t[np.minimum(first, len(series.t) - 1)],
        _averaged(force),
        _averaged(arm),
        middle,
        _averaged(gyr),
        valid,
    )


def _integrated(gyr: Array) -> Array:
    """Orientation (K, m, 4) of the sensor in its frame at the first instant, rates (K, m, 3)."""
    steps = quat.exp(0.5 * (gyr[:, 1:] + gyr[:, :-1]) / RATE)
    q = np.tile(quat.IDENTITY, (*gyr.shape[:2], 1))
    for k in range(steps.shape[1]):
        q[:, k + 1] = quat.multiply(q[:, k], steps[:, k])
    return q


def _averaged(values: Array) -> Array:
    K, m = values.shape[:2]
    return np.asarray(values.reshape(K, m // AVERAGED, AVERAGED, *values.shape[2:]).mean(axis=2))
