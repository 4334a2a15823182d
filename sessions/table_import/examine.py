"""What the numbers of a mapped table say of its map, before anything is stored: rate, gaps, gravity, rates, rest.

In      blocks in SI that are possible at all (convert.py refuses others), the map
Out     messages in the order in which a person reads them, and the stretches at rest
Source  rules ours; a gyroscope must turn gravity as its accelerometer sees it turn: dg/dt = -w x g
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from handscope.estimators.data.samples import ACC, GYR, ORIENTATION, Block
from handscope.estimators.messages import Message, Value
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.sessions.table_import.column_map import FACTORS, ColumnMap
from handscope.sessions.table_import.convert import unit_of_gravity

AT_REST = np.radians(10)  # rad/s; a gyroscope's offset is less
REST = 1.0  # s, shortest rest
SMOOTHED = 0.25  # s
GAP = 1.5  # nominal steps; longer ones are gaps
UNEVEN = 0.1  # of a step, standard deviation of the steps
GRAVITY_OFF = 0.05  # share by which a sensor's gravity may differ without a word
CALM = 0.05  # share by which accelerations may differ from gravity where directions are compared
TURNING = 0.5  # rad that gravity must turn in all before a gyroscope is judged by it
FACTOR = 5.0  # between both rates, from which a unit is wrong
AGREEING = 0.3  # correlation of both rates of turn, below which axes or sensors are exchanged


@dataclass(frozen=True)
class Findings:
    """What was seen in the numbers of a mapped table."""

    messages: tuple[Message, ...]
    duration: float  # s
    rate: float  # Hz
    rests: tuple[tuple[float, float], ...]  # s, the longest first


def examine(blocks: Sequence[Block], columns: ColumnMap) -> Findings:
    """Findings about blocks of one table, which have the same times."""
    t, rate = blocks[0].t, blocks[0].stream.rate
    rests = _rests(blocks)
    messages = [
        *_timing(t, rate),
        *_gravity(blocks, columns, rests),
        *_turning(blocks),
        *_rest_words(rests),
    ]
    return Findings(tuple(messages), float(t[-1]), rate, rests)


def _timing(t: Array, rate: float) -> Iterator[Message]:
    values = {"rows": len(t), "seconds": float(t[-1]), "rate": rate}
    yield Message("import.seen_rate", values, "info")
    steps = np.diff(t) * rate
    gaps = np.flatnonzero(steps > GAP)
    if len(gaps):
        k = int(gaps[np.argmax(steps[gaps])])
        longest, onset = float(t[k + 1] - t[k]), float(t[k])
        gaps_seen = {"count": len(gaps), "longest": longest, "onset": onset}
        yield Message("import.seen_gaps", gaps_seen, "warning")
    even = steps[steps <= GAP]
    if len(even) and float(np.std(even)) > UNEVEN:
        spread = {"share": 100 * float(np.std(even))}
        yield Message("import.seen_uneven", spread, "warning")


def _gravity(
    blocks: Sequence[Block], columns: ColumnMap, rests: Sequence[tuple[float, float]]
) -> Iterator[Message]:
    """Gravity by unit, and each sensor whose gravity differs."""
    sizes: dict[str, float] = {}
    for block in (b for b in blocks if ACC in b.stream.quantities):
        norms = np.linalg.norm(block.of(ACC), axis=2)
        still = np.zeros(len(block.t), bool)
        for onset, end in rests:
            still |= (block.t >= onset) & (block.t <= end)
        found = np.nanmedian(norms[still] if still.any() else norms, axis=0)
        sizes |= dict(zip(block.stream.sensors, map(float, found)))
    units = {p: columns.sensors[p].channels[ACC].unit for p in sizes}
    readings = {p: size / FACTORS[ACC][units[p]] for p, size in sizes.items()}
    likely = {p: unit_of_gravity(reading) for p, reading in readings.items()}
    other = {p: unit for p, unit in likely.items() if unit is not None and unit != units[p]}
    for unit in dict.fromkeys(units[p] for p in sizes if p not in other):
        size = float(
            np.median([s for p, s in sizes.items() if units[p] == unit and p not in other])
        )
        values: dict[str, Value] = {"reading": size / FACTORS[ACC][unit], "unit": unit}
        if rests:
            yield Message("import.seen_gravity", values, "info")
        else:
            yield Message("import.seen_gravity_moving", values, "info")
    yield from _other_units(readings, units, other)
    for point, size in sizes.items():
        if point not in other and abs(size / GRAVITY - 1) > GRAVITY_OFF:
            off: dict[str, Value] = {"point": point, "share": 100 * abs(size / GRAVITY - 1)}
            yield Message("import.seen_gravity_off", off, "warning")


def _other_units(
    readings: Mapping[str, float], stated_units: Mapping[str, str], other: Mapping[str, str]
) -> Iterator[Message]:
    """Once for each unit that readings of gravity look like at points that are stated in another."""
    found: dict[tuple[str, str], list[str]] = {}
    for point, unit in other.items():
        found.setdefault((stated_units[point], unit), []).append(point)
    for (stated, unit), points in found.items():
        values: dict[str, Value] = {
            "points": ", ".join(points),
            "reading": float(np.median([readings[p] for p in points])),
            "stated": stated,
            "unit": unit,
        }
        yield Message("import.seen_gravity_unit", values, "warning")


def _turning(blocks: Sequence[Block]) -> Iterator[Message]:
    """The fastest rate, and gyroscopes that do not turn gravity as their accelerometers do."""
    fastest = [np.nanmax(np.abs(b.of(GYR))) for b in blocks if GYR in b.stream.quantities]
    if fastest:
        values = {"rates": float(np.degrees(max(fastest)))}
        yield Message("import.seen_rates", values, "info")
    for block in (b for b in blocks if b.stream.inertial):
        wide = max(3, round(SMOOTHED * block.stream.rate))
        for k, point in enumerate(block.stream.sensors):
            gyr, acc = _fill_forward(block.of(GYR)[:, k]), _fill_forward(block.of(ACC)[:, k])
            slope, correlation = _compare_turning(block.t, gyr, acc, wide)
            if not np.isfinite(slope):
                continue
            if correlation < AGREEING:
                yield Message("import.seen_disagreement", {"point": point}, "warning")
            elif slope >= FACTOR:
                small: dict[str, Value] = {"point": point, "factor": slope}
                yield Message("import.seen_rates_small", small, "warning")
            elif slope <= 1 / FACTOR:
                large: dict[str, Value] = {"point": point, "factor": 1 / slope}
                yield Message("import.seen_rates_large", large, "warning")


def _compare_turning(t: Array, gyr: Array, acc: Array, wide: int) -> tuple[float, float]:
    """How many times as fast gravity turns as the gyroscope says, and their correlation; NaN where it hardly turns.

    Only steps between samples that accelerate little count.
    """
    sizes = np.linalg.norm(acc, axis=1, keepdims=True)
    g = acc / np.maximum(sizes, 1e-9)
    calm = maximum_filter1d(np.abs(sizes[:, 0] / GRAVITY - 1), wide) < CALM
    seen = uniform_filter1d(np.gradient(g, t, axis=0), wide, axis=0)[calm]
    predicted = uniform_filter1d(-np.cross(gyr, g), wide, axis=0)[calm]
    power = float(np.sum(predicted**2))
    turned = float(np.sum(np.linalg.norm(seen, axis=1))) * float(np.median(np.diff(t)))
    if turned < TURNING or power == 0:
        return np.nan, np.nan
    both = float(np.sum(seen * predicted))
    return both / power, both / float(np.sqrt(power * np.sum(seen**2)))


def _rests(blocks: Sequence[Block]) -> tuple[tuple[float, float], ...]:
    """Stretches in which no sensor turns."""
    t, rate = blocks[0].t, blocks[0].stream.rate
    wide = max(3, round(SMOOTHED * rate))
    speeds = [s for b in blocks for s in _speeds(b)]
    if not speeds:
        return ()
    still = uniform_filter1d(np.max(speeds, axis=0), wide) < AT_REST
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    found = [(float(t[a]), float(t[b - 1])) for a, b in zip(edges[::2], edges[1::2])]
    return tuple(sorted((s for s in found if s[1] - s[0] >= REST), key=lambda s: s[0] - s[1]))


def _speeds(block: Block) -> Iterator[Array]:
    """Angular speeds (rows,) of each sensor, rad/s."""
    if GYR in block.stream.quantities:
        for k in range(len(block.stream.sensors)):
            yield np.linalg.norm(_fill_forward(block.of(GYR)[:, k]), axis=1)
    elif ORIENTATION in block.stream.quantities:
        steps = np.maximum(np.diff(block.t), 1e-6)
        for k in range(len(block.stream.sensors)):
            q = _fill_forward(block.of(ORIENTATION)[:, k])
            q = q / np.maximum(np.linalg.norm(q, axis=1, keepdims=True), 1e-9)
            turned = np.linalg.norm(quat.log(quat.multiply(quat.conjugate(q[:-1]), q[1:])), axis=1)
            yield np.r_[turned / steps, 0.0]


def _fill_forward(values: Array) -> Array:
    """The values (rows, components) with the last one known in place of missing ones."""
    rows = np.asarray(np.isfinite(values).all(axis=1))
    last = np.maximum.accumulate(np.where(rows, np.arange(len(rows)), -1))
    first = int(np.argmax(rows))
    return np.asarray(values[np.where(last < 0, first, last)])


def _rest_words(rests: Sequence[tuple[float, float]]) -> Iterator[Message]:
    if rests:
        onset, end = rests[0]
        values = {"count": len(rests), "onset": onset, "end": end}
        yield Message("import.seen_rest", values, "info")
    else:
        yield Message("import.seen_no_rest", {"shortest": REST}, "warning")
