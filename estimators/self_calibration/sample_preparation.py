"""Resampling of a recording's streams to uniform samples of one finger's sensors and the hand's.

In      whole inertial streams, a stretch of time
Out     Readings at about 100 Hz; missing and clipped samples are bridged and get a large noise factor
Source  streams with clocks of their own are brought to the hand's samples by cubics through four samples (Lagrange); means of faster samples:
        sensors/mean_readings.py
Limits  sensors' noise is taken to be white, of the same density at every rate: a mean over faster samples is as noisy as one sample at the mean's rate
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.held_contact import HeldContact
from handscope.estimators.data.samples import ACC, GYR, SATURATION, Block, every, exceeds
from handscope.estimators.numerics.typing import Array, Bools
from handscope.estimators.orientation.resampling import fit_times
from handscope.estimators.self_calibration.problem import Chain, Readings, build_chain
from handscope.estimators.sensors import saturation
from handscope.estimators.sensors.mean_readings import correct_means

RATE = 100.0  # Hz, as in the thesis: faster samples are averaged to about this rate
DOUBTFUL = 1e3  # factor on the noise of a missing or clipped sample
# s, of missing samples that are bridged; after a longer one a sensor's heading is another
LONGEST_GAP = 0.06
MARGIN = 0.5  # s beside a stretch from which samples are taken
LINED = 100  # samples by which an even clock is recognised
FAST = 0.99  # share of the power of angular rates
EXCITATION_PERIOD = 1.0  # s over which movement is summed up


@dataclass(frozen=True)
class Gap:
    """Missing samples of one sensor, s."""

    sensor: str
    start: float
    stop: float


def prepare_readings(
    blocks: Sequence[Block], sensors: Sequence[str], start: float, stop: float
) -> tuple[Array, Readings]:
    """Times (n,) and readings of these sensors between two instants, s; doubt counts from the noise of a sample at RATE."""
    worn = [
        resample_uniform(b.between(start - MARGIN, stop + MARGIN))
        for b in blocks
        if b.stream.inertial
    ]
    where = {name: (b, k) for b in worn for k, name in enumerate(b.stream.sensors)}
    reference = where[sensors[0]][0].between(start, stop).t
    period = float(np.median(np.diff(reference)))
    grid = reference[0] + period * np.arange(round((reference[-1] - reference[0]) / period) + 1)
    values, doubts = zip(*(_resample_sensor(where[s][0], where[s][1], grid) for s in sensors))
    each = max(1, round(1 / period / RATE))
    n = len(grid) // each * each
    t, v, d = (
        x[:n].reshape(n // each, each, *x.shape[1:]).mean(axis=1)
        for x in (grid, np.stack(values, 1), np.stack(doubts, 1))
    )
    noisier = 1 / np.sqrt(each * period * RATE)
    v = correct_means(v, each)
    return t, Readings(
        each * period, v[..., :3], v[..., 3:], noisier * d[..., 0], noisier * d[..., 1]
    )


def is_free(held: Sequence[HeldContact], t: Array, gyr: Array, moving: float) -> Bools:
    """At which instants t (n,) s of rates gyr (n, S, 3) the limb moves freely: all, but where contacts are held for calibration those only that turn, by `moving` rad/s, and are not held."""
    free = np.linalg.norm(gyr, axis=2).mean(axis=1) > moving
    for contact in held:
        free &= (t < contact.onset) | (t > contact.end)
    return free if held and free.any() else np.ones(len(t), bool)


def average_turning(gyr: Array) -> float:
    """Mean size (deg/s) of a sensor's angular rates (n, 3) rad/s about their mean; 0 without any."""
    if not len(gyr):
        return 0.0
    return float(np.degrees(np.linalg.norm(gyr - gyr.mean(axis=0), axis=1).mean()))


def fastest_turning(read: Readings) -> float:
    """Frequency (Hz) below which FAST of the power of the sensors' angular rates lies."""
    w = (read.gyr - read.gyr.mean(axis=0)) * np.hanning(len(read))[:, None, None]
    power = (np.abs(np.fft.rfft(w, axis=0)) ** 2).sum(axis=(1, 2)).cumsum()
    if power[-1] <= 0:
        return 0.0
    return float(np.searchsorted(power, FAST * power[-1]) / (len(read) * read.dt))


def resample_uniform(block: Block) -> Block:
    """The same samples at even times, where the time stamps scatter (of a host, of a radio) but the samples do not: the rates are smoother at even times."""
    if len(block.t) < LINED:
        return block
    even = fit_times(block)
    rates = block.of(GYR).reshape(len(block.t), -1)
    off = [float(np.nansum(_deviation_from_neighbours(t, rates) ** 2)) for t in (block.t, even)]
    return replace(block, t=even) if (np.diff(even) > 0).all() and off[1] < off[0] else block


def _deviation_from_neighbours(t: Array, values: Array) -> Array:
    """How far values (n, m) lie from the line between those before and behind (n-2, m)."""
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    return np.asarray(values[1:-1] - (1 - share) * values[:-2] - share * values[2:])


def drop_silent_sensors(
    blocks: Sequence[Block], links: Chain, start: float, stop: float
) -> tuple[Chain, tuple[str, ...]]:
    """The chain up to its first sensor that gives less than half of its samples; that and those behind it."""
    where = {
        name: (b.between(start, stop), k)
        for b in blocks
        if b.stream.inertial
        for k, name in enumerate(b.stream.sensors)
    }
    for k, name in enumerate(links.sensors):
        block, row = where[name]
        if any(
            _valid_samples(block, row, quantity).sum() < 0.5 * len(block.t)
            for quantity in (GYR, ACC)
        ):
            return build_chain(links.sensors[:k] or links.sensors[:1]), links.sensors[k:]
    return links, ()


def is_clipped(blocks: Sequence[Block], sensor: str, start: float, stop: float) -> bool:
    """Whether a sensor gives samples, but more than half of them stand at a limit."""
    block, k = next(
        (b.between(start, stop), b.stream.sensors.index(sensor))
        for b in blocks
        if b.stream.inertial and sensor in b.stream.sensors
    )
    whole = (
        [every(np.isfinite(block.of(quantity)[:, k])).mean() > 0.5 for quantity in (GYR, ACC)]
        if len(block.t)
        else [False]
    )
    return all(whole) and any(
        _valid_samples(block, k, quantity).mean() < 0.5 for quantity in (GYR, ACC)
    )


def _valid_samples(block: Block, k: int, quantity: str) -> Bools:
    """Which samples (n,) of a sensor are complete and not at its limit; where the stream states none, the limit is found from the sensor's readings."""
    values = block.of(quantity)[:, k : k + 1]
    clipped = exceeds(values, SATURATION * saturation.find_limits(block, quantity)[k : k + 1])[:, 0]
    return np.asarray(every(np.isfinite(values[:, 0])) & ~clipped)


def longest_gapless(blocks: Sequence[Block], start: float, stop: float) -> tuple[float, float]:
    """The longest part of a stretch without holes."""
    edge, best = start, (start, start)
    for begun, over in (
        *sorted((hole.start, hole.stop) for hole in find_gaps(blocks, start, stop)),
        (stop, stop),
    ):
        if begun - edge > best[1] - best[0]:
            best = (edge, begun)
        edge = max(edge, over)
    return best


def find_gaps(blocks: Sequence[Block], start: float, stop: float) -> list[Gap]:
    """Where sensors miss samples for longer than LONGEST_GAP; sensors that give less than half do not count."""
    found: list[Gap] = []
    for block in (b.between(start, stop) for b in blocks if b.stream.inertial):
        for k, name in enumerate(block.stream.sensors):
            t = block.t[
                every(np.isfinite(block.of(GYR)[:, k])) & every(np.isfinite(block.of(ACC)[:, k]))
            ]
            if len(t) > 0.5 * (stop - start) * block.stream.rate:
                t = np.concatenate([[start], t, [stop]])  # a sensor may begin late or end early
                found += [
                    Gap(name, float(t[i]), float(t[i + 1]))
                    for i in np.flatnonzero(np.diff(t) > LONGEST_GAP)
                ]
    return found


def most_excited_stretch(
    blocks: Sequence[Block], start: float, stop: float, longest: float
) -> tuple[float, float]:
    """The stretch of at most `longest` s with most turning."""
    if stop - start <= longest:
        return start, stop
    edges = np.arange(start, stop, EXCITATION_PERIOD)
    moved = np.zeros(len(edges))
    for block in (b for b in blocks if b.stream.inertial):
        size = np.nan_to_num(np.linalg.norm(block.of(GYR), axis=2)).mean(axis=1)
        place = np.floor((block.t - start) / EXCITATION_PERIOD).astype(int)
        inside = (place >= 0) & (place < len(edges))
        moved += np.bincount(place[inside], size[inside], minlength=len(edges)) / block.stream.rate
    sums = np.convolve(moved, np.ones(int(longest / EXCITATION_PERIOD)), "valid")
    first = float(edges[int(np.argmax(sums))])
    return first, first + longest


def _resample_sensor(block: Block, k: int, grid: Array) -> tuple[Array, Array]:
    """Readings (n, 6) of one sensor on the grid, and factors of doubt of gyroscope and accelerometer (n, 2)."""
    values, doubts = np.empty((len(grid), 6)), np.ones((len(grid), 2))
    for q, quantity in enumerate((GYR, ACC)):
        sampled, sound = block.of(quantity)[:, k], _valid_samples(block, k, quantity)
        t, known = block.t[sound], sampled[sound]
        values[:, 3 * q : 3 * q + 3] = _interpolate_cubic(t, known, grid, block.stream.rate)
        behind = np.clip(np.searchsorted(t, grid), 1, len(t) - 1)
        beside = np.maximum(np.abs(t[behind] - grid), np.abs(grid - t[behind - 1]))
        doubts[beside > 1.5 / block.stream.rate, q] = DOUBTFUL
    return values, doubts


def _interpolate_cubic(t: Array, known: Array, grid: Array, rate: float) -> Array:
    """Samples (m, 3) of instants t as of those of the grid: cubics through the four samples around each, straight lines where one of them is missing."""
    found = np.stack([np.interp(grid, t, axis) for axis in known.T], axis=1)
    behind = np.searchsorted(t, grid)
    inside = np.flatnonzero((behind >= 2) & (behind < len(t) - 1))
    four = behind[inside, None] + np.arange(-2, 2)
    whole = t[four[:, 3]] - t[four[:, 0]] < 3.5 / rate
    inside, four = inside[whole], four[whole]
    off, weights = grid[inside, None] - t[four], np.ones(four.shape)
    for k in range(4):
        for other in (j for j in range(4) if j != k):
            weights[:, k] *= off[:, other] / (t[four[:, k]] - t[four[:, other]])
    found[inside] = np.einsum("tk,tkx->tx", weights, known[four])
    return found
