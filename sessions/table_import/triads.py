"""Which columns of a table belong together, three of a vector or four of a quaternion, and what they measure.

In      columns of numbers; names as any logger writes them
Out     Triad values: by what the names say (segment, quantity), else by names that differ in one letter and by what the numbers look like
Source  rules ours: gravity and the earth's field have a size that stays, a quaternion has the size 1, angular rates come and go
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.samples import ACC, COMPONENTS, GYR, MAG, ORIENTATION
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.sessions.table_import.column_map import FACTORS, Column
from handscope.sessions.table_import.number_columns import NumberColumns

KINDS = {
    ORIENTATION: re.compile(r"quat|orient|(?:^|[^a-z])q[_.]?[wxyz0-3](?:[^a-z]|$)", re.IGNORECASE),
    GYR: re.compile(r"gyr|angvel|omega|rate|gyro|w_?[xyz]\b", re.IGNORECASE),
    ACC: re.compile(r"(?<!free)(?<!lin)(?<!linear)(?<!free_)acc|beschl", re.IGNORECASE),
    MAG: re.compile(r"mag", re.IGNORECASE),
}
AXIS = re.compile(r"(?:^|[^a-z])([xyz])(?:[^a-z]|$)|([XYZ])(?:[^a-zA-Z]|$)")
QUATERNION = re.compile(r"(?:^|[^a-z]|q)([wxyz])(?:[^a-z]|$)|([WXYZ])(?:[^a-zA-Z]|$)")
NO_READING = re.compile(
    r"free_?acc|lin(ear)?_?acc|^d[qv]\b|^d[qv][_\[]|euler|pos(ition)?[_\W]", re.IGNORECASE
)  # of a sensor
# of components, longest first
LETTERS = "wxyz", "0123", "1234", "xyz", "uvw", "123", "012", "abc"
UNITS = (  # words in a header, most telling first
    ("deg/s", GYR), ("dps", GYR), ("rad/s", GYR), ("mg", ACC), ("m/s^2", ACC), ("m/s2", ACC),
    ("[g]", ACC), ("(g)", ACC), ("ut", MAG),
)  # fmt: skip
SPELT = {"dps": "deg/s", "m/s2": "m/s^2", "[g]": "g", "(g)": "g", "ut": "uT"}
SIZES = {  # usual sizes by unit
    ACC: {"m/s^2": GRAVITY, "g": 1.0, "mg": 1000.0},
    MAG: {"uT": 45.0, "T": 45e-6, "mG": 450.0},
}
ACC_NEAR, MAG_NEAR = 0.2, 0.6  # share by which the median size may differ from the usual one
WINDOW = 10  # rows that belong together
STEADY = 0.1  # share of its size by which a vector at rest may change
UNIT_SPREAD = 0.02  # by which a quaternion's size may differ from 1
RATES_IN_RADIANS = np.radians(3000)  # rad/s; larger numbers are degrees
LOOKED_AT = 2000  # rows, spread over the table


@dataclass(frozen=True)
class Triad:
    """Columns of one quantity in the order of its components; `point` is None where nothing says the segment."""

    quantity: str
    columns: tuple[Column, ...]
    unit: str
    point: str | None = None


def find_triads(
    table: NumberColumns, stem: str, other_sides: Sequence[re.Pattern[str]], time: Column | None
) -> tuple[Triad, ...]:
    """Triads that names say whole first, then those of the other columns; `stem` is the file's name without its ending.

    Columns that name another side are left out.
    """
    named = [
        Triad(kind, columns, guess_unit(table, kind, columns), point)
        for point, kind, columns in _named_channels(table, stem, other_sides)
    ]
    taken = {c for triad in named for c in triad.columns} | {time}
    if table.names:
        free = [
            n
            for n in table.names
            if n not in taken
            and table.names.count(n) == 1
            and not NO_READING.search(n)
            and not any(side.search(n) for side in other_sides)
        ]
        groups: list[tuple[Column, ...]] = list(_similar_names(free))
    else:
        groups = list(_adjacent(table, [k for k in range(table.values.shape[1]) if k != time]))
    by_numbers = (_by_numbers(table, columns) for columns in groups)
    return _with_one_unit([*named, *(triad for triad in by_numbers if triad is not None)])


def guess_unit(table: NumberColumns, kind: str, columns: Sequence[Column]) -> str:
    """As the header says, else by size."""
    if kind == ORIENTATION:
        return "1"
    if unit := _unit_in(kind, columns):
        return unit
    values = _sample_rows(table, columns)
    if not len(values):
        return next(iter(FACTORS[kind]))
    if kind in SIZES:
        return _nearest(SIZES[kind], float(np.median(np.linalg.norm(values, axis=1))))
    return "deg/s" if float(np.abs(values).max()) > RATES_IN_RADIANS else "rad/s"


def segment_in(text: str) -> str | None:
    """The segment that a text names."""
    plain = re.sub(r"[^a-z0-9]+", "_", text.lower())
    return next((s for s in sorted(SEGMENTS, key=len, reverse=True) if s in plain), None)


def _with_one_unit(triads: Sequence[Triad]) -> tuple[Triad, ...]:
    """Gyroscopes whose names say no unit have that of the fastest: a finger at rest turns slowly in any unit."""
    silent = [t for t in triads if t.quantity == GYR and _unit_in(GYR, t.columns) is None]
    if "deg/s" not in [t.unit for t in silent]:
        return tuple(triads)
    return tuple(replace(t, unit="deg/s") if t in silent else t for t in triads)


def _unit_in(kind: str, columns: Sequence[Column]) -> str | None:
    for words, of in UNITS:
        if of == kind and words in str(columns[0]).lower():
            return SPELT.get(words, words)
    return None


def _named_channels(
    table: NumberColumns, stem: str, other_sides: Sequence[re.Pattern[str]]
) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Segment, quantity and the columns of its components that their names say; the file's name says the segment where
    columns do not."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    of_file = segment_in(stem)
    for name in table.names:
        if any(side.search(name) for side in other_sides):
            continue
        point = segment_in(name) or of_file
        kind = next((k for k, words in KINDS.items() if words.search(name)), None)
        axis = (QUATERNION if kind == ORIENTATION else AXIS).search(name)
        if point and kind and axis:
            found.setdefault((point, kind), {})[(axis[1] or axis[2]).lower()] = name
    for (point, kind), axes in found.items():
        if set(axes) == set(COMPONENTS[kind]):
            yield point, kind, tuple(axes[c] for c in COMPONENTS[kind])


def _similar_names(names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Names that differ in one character alone, which runs through a set of components; the set that orders most names goes first."""
    left = list(dict.fromkeys(names))
    while groups := max(
        (_groups(left, letters) for letters in LETTERS), key=lambda g: sum(map(len, g))
    ):
        yield from groups
        taken = {name for group in groups for name in group}
        left = [n for n in left if n not in taken]


def _groups(names: Sequence[str], letters: str) -> list[tuple[str, ...]]:
    """Groups of names that are the same but for one character, which is each of the letters once and no other; no name is in two."""
    found: dict[tuple[str, str], dict[str, str]] = {}
    for name in names:
        for k, character in enumerate(name.lower()):
            if character.isalnum() and character.isdigit() == letters.isdigit():
                found.setdefault((name[:k], name[k + 1 :]), {})[character] = name
    groups: list[tuple[str, ...]] = []
    taken: set[str] = set()
    for members in found.values():
        if set(members) == set(letters) and taken.isdisjoint(members.values()):
            groups.append(tuple(members[c] for c in letters))
            taken |= set(members.values())
    return groups


def _adjacent(table: NumberColumns, columns: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Columns without names: four in a row that are a quaternion, else three in a row."""
    k = 0
    while k + 3 <= len(columns):
        four = tuple(columns[k : k + 4])
        triad = _by_numbers(table, four) if len(four) == 4 else None
        wide = 4 if triad is not None and triad.quantity == ORIENTATION else 3
        yield tuple(columns[k : k + wide])
        k += wide


def _by_numbers(table: NumberColumns, columns: Sequence[Column]) -> Triad | None:
    """What the columns measure by their numbers; None where they hold none, or four are no quaternion."""
    values = _sample_rows(table, columns)
    if len(values) < WINDOW:
        return None
    sizes = np.linalg.norm(values, axis=1)
    if len(columns) == 4:
        is_unit = bool(np.quantile(np.abs(sizes - 1), 0.9) < UNIT_SPREAD)
        return Triad(ORIENTATION, tuple(columns), "1") if is_unit else None
    words = " ".join(map(str, columns))
    kind = next((k for k, pattern in KINDS.items() if pattern.search(words)), None)
    if kind is None or kind == ORIENTATION:
        kind = _kind_of(values)
    return Triad(kind, tuple(columns), guess_unit(table, kind, columns))


def _kind_of(values: Array) -> str:
    """By the quarter of windows in which the vector changes least: there gravity and field have a direction and their size, rates have neither."""
    windows = values[: len(values) // WINDOW * WINDOW].reshape(-1, WINDOW, 3)
    means = windows.mean(axis=1)
    spread = np.linalg.norm(windows - means[:, None], axis=2).mean(axis=1)
    calm = np.argsort(spread)[: max(1, len(windows) // 4)]
    sizes = np.linalg.norm(means[calm], axis=1)
    size = float(np.median(sizes))
    is_steady = np.median(spread[calm]) < STEADY * size and np.ptp(sizes) < 2 * STEADY * size
    for kind, near in ((ACC, ACC_NEAR), (MAG, MAG_NEAR)):
        if is_steady and any(abs(size / u - 1) < near for u in SIZES[kind].values()):
            return kind
    return GYR


def _sample_rows(table: NumberColumns, columns: Sequence[Column]) -> Array:
    """Rows without gaps (rows, columns): windows of WINDOW rows spread over the table, at most LOOKED_AT rows."""
    numbers = [c if isinstance(c, int) else table.names.index(c) for c in columns]
    if any(k in table.faults for k in numbers):
        return np.zeros((0, len(numbers)))
    every = max(1, len(table.values) // LOOKED_AT)
    rows = np.flatnonzero(np.arange(len(table.values)) // WINDOW % every == 0)
    values = table.values[rows][:, numbers]
    return np.asarray(values[np.isfinite(values).all(axis=1)])


def _nearest(sizes: dict[str, float], size: float) -> str:
    return min(sizes, key=lambda unit: abs(np.log(max(size, 1e-12) / sizes[unit])))
