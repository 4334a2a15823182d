"""What a page or a report draws of a measure beside its figures: curves over time, frequency or repetition, and marks on them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from estimators.quaternions import Array


@dataclass(frozen=True)
class Curve:
    """Values over something; NaN is a gap."""

    name: str  # key of its words: distance, tapping_amplitude, spectrum, ... or a joint angle such as index_pip_flexion
    unit: str  # of y, SI
    x: Array  # (n,)
    y: Array  # (n,)
    x_unit: str = "s"  # "s" of the recording; "Hz" of a spectrum; "1" number of the repetition


@dataclass(frozen=True)
class Shown:
    curves: tuple[Curve, ...] = ()
    marks: Mapping[str, Array] = field(default_factory=dict)  # s of the recording by the key of their words: closing, freeze, ...


NOTHING = Shown()


def thinned(curve: Curve, most: int) -> Curve:
    """At most about `most` points; of every stretch left out its smallest and largest value stay, so that no peak is lost."""
    n = len(curve.x)
    if n <= most:
        return curve
    width = -(-2 * n // most)
    kept = []
    for start in range(0, n, width):
        y = curve.y[start : start + width]
        known = np.flatnonzero(np.isfinite(y))
        kept += sorted({start + int(known[k]) for k in (np.argmin(y[known]), np.argmax(y[known]))}) if len(known) else [start]
    return Curve(curve.name, curve.unit, curve.x[kept], curve.y[kept], curve.x_unit)
