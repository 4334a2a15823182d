"""What a strip's flash says of a force sensor: the message, its payload, and how the samples of a raw strip are corrected by it."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.samples import FORCE, SATURATION, TORQUE
from handscope.estimators.force.setup import ForceSetup
from handscope.estimators.numerics.typing import Array


@dataclass(frozen=True)
class ForceSensorCalibration:
    """y = M (x - offset) of what the sensor sends: three forces, or three forces and three torques."""

    slot: int
    sensor: int
    scale_sd: float  # share by which forces may be wrong
    # rad: the forces are in the axes of the cuff's inertial sensor, to so much; None: as the
    # mountings say
    turn_sd: float | None
    offset: tuple[float, ...]  # 3 or 6
    matrix: tuple[float, ...]  # 9 or 36, row by row

    @property
    def axes(self) -> int:
        return len(self.offset)


def write_force(m: ForceSensorCalibration) -> bytes:
    """The payload of a force sensor's calibration."""
    turn = float("nan") if m.turn_sd is None else m.turn_sd
    return struct.pack(
        f"<BBB2f{m.axes * (m.axes + 1)}f",
        m.slot,
        m.sensor,
        m.axes,
        m.scale_sd,
        turn,
        *m.offset,
        *m.matrix,
    )


def read_force(p: bytes) -> ForceSensorCalibration:
    """The message; ValueError or struct.error where the bytes make none."""
    slot, sensor, axes, scale, turn = struct.unpack_from("<BBB2f", p)
    if axes not in (3, 6):
        raise ValueError(f"a force sensor of {axes} axes")
    numbers = struct.unpack(f"<{axes * (axes + 1)}f", p[11:])
    if not (np.isfinite(numbers).all() and 0 <= scale < 1 and (np.isnan(turn) or 0 <= turn < 1)):
        raise ValueError(f"calibration of a force sensor of {numbers}, {scale}, {turn}")
    return ForceSensorCalibration(
        slot, sensor, scale, None if np.isnan(turn) else turn, numbers[:axes], numbers[axes:]
    )


def messages_of_setups(
    setups: Mapping[str, ForceSetup], slot: int, points: Sequence[str]
) -> tuple[ForceSensorCalibration | None, ...]:
    """What the strip would tell of each sensor, had it a flash, from calibrations that are kept for it elsewhere."""
    return tuple(
        _of_setup(setups[point], slot, k) if point in setups else None
        for k, point in enumerate(points)
    )


def _of_setup(setup: ForceSetup, slot: int, sensor: int) -> ForceSensorCalibration | None:
    c = setup.calibration
    if c is None or c.matrix.shape not in ((3, 3), (6, 6)):
        return None
    return ForceSensorCalibration(
        slot,
        sensor,
        setup.scale_sd,
        setup.turn_sd,
        tuple(map(float, c.offset)),
        tuple(map(float, c.matrix.ravel())),
    )


def correct_forces(
    values: Array,
    quantities: Sequence[str],
    full_scale: Sequence[float],
    calibrations: Sequence[ForceSensorCalibration | None],
) -> Array:
    """Samples (n, sensors, axes) of a raw strip as loads: infinite where one was at its full scale (0 = not known), marked or not, NaN where the torques that it needs
    are sent apart.
    """
    made = values.copy()
    first = {quantity: 3 * k for k, quantity in enumerate(quantities)}
    limit = {
        quantity: SATURATION * most for quantity, most in zip(quantities, full_scale) if most > 0
    }
    for k, one in enumerate(calibrations):
        if one is None:
            sizes = np.repeat([limit.get(quantity, np.inf) for quantity in quantities], 3)
            made[:, k] = np.where(np.abs(values[:, k]) >= sizes, np.inf, values[:, k])
            continue
        wanted = (FORCE, TORQUE)[: one.axes // 3]
        columns = [
            first[quantity] + axis for quantity in wanted if quantity in first for axis in range(3)
        ]
        if len(columns) < one.axes:
            made[:, k, columns] = np.nan
            continue
        raw, limits = (
            values[:, k, columns],
            np.repeat([limit.get(quantity, np.inf) for quantity in wanted], 3),
        )
        loads = (raw - np.array(one.offset)) @ np.reshape(one.matrix, (one.axes, one.axes)).T
        made[:, k, columns] = np.where(
            (np.abs(raw) >= limits).any(axis=1, keepdims=True), np.inf, loads
        )
    return made
