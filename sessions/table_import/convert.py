"""A mapped table to a recording: units, rate and gravity are checked before anything is stored.

In      columns of numbers, a ColumnMap, events
Out     blocks in SI, then a native recording that holds them as a glove would have sent them
Source  wire protocol (docs/wire-protocol.md); rules ours
"""

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from handscope.estimators.data.samples import (
    ACC,
    FASTEST_RATE,
    GYR,
    MAG,
    ORIENTATION,
    SLOWEST_RATE,
    Block,
    Event,
    Stream,
)
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation.given_orientations import UNIT_NORM
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.table_import.column_map import FACTORS, SECONDS, ColumnMap
from handscope.sessions.table_import.number_columns import NumberColumns
from handscope.sessions.wire.bursts import bursts_of
from handscope.sessions.wire.framing import Encoder
from handscope.sessions.wire.messages import Format, Identity, StreamInfo, Strip

NS = 1e9
EPOCH = datetime.fromtimestamp(0, UTC)
OLDEST = datetime(2000, 1, 1, tzinfo=UTC)  # that a column of times may begin to be taken for dates
AHEAD = timedelta(days=1)  # that a logger's clock may be ahead
START = 10.0  # s that the clock shows at the first sample
GRAVITY_SHARE = 0.15  # of gravity that the median size of accelerations may be off
FASTEST = 60.0  # rad/s; a gyroscope's largest full scale is 4000 deg/s = 70 rad/s
QUANTITIES = ((GYR, ACC, MAG), (ORIENTATION,))  # of one stream each
ENDINGS = {MAG: "_mag", ORIENTATION: "_orientation"}  # of a stream that begins with these


def blocks_of(table: NumberColumns, columns: ColumnMap) -> list[Block]:
    """One block a strip and set of quantities, SI; InputError where the numbers contradict the map."""
    t, rate = _times(table, columns)
    groups: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for point, sensor in columns.sensors.items():
        for together in QUANTITIES:
            if kinds := tuple(q for q in together if q in sensor.channels):
                groups.setdefault((_strip_of(point), kinds), []).append(point)
    found = []
    for (strip, kinds), points in groups.items():
        values = np.stack(
            [
                np.concatenate([_values(table, columns, p, q) for q in kinds], axis=1)
                for p in points
            ],
            axis=1,
        )
        name = strip + ENDINGS.get(kinds[0], "")
        found.append(Block(Stream(name, tuple(points), kinds, rate), t, values))
    stated = {s.channels[ACC].unit for s in columns.sensors.values() if ACC in s.channels}
    _require_plausible(found, stated, table.file)
    return found


def start_of(table: NumberColumns, columns: ColumnMap) -> datetime | None:
    """The instant of the first row where its time counts from 1970; None where it counts from anything else."""
    if columns.time is None:
        return None
    column, unit = columns.time
    first = float(table.column(column)[0]) * SECONDS[unit]
    if not OLDEST.timestamp() <= first <= (datetime.now(UTC) + AHEAD).timestamp():
        return None
    return datetime.fromtimestamp(first, UTC)


def _strip_of(point: str) -> str:
    return next((finger for finger, chain in CHAINS.items() if point in chain), point)


def _values(table: NumberColumns, columns: ColumnMap, point: str, quantity: str) -> Array:
    channels = columns.sensors[point].channels[quantity]
    factor = FACTORS[quantity][channels.unit]
    values = np.column_stack([table.column(c) for c in channels.columns]) * factor
    if not np.isfinite(values).all(axis=1).any():
        raise InputError(
            "import.columns_without_numbers",
            file=table.file,
            columns=", ".join(map(str, channels.columns)),
            point=point,
        )
    return values


def _times(table: NumberColumns, columns: ColumnMap) -> tuple[Array, float]:
    """Times (rows,) from 0, s, and the rate, Hz."""
    if columns.time is None:
        assert columns.rate is not None
        return np.arange(len(table.values)) / columns.rate, columns.rate
    column, unit = columns.time
    t = table.column(column) * SECONDS[unit]
    if not np.isfinite(t).all():
        row = int(np.flatnonzero(~np.isfinite(t))[0])
        raise InputError("import.time_missing", file=table.file, column=column, row=row + 1)
    steps = np.diff(t)
    if len(t) < 2 or (steps <= 0).any():
        row = int(np.flatnonzero(steps <= 0)[0]) + 2 if len(t) > 1 else 1
        raise InputError("import.time_not_increasing", file=table.file, column=column, row=row)
    rate = float(1 / np.median(steps))
    if not SLOWEST_RATE <= rate <= FASTEST_RATE:
        raise InputError(
            "import.rate_implausible", file=table.file, column=column, unit=unit, rate=rate
        )
    return t - t[0], rate


def _require_plausible(blocks: Sequence[Block], stated: Set[str], file: str) -> None:
    """Gravity must have its size and rates must be possible: else a unit of the map is wrong."""
    sizes, rates = [], []
    for block in blocks:
        if ACC in block.stream.quantities:
            sizes.append(np.nanmedian(np.linalg.norm(block.of(ACC), axis=2)))
        if GYR in block.stream.quantities:
            rates.append(np.nanmax(np.abs(block.of(GYR))))
    size = float(np.median(sizes)) if sizes else GRAVITY
    if not abs(size / GRAVITY - 1) < GRAVITY_SHARE:
        likely = (
            _likely_unit(size, min(stated)) if len(stated) == 1 else "sensors have several units"
        )
        raise InputError(
            "import.gravity_implausible",
            file=file,
            size=size,
            gravity=GRAVITY,
            likely=likely,
        )
    _require_unit_norm(blocks, file)
    if rates and max(rates) > FASTEST:
        raise InputError("import.rates_implausible", file=file, rates=np.degrees(max(rates)))


def _require_unit_norm(blocks: Sequence[Block], file: str) -> None:
    for block in (b for b in blocks if ORIENTATION in b.stream.quantities):
        norms = np.nanmedian(np.linalg.norm(block.of(ORIENTATION), axis=2), axis=0)
        for point, norm in zip(block.stream.sensors, norms):
            if not abs(norm - 1.0) <= UNIT_NORM:
                raise InputError("import.orientation_not_unit", file=file, point=point, norm=norm)


def _likely_unit(size: float, stated: str) -> str:
    """What a size (m/s^2) by the stated unit says of the unit."""
    unit = unit_of_gravity(size / FACTORS[ACC][stated])
    return (
        phrase("import.unit_likely", unit=unit, stated=stated)
        if unit
        else phrase("import.check_unit")
    )


def unit_of_gravity(reading: float) -> str | None:
    """The unit in which a reading at rest is gravity."""
    near = (abs(reading * f / GRAVITY - 1) < GRAVITY_SHARE for f in FACTORS[ACC].values())
    return next((unit for unit, fits in zip(FACTORS[ACC], near) if fits), None)


def write_native(
    blocks: Sequence[Block],
    columns: ColumnMap,
    events: Iterable[Event],
    path: Path,
    about: Mapping[str, str],
    started: datetime | None = None,
) -> None:
    """A new native recording at `path`, whole or not at all; `started` is the instant of the first row. Where it is not known the file has no date, and its clock begins at 1970."""
    encoder = Encoder()
    metadata = {"hand": columns.hand, "geometry": dict(columns.geometry), **about}
    dated = {} if started else {"start_utc": None}
    try:
        with Recorder(path, metadata | dated, 0.0, started or EPOCH) as recorder:
            for at, frame in _frames(blocks, columns, encoder):
                recorder.write(frame, at)
            for k, event in enumerate(events):
                recorder.event(f"imported-{k}", event, 0.0)
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def _frames(
    blocks: Sequence[Block], columns: ColumnMap, encoder: Encoder
) -> Iterator[tuple[float, bytes]]:
    """Arrival and bytes of every message, in order of time."""
    slots = {points: k for k, points in enumerate({b.stream.sensors: None for b in blocks})}
    infos = [
        StreamInfo(
            k,
            slots[b.stream.sensors],
            0,
            b.stream.quantities,
            Format.FLOAT32,
            b.stream.rate,
            (1.0,) * n,
            (0.0,) * n,
        )
        for k, b in enumerate(blocks)
        for n in [len(b.stream.quantities)]
    ]
    name = hashlib.sha256(repr(sorted(columns.sensors)).encode()).digest()
    yield (
        0.0,
        encoder.frame(
            Identity(int.from_bytes(name[:6], "big"), 1, columns.hand, "imported table", "")
        ),
    )
    for points, slot in slots.items():
        mounting = tuple(x for p in points for x in columns.sensors[p].mounting)
        yield 0.0, encoder.frame(Strip(slot, True, slot + 1, points, mounting))
    for info in infos:
        yield 0.0, encoder.frame(info)
    bursts = [
        b
        for block, info in zip(blocks, infos)
        for b in bursts_of(np.rint((START + block.t) * NS).astype(np.int64), block.values, info)
    ]
    for burst in sorted(bursts, key=lambda b: (b.t_sent, b.stream)):
        yield (burst.t_sent / NS - START) + 1e-3, encoder.frame(burst)
