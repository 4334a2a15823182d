"""Forces from the raw channels of a force sensor, by the calibration in the recording's `ForceSetup`."""

from collections.abc import Mapping, Sequence

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.force.setup import ForceSetup
from handscope.estimators.numerics.typing import Array


def raw_columns(
    system: str, channels: Sequence[Mapping[str, str]], setups: Mapping[str, ForceSetup]
) -> dict[str, list[int]]:
    """By tracked point the columns of its calibrated channels, in the calibration's order; without points that have none here."""
    found = {}
    for point, setup in setups.items():
        columns = {c["name"]: k for k, c in enumerate(channels) if c["tracked_point"] == point}
        here = [c for c in setup.channels if c.name in columns]
        if not here:
            continue
        missing = [c.name for c in setup.channels if c.name not in columns]
        if missing:
            raise InputError(
                "motion_bids.raw_force_channel_missing",
                system=system,
                point=point,
                missing=", ".join(missing),
            )
        for channel in here:
            units = channels[columns[channel.name]]["units"]
            if units != channel.units:
                raise InputError(
                    "motion_bids.raw_force_unit",
                    system=system,
                    name=channel.name,
                    units=units,
                    other=channel.units,
                )
        found[point] = [columns[c.name] for c in setup.channels]
    return found


def require_all(setups: Mapping[str, ForceSetup], found: set[str]) -> None:
    """InputError where a calibration has no channels in any tracking system."""
    for point, setup in setups.items():
        if setup.channels and point not in found:
            raise InputError(
                "motion_bids.raw_force_point_missing",
                point=point,
                names=", ".join(c.name for c in setup.channels),
            )


def loads_of(setup: ForceSetup, raw: Array) -> Array:
    """Forces (n, 3) N, or forces and torques (n, 6), of raw readings (n, channels); NaN where one is missing, infinite where one was clipped."""
    assert setup.calibration is not None
    return np.where(
        setup.calibration.clipped(raw)[:, None], np.inf, setup.calibration.corrected(raw)
    )
