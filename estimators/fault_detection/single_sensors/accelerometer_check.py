"""The size of gravity that each accelerometer reads, and the unit that all of them read it in; in a known pose its sign.

In      cells of readings
Out     suspicions: a unit that is not m/s^2, accelerometers whose gravity is too large or too small, accelerometers that are negated
Source  gravity is 9.78 to 9.83 m/s^2 on the ground (WGS 84); errors of calibrated MEMS accelerometers as in estimators/sensors/fault_detection.py
Limits  without a second of rest only units are told, not single sensors
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.fault_detection.single_sensors.cells import CELL, Cells
from handscope.estimators.fault_detection.single_sensors.significance import FALSE_ALARMS
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.tail_probabilities import normal_sf
from handscope.estimators.numerics.typing import Array

UNITS: Mapping[str, float] = {  # size of gravity in each
    "g": 1.0,
    "mg": 1000.0,
    "cm/s^2": 100.0 * GRAVITY,
    "g times 9.81 twice": GRAVITY**2,
    "counts of +-2 g in 16 bit": 16384.0,
    "counts of +-4 g in 16 bit": 8192.0,
    "counts of +-8 g in 16 bit": 4096.0,
    "counts of +-16 g in 16 bit": 2048.0,
}
GRAVITY_IN = {**UNITS, "m/s^2": GRAVITY}
AT_REST, MOVING = 1.12, 2.2  # times a unit's gravity that readings may be
MOST = 2 / 3  # of all sensors that agree on a unit
REST = 25  # cells of a stretch that is looked at for rest: 0.5 s
STEADY, SLOW = 0.01, 0.05  # scatter at rest: of gravity's size, and rad/s
SIZE_SD = 0.12  # m/s^2 by which gravity of an accelerometer without fault is off: bias and scale of a calibrated one
NOTED = 0.5  # m/s^2 that are worth a word
FAULT = 1.0  # m/s^2


@dataclass(frozen=True)
class Gravity:
    """What accelerometers read of gravity, as they read it."""

    size: Array  # (S,) median over rest, over all where there is none
    rested: Array  # (S,) bool, whether a second of rest was found


def gravity_sizes(cells: Cells) -> Gravity:
    """Sizes of gravity by sensor, NaN where it has no readings."""
    count = len(cells.valid) // REST
    stretches = (count, REST, len(cells.sensors), 3)
    acc = np.where(cells.valid[..., None], cells.acc, np.nan)[: count * REST].reshape(stretches)
    gyr = cells.gyr[: count * REST].reshape(stretches)
    with np.errstate(invalid="ignore"):
        mean = np.linalg.norm(acc, axis=-1).mean(axis=1)
        scatter, turning = (np.sqrt(v.var(axis=1).sum(axis=-1)) for v in (acc, gyr))
    still = (scatter < STEADY * mean) & (turning < SLOW)
    median = np.array(
        [np.median(m[np.isfinite(m)]) if np.isfinite(m).any() else np.nan for m in mean.T]
    )
    rested = np.array(
        [np.median(m[s]) if s.sum() >= 2 else np.nan for m, s in zip(mean.T, still.T)]
    )
    return Gravity(np.where(np.isfinite(rested), rested, median), np.isfinite(rested))


def accelerometer_unit(gravity: Gravity) -> str | None:
    """The unit, of UNITS, that most accelerometers read gravity in; None where it is m/s^2 or nothing known."""
    known = gravity.size > 0.0
    if not known.any():
        return None
    off = {u: np.abs(np.log(gravity.size[known] / size)) for u, size in GRAVITY_IN.items()}
    near = np.log(np.where(gravity.rested[known], AT_REST, MOVING))
    best = max(off, key=lambda u: (float(np.mean(off[u] < near)), -float(np.median(off[u]))))
    return best if best != "m/s^2" and np.mean(off[best] < near) >= MOST else None


def accelerometer_sizes(cells: Cells) -> tuple[list[Suspicion], float]:
    """What is wrong with the sizes, and the factor that takes readings to m/s^2.

    Parameters
    ----------
    cells : Cells
        Readings of S sensors, in whatever unit.

    Returns
    -------
    suspicions : list of Suspicion
        `file.accelerometer_unit` once for all; of single sensors at rest `sensor.accelerometer_unit` once for those that look like
        another unit, or `sensor.accelerometer_size` each whose gravity is off.
    factor : float
        1 where the unit is m/s^2.
    """
    span = (cells.start, cells.start + CELL * len(cells.valid))
    gravity = gravity_sizes(cells)
    unit = accelerometer_unit(gravity)
    factor = 1.0 if unit is None else GRAVITY / UNITS[unit]
    found = []
    if unit is not None:
        size = float(np.nanmedian(gravity.size))
        message = Message(
            "file.accelerometer_unit", {"size": size, "unit": unit, "factor": factor}, "fault"
        )
        p = float(2 * normal_sf(min(abs(np.log(factor)) * GRAVITY / SIZE_SD, 30.0)))
        found.append(Suspicion(message, cells.sensors, (span,), p, {"acc": factor * np.eye(3)}))
    other: dict[str, list[tuple[str, float, float]]] = {}  # sensor, size and p by unit
    for sensor, read, rested in zip(cells.sensors, gravity.size, gravity.rested):
        size = read * factor
        p = (
            len(cells.sensors) * 2 * float(normal_sf(abs(size - GRAVITY) / SIZE_SD))
            if rested
            else 1.0
        )
        if p < FALSE_ALARMS and (own := _other_unit(read, unit)):
            other.setdefault(own, []).append((sensor, read, p))
        elif p < FALSE_ALARMS and abs(size - GRAVITY) > NOTED:
            values: dict[str, float | str] = {
                "sensor": sensor,
                "size": float(size),
                "gravity": GRAVITY,
            }
            much = abs(size - GRAVITY) > FAULT
            message = Message("sensor.accelerometer_size", values, "fault" if much else "warning")
            found.append(Suspicion(message, (sensor,), (span,), float(p)))
    return [*found, *(_in_other_unit(u, read, span) for u, read in other.items())], factor


def _other_unit(size: float, common: str | None) -> str | None:
    """The unit, not the `common` one of the file, in which a reading at rest is gravity."""
    common = common or "m/s^2"
    return next(
        (
            u
            for u, gravity in GRAVITY_IN.items()
            if u != common and gravity / AT_REST < size < gravity * AT_REST
        ),
        None,
    )


def _in_other_unit(
    unit: str, readings: Sequence[tuple[str, float, float]], span: tuple[float, float]
) -> Suspicion:
    sensors, sizes, p = zip(*readings)
    values: dict[str, float | str] = {
        "sensors": ", ".join(sensors),
        "size": float(np.median(sizes)),
        "unit": unit,
        "factor": GRAVITY / GRAVITY_IN[unit],
    }
    message = Message("sensor.accelerometer_unit", values, "fault")
    return Suspicion(message, sensors, (span,), float(min(p)))


def negated_in_pose(
    sensors: tuple[str, ...], acc: Array, up: Array, span: tuple[float, float]
) -> list[Suspicion]:
    """Accelerometers that read gravity upside down in a pose.

    Parameters
    ----------
    sensors : tuple of str
        Names of S sensors.
    acc : Array
        (S, 3) mean specific force in the pose, m/s^2, sensors' frames; NaN where unknown.
    up : Array
        (S, 3) upwards in the sensors' frames as the pose and the nominal mounting have it.
    span : tuple of float
        s, of the pose.

    Returns
    -------
    list of Suspicion
        `file.accelerometer_negated` where most read it upside down: negated accelerometers, or the pose held upside down,
        or the other hand; else `sensor.accelerometer_negated` for single ones.
    """
    with np.errstate(invalid="ignore"):
        cosine = (acc * up).sum(axis=-1) / (
            np.linalg.norm(acc, axis=-1) * np.linalg.norm(up, axis=-1)
        )
    known, opposed = np.isfinite(cosine), cosine < -OPPOSED
    if known.sum() >= 3 and opposed.sum() >= MOST * known.sum():
        p = float(max(TURNED_SHARE ** int(opposed.sum()), 1e-12))
        return [
            Suspicion(
                Message("file.accelerometer_negated", {"count": float(opposed.sum())}, "fault"),
                sensors,
                (span,),
                p,
            )
        ]
    upright = (cosine > OPPOSED).sum() >= 3
    one = [
        Message("sensor.accelerometer_negated", {"sensor": s}, "fault")
        for s, o in zip(sensors, opposed)
        if o and upright
    ]
    return [
        Suspicion(m, (str(m.values["sensor"]),), (span,), TURNED_SHARE * len(sensors)) for m in one
    ]


OPPOSED = np.cos(np.radians(45.0))
TURNED_SHARE = 1e-5  # of sensors without fault that lie upside down in a pose
