"""What a user declares about a plate of magnetometers on the trunk and of a magnet on the hand: with
the recording, as it was declared.

Frames  trunk: that of its inertial sensor; hand: that of its inertial sensor. What it must be to be
        used: magnet/model/setup.py
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError

Place = tuple[float, float, float]


@dataclass(frozen=True)
class Plate:
    """Magnetometers on the trunk and the magnet on the hand as declared, SI."""

    places: Mapping[str, Place]  # m, by magnetometer (trunk, trunk_mag_1, ...), trunk's frame
    moment: Place  # A m^2, hand's frame
    place: Place  # m, of the magnet, hand's frame
    earth: float  # T, strength of the field in which the magnetometers were calibrated
    dip: float | None = None  # rad below the horizon, where it is known


def plate_from(table: Mapping[str, Any]) -> Plate | None:
    """The plate of a recording's table with the names of Plate; None of an empty one. InputError
    where it cannot be read."""
    if not table:
        return None
    missing = [name for name in ("places", "moment", "earth") if name not in table]
    places = table.get("places")
    if missing or not isinstance(places, Mapping):
        raise InputError(
            "option.magnet_setup_incomplete", missing=", ".join(missing) or "places by magnetometer"
        )
    dip = table.get("dip")
    return Plate(
        {str(name): _three(p, f"place of {name}") for name, p in places.items()},
        _three(table["moment"], "moment"),
        _three(table.get("place", (0.0, 0.0, 0.0)), "place"),
        _number(table["earth"], "earth"),
        None if dip is None else _number(dip, "dip"),
    )


def table_of(plate: Plate) -> dict[str, Any]:
    """The inverse of `plate_from`."""
    table: dict[str, Any] = {
        "places": {name: list(p) for name, p in plate.places.items()},
        "moment": list(plate.moment),
    }
    table |= {"place": list(plate.place), "earth": plate.earth}
    return table if plate.dip is None else {**table, "dip": plate.dip}


def _three(value: Any, what: str) -> Place:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 3:
        raise InputError("option.magnet_setup_vector", what=what, value=value)
    x, y, z = (_number(v, what) for v in value)
    return x, y, z


def _number(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
        raise InputError("option.magnet_setup_not_finite", what=what, value=value)
    return float(value)
