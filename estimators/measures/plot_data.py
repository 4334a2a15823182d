"""What a page or a report draws of a measure beside its figures: curves over time, frequency or repetition, and marks on them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.numerics.typing import Array


@dataclass(frozen=True)
class Curve:
    """Values over something; NaN is a gap."""

    name: str  # key of its words: distance, tapping_amplitude, spectrum, ... or a joint angle such as index_pip_flexion
    unit: str  # of y, SI
    x: Array  # (n,)
    y: Array  # (n,)
    x_unit: str = "s"  # "s" of the recording; "Hz" of a spectrum; "1" number of the repetition; "m" of a distance, in order of size


@dataclass(frozen=True)
class PlotData:
    """Curves, and marks at places of them."""

    curves: tuple[Curve, ...] = ()
    # s of the recording by the key of their words: closing, freeze, ...
    marks: Mapping[str, Array] = field(default_factory=dict)


NOTHING = PlotData()


def thin_curves(curves: Sequence[Curve], most: int) -> tuple[Curve, ...]:
    """Each at most about `most` points; of every stretch left out its smallest and largest value stay, so that no peak is lost. Curves over the same x keep one."""
    groups: list[list[int]] = []
    for k, curve in enumerate(curves):
        group = next(
            (
                g
                for g in groups
                if curve.x_unit == curves[g[0]].x_unit and np.array_equal(curve.x, curves[g[0]].x)
            ),
            None,
        )
        if group is None:
            groups.append([k])
        else:
            group.append(k)
    rows_kept = {
        k: rows
        for group in groups
        for rows in [_rows_to_keep([curves[k].y for k in group], most)]
        for k in group
    }
    return tuple(
        c if rows_kept[k] is None else replace(c, x=c.x[rows_kept[k]], y=c.y[rows_kept[k]])
        for k, c in enumerate(curves)
    )


def _rows_to_keep(values: Sequence[Array], most: int) -> NDArray[np.int_] | None:
    """The rows that stay of curves (n,) over one x; None where all do."""
    n = len(values[0])
    if n <= most:
        return None
    width = -(-2 * len(values) * n // most)
    rows: list[int] = []
    for start in range(0, n, width):
        found = set()
        for y in (v[start : start + width] for v in values):
            known = np.flatnonzero(np.isfinite(y))
            found |= (
                {start + int(known[k]) for k in (np.argmin(y[known]), np.argmax(y[known]))}
                if len(known)
                else set()
            )
        rows += sorted(found or {start})
    return np.array(rows)
