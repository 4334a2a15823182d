"""Force sensors in cuffs on thumb and index finger: readings of a pinch with all errors of such sensors, and readings on a bench under weights.

Frames  each sensor's own; its cuff holds it and the inertial sensor, misaligned to each other
Units   N; raw readings in counts
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from handscope.validation.independent.simulator.hand import Values
from handscope.validation.independent.simulator.pinch import GRAVITY, RATE, Pinch

COUNT = 0.004  # N
WEIGHTS = (0.1, 0.2)  # kg that hang on the bench along both senses of every axis


def channel(finger: str, axis: str) -> str:
    """Name of a channel on the bench and in the recording."""
    return f"{finger}_force_{axis}"


@dataclass(frozen=True, kw_only=True)
class Cuffs:
    """Errors of both sensors; sizes are standard deviations of every axis."""

    rate: float = 12.0  # Hz
    calibrated: bool = False  # by weights on a bench, with the inertial sensor of the cuff
    scale: float = 0.02
    cross: float = 0.01  # share of another axis
    misaligned: float = 1.0  # deg about every axis against the inertial sensor
    offset: float = 0.2  # N
    walk: float = 0.02  # N/sqrt(s) of the offset
    noise: float = 0.05  # N
    # of thumb and index finger, changed since the calibration
    gain: tuple[float, float] = 1.0, 1.0
    jump: float = 0.0  # N of the thumb's zero while the object is held
    limit: float = 30.0  # N, full scale; not declared in the recording
    soft: float = 0.0  # N, scale of a soft saturation; 0: none
    low_pass: float = 0.0  # Hz; 0: none
    late: float = 0.0  # s by which time stamps are late


@dataclass(frozen=True)
class Sensor:
    """A force sensor as it is: matrix, rotation and offset."""

    matrix: Values  # (3, 3) what it reads of a force in its axes
    turned: Rotation  # its axes to the inertial sensor's
    offset: Values  # (3,) N


def draw_sensor(cuffs: Cuffs, rng: np.random.Generator) -> Sensor:
    """A sensor with errors drawn at random."""
    matrix = (
        np.eye(3)
        + np.diag(cuffs.scale * rng.normal(size=3))
        + cuffs.cross * rng.normal(size=(3, 3)) * (1 - np.eye(3))
    )
    turned = Rotation.from_rotvec(np.radians(cuffs.misaligned) * rng.normal(size=3))
    return Sensor(matrix, turned, cuffs.offset * rng.normal(size=3))


def simulate_readings(
    pinch: Pinch, cuffs: Cuffs, sensors: list[Sensor], rng: np.random.Generator
) -> tuple[Values, Values]:
    """Times (m,) s and readings (m, 2, 3) N."""
    t = np.arange(0.037, pinch.t[-1] - 0.05, 1 / cuffs.rate)
    rows = np.round(t * RATE).astype(int)
    forces = pinch.forces
    if cuffs.low_pass:
        share = 1 - np.exp(-2 * np.pi * cuffs.low_pass / RATE)
        forces = np.asarray(lfilter([share], [1, share - 1], forces, axis=0))
    out = np.empty((len(t), 2, 3))
    for k, sensor in enumerate(sensors):
        reading = (pinch.q[k][rows] * sensor.turned).inv().apply(forces[rows, k]) @ sensor.matrix.T
        if cuffs.soft:
            reading = cuffs.soft * np.tanh(reading / cuffs.soft)
        walked = (
            cuffs.walk / np.sqrt(cuffs.rate) * np.cumsum(rng.normal(size=reading.shape), axis=0)
        )
        reading = (
            cuffs.gain[k] * reading
            + sensor.offset
            + walked
            + cuffs.noise * rng.normal(size=reading.shape)
        )
        if k == 0 and cuffs.jump:
            reading += cuffs.jump * np.outer(t > pinch.task[0] + 4.0, [1.0, 0.0, 0.0])
        out[:, k] = np.clip(reading, -cuffs.limit, cuffs.limit)
    return t + cuffs.late, out


def on_the_bench(sensor: Sensor, finger: str, rng: np.random.Generator) -> str:
    """The table that `handscope calibrate-force` reads: two weights along both senses of every axis and none at all, directions by the cuff's accelerometer."""
    rows = [
        "mass [g],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],"
        + ",".join(f"{channel(finger, axis)} [count]" for axis in "xyz")
    ]
    bias, downs = (
        0.04 * rng.normal(size=3),
        [sign * np.eye(3)[axis] for axis in range(3) for sign in (1.0, -1.0)],
    )
    for mass, down in [(0.0, downs[0]), *((mass, down) for mass in WEIGHTS for down in downs)]:
        # nobody holds it straight
        hung = Rotation.from_rotvec(np.radians(3.0) * rng.normal(size=3)).apply(down)
        acc = -GRAVITY * sensor.turned.apply(hung) + bias + 0.01 * rng.normal(size=3)
        reading = (
            sensor.matrix @ (-mass * GRAVITY * hung) + sensor.offset + 0.01 * rng.normal(size=3)
        )
        rows.append(",".join(f"{value:.6g}" for value in [1e3 * mass, *acc, *(reading / COUNT)]))
    return "\n".join(rows) + "\n"
