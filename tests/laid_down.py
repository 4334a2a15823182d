"""A rigid sensor laid down in one position after another: its readings with errors of known size, for tests of its calibration."""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, MAG
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors.imu_calibration import ImuCalibration
from handscope.estimators.simulation import sensors
from handscope.estimators.simulation.sensors import SensorErrors

RATE = 100.0
RAW = SensorErrors(
    gyr_bias=5.0,
    acc_bias=60e-3 * GRAVITY,
    mag_bias=30.0,
    gyr_scale=0.03,
    acc_scale=0.03,
    mag_scale=0.05,
    cross_axis=0.02,
    misalignment=0.0,
    misalignment_width=0.0,
)  # MPU-9250 product specification PS-MPU-9250A-01 rev. 1.0, tables 1-3: tolerances before calibration, taken as standard deviations
FIELD = 48e-6 * np.array(
    [0.0, np.cos(np.radians(65.0)), -np.sin(np.radians(65.0))]
)  # T, dip in central Europe (IGRF)
SIX = [quat.about(0, k * np.pi / 2) for k in range(4)] + [
    quat.about(1, s * np.pi / 2) for s in (1, -1)
]


@dataclass(frozen=True)
class Readings:
    """One sensor's samples and the errors in them: reading = matrix @ truth + bias."""

    t: Array
    gyr: Array  # (n, 3)
    acc: Array
    mag: Array
    matrix: dict[str, Array]
    bias: dict[str, Array]

    @property
    def truth(self) -> ImuCalibration:
        """The calibration that a routine which sees gravity can find: the accelerometer's matrix symmetric, the others turned alike."""
        A = self.matrix[ACC]
        values, vectors = np.linalg.eigh(A @ A.T)
        M = vectors @ np.diag(values**-0.5) @ vectors.T
        turn = M @ A
        return ImuCalibration(
            {ACC: M, **{q: turn @ np.linalg.inv(self.matrix[q]) for q in (GYR, MAG)}}, self.bias
        )


def many_positions(seed: int, count: int = 14) -> list[Array]:
    """The six sides, then any orientations."""
    drawn = np.random.default_rng(seed).normal(size=(count - 6, 4))
    return [*SIX, *quat.normalize(drawn)]


def laid_down(
    positions: list[Array],
    seed: int,
    errors: SensorErrors = RAW,
    rest: float = 3.0,
    turn: float = 2.0,
) -> Readings:
    """Rest in each position, smooth turns of at most 180 deg between; the sensor does not leave its place."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, len(positions) * rest + (len(positions) - 1) * turn, 1 / RATE)
    q_GS = _orientations(positions, t, rest, turn)
    gyr = _rates(positions, t, rest, turn)
    up, field = (quat.rotate(quat.conjugate(q_GS), v) for v in (np.array([0, 0, GRAVITY]), FIELD))
    drawn = sensors.mount_sensors(("hand",), sized("left"), errors, rng)
    matrix = {q: drawn.matrix[k, 0] for k, q in enumerate((GYR, ACC, MAG))}
    bias = {q: drawn.bias[0, 3 * k : 3 * k + 3] for k, q in enumerate((GYR, ACC, MAG))}
    noise = {
        GYR: np.radians(errors.gyr_noise) * np.sqrt(RATE / 2),
        ACC: errors.acc_noise * GRAVITY * np.sqrt(RATE / 2),
        MAG: errors.mag_noise * 1e-6,
    }
    read = {
        q: v @ matrix[q].T + bias[q] + noise[q] * rng.normal(size=v.shape)
        for q, v in ((GYR, gyr), (ACC, up), (MAG, field))
    }
    return Readings(t, read[GYR], read[ACC], read[MAG], matrix, bias)


def _place(t: Array, count: int, rest: float, turn: float) -> tuple[Array, Array, Array]:
    """Which turn, how far along it (0 to 1, smooth) and how fast (1/s)."""
    k = np.minimum((t // (rest + turn)).astype(int), count - 1)
    x = np.clip((t - k * (rest + turn) - rest) / turn, 0.0, 1.0)
    return k, x**3 * (10 - 15 * x + 6 * x**2), 30 * x**2 * (1 - x) ** 2 / turn


def _orientations(positions: list[Array], t: Array, rest: float, turn: float) -> Array:
    k, share, _ = _place(t, len(positions), rest, turn)
    here = np.array(positions)
    steps = np.array(
        [*(quat.log(quat.relative(a, b)) for a, b in zip(here, here[1:])), np.zeros(3)]
    )
    return quat.multiply(here[k], quat.exp(share[:, None] * steps[k]))


def _rates(positions: list[Array], t: Array, rest: float, turn: float) -> Array:
    k, _, speed = _place(t, len(positions), rest, turn)
    steps = np.array(
        [*(quat.log(quat.relative(a, b)) for a, b in zip(positions, positions[1:])), np.zeros(3)]
    )
    return np.asarray(speed[:, None] * steps[k])
