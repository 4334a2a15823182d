"""What a user declares about the force sensors of a recording: raw channels and their calibration, or the accuracy of forces that are recorded as such.

In      the table `ForceSetup` of a sidecar, by tracked point
Out     a ForceSetup a point: channels with their units, and the calibration that turns them to N, or N and Nm; docs/motion-bids.md
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handscope.estimators.data.samples import FORCE_POINTS
from handscope.estimators.errors import InputError
from handscope.estimators.force.sensor import ForceCalibration
from handscope.estimators.numerics.typing import Array


@dataclass(frozen=True)
class Channel:
    """One column of raw readings, as the recording names it."""

    name: str
    units: str  # compared as they are written


@dataclass(frozen=True)
class ForceSetup:
    """One force sensor as declared: its channels and calibration."""

    scale_sd: float  # share by which a force may be wrong in all samples alike
    channels: tuple[Channel, ...] = ()  # none: the readings are forces already
    calibration: ForceCalibration | None = None  # of these channels
    # rad about each axis, of the forces against the fingertip's inertial sensor, in whose axes they
    # are; None: as the mountings say
    turn_sd: float | None = None

    @property
    def axes(self) -> int:
        """3: forces; 6: torques as well."""
        return 3 if self.calibration is None else len(self.calibration.matrix)


def parse_setups(table: Mapping[str, Any]) -> dict[str, ForceSetup]:
    """By tracked point; InputError where it cannot be read."""
    return {point: _parse_setup(point, declared) for point, declared in table.items()}


def setup_to_table(setup: ForceSetup) -> dict[str, Any]:
    """The inverse, of one point."""
    known = {"scale_sd": setup.scale_sd} | (
        {} if setup.turn_sd is None else {"turn_sd": setup.turn_sd}
    )
    if setup.calibration is None:
        return known
    declared: dict[str, Any] = {
        "channels": [{"name": c.name, "units": c.units} for c in setup.channels]
    }
    declared |= {
        "matrix": setup.calibration.matrix.tolist(),
        "offset": setup.calibration.offset.tolist(),
    }
    return declared | known


def _parse_setup(point: str, declared: Any) -> ForceSetup:
    if point not in FORCE_POINTS:
        raise InputError("force.setup_unknown_point", point=point, points=", ".join(FORCE_POINTS))
    if not isinstance(declared, Mapping):
        raise InputError("force.setup_not_an_object", point=point)
    scale = _parse_numbers(point, "scale_sd", declared.get("scale_sd"), ())
    if not 0 <= scale < 1:
        raise InputError("force.setup_scale_sd", point=point, scale=float(scale))
    turn = (
        float(_parse_numbers(point, "turn_sd", declared["turn_sd"], ()))
        if declared.get("turn_sd") is not None
        else None
    )
    if turn is not None and not 0 <= turn < 1:
        raise InputError("force.setup_turn_sd", point=point, turn=turn)
    if "matrix" not in declared:
        return ForceSetup(float(scale), turn_sd=turn)
    channels = _parse_channels(point, declared.get("channels"))
    offset = _parse_numbers(point, "offset", declared.get("offset"), (len(channels),))
    rows = 6 if isinstance(declared["matrix"], Sequence) and len(declared["matrix"]) == 6 else 3
    matrix = _parse_numbers(point, "matrix", declared["matrix"], (rows, len(channels)))
    return ForceSetup(float(scale), channels, ForceCalibration(matrix, offset, float(scale)), turn)


def _parse_channels(point: str, declared: Any) -> tuple[Channel, ...]:
    fits = isinstance(declared, Sequence) and all(
        isinstance(c, Mapping) and {"name", "units"} <= c.keys() for c in declared
    )
    channels = tuple(Channel(str(c["name"]), str(c["units"])) for c in declared) if fits else ()
    if not channels or len({c.name for c in channels}) < len(channels):
        raise InputError("force.setup_channels_form", point=point)
    return channels


def _parse_numbers(point: str, what: str, declared: Any, shape: tuple[int, ...]) -> Array:
    try:
        numbers = np.asarray(declared, dtype=float)
    except (TypeError, ValueError):
        numbers = np.full(shape, np.nan)
    if numbers.shape != shape or not np.isfinite(numbers).all():
        how = " by ".join(str(n) for n in shape) or "one"
        raise InputError("force.setup_not_finite", point=point, what=what, how=how)
    return numbers
