"""What a gyroscope may have wrong, as the matrix that turns its readings into rates about the accelerometer's axes.

Out     named matrices; every sign and order of axes there is, and units
Limits  only the relation to the accelerometer shows: axes of the accelerometer that are negated or exchanged are told where one fault of it
        explains what two of the gyroscope would. An accelerometer with one axis negated sees the hand turn as a gyroscope with the two others negated.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from handscope.estimators.numerics.typing import Array

AXES = "xyz"
SHARES: Mapping[
    str, float
] = {  # of all faults, by what is usual: evidence for a rare one has to be stronger. Ours
    "gyroscope_sign": 0.3,
    "gyroscope_negated": 0.05,
    "gyroscope_exchange": 0.15,
    "gyroscope_unit": 0.1,
    "gyroscope_gain": 0.1,
    "gyroscope_axis_gain": 0.1,
    "gyroscope_delay": 0.05,
    "gyroscope_matrix": 0.05,
    "gyroscope_axes": 0.04,
    "accelerometer_sign": 0.03,
    "accelerometer_exchange": 0.03,
}
DEGREES = float(np.degrees(1.0))
Cause = tuple[str, tuple[tuple[str, str], ...]]  # what is at fault, and which axes; sizes left out


@dataclass(frozen=True, eq=False)
class Fault:
    """One thing that may be wrong with a sensor."""

    code: str
    values: tuple[tuple[str, float | str], ...]
    matrix: Array  # (3, 3) rates of the accelerometer's axes from readings
    certain: bool = True  # whether the matrix alone puts it right

    @property
    def cause(self) -> Cause:
        """What distinguishes it from faults of another cause."""
        return self.code, tuple((name, v) for name, v in self.values if isinstance(v, str))


@cache
def share_of(code: str) -> float:
    """What is expected of all faults to be just one of this code."""
    count = {"gyroscope_axis_gain": 3} | {
        c: sum(f.code == c for f in discrete_faults()) for c in {f.code for f in discrete_faults()}
    }
    return SHARES[code] / count.get(code, 1)


@cache
def discrete_faults() -> tuple[Fault, ...]:
    """Signs and orders of axes, and units; the right gyroscope first."""
    units = [
        Fault("gyroscope_unit", (("factor", f), ("unit", u)), np.eye(3) * m) for m, f, u in UNITS
    ]
    return (*sorted(_orders(), key=lambda fault: fault.code != ""), *units)


UNITS = (  # matrix, by how much the readings are off, what they look like
    (1 / DEGREES, DEGREES, "deg/s"),
    (DEGREES, 1 / DEGREES, "rad/s"),
)


def _orders() -> list[Fault]:
    return [
        _named(np.diag(signs) @ np.eye(3)[list(order)], order, signs)
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
    ]


def _named(M: Array, order: tuple[int, ...], signs: tuple[float, ...]) -> Fault:
    """The simplest thing that makes it."""
    kept, same, opposed = (
        [k for k in range(3) if order[k] == k],
        [k for k in range(3) if signs[k] > 0],
        [k for k in range(3) if signs[k] < 0],
    )
    if len(kept) == 3 and len(opposed) in (0, 3):
        return Fault("gyroscope_negated" if opposed else "", (), M)
    if len(kept) == 3 and len(opposed) == 1:
        return Fault("gyroscope_sign", (("axis", AXES[opposed[0]]),), M)
    if len(kept) == 3:
        return Fault("accelerometer_sign", (("axis", AXES[same[0]]),), M, certain=False)
    if len(kept) == 1 and len(opposed) in (0, 3):
        a, b = (AXES[k] for k in range(3) if k not in kept)
        return Fault(
            "accelerometer_exchange" if opposed else "gyroscope_exchange",
            (("axis", a), ("other", b)),
            M,
            certain=not opposed,
        )
    axes = ", ".join(f"{'-' if signs[k] < 0 else ''}{AXES[order[k]]}" for k in range(3))
    return Fault("gyroscope_axes", (("axes", axes),), M)
