"""Inertial and magnetic sensors on the segments: where they sit, how the skin carries them, how they err, what they read.

Out     gyroscope w_GS_S (rad/s), accelerometer R_SG (a + g) (m/s^2, specific force: +g upwards at rest), magnetometer R_SG B(p) (T), all in sensor
        frames and with the errors drawn for each sensor
Source  every error size is an option with its source; sensors on skin that follows the joint are moved exactly, with all their accelerations
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.hand.anatomy import FLEXION, JOINT, JOINTS, SEGMENT, side_sign
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation import soft_tissue
from handscope.estimators.simulation.distributions import DISTRIBUTIONS, draw
from handscope.estimators.simulation.kinematics import Kinematics
from handscope.estimators.simulation.magnetic_field import MagneticField

MPU9250 = "MPU-9250 product specification PS-MPU-9250A-01 rev. 1.0, tables 1-3"
CALIBRATED = "left after the strip's calibration (Salchow-Hoemmen 2019, 2.1: sensors calibrated once); size ours"
SLIP_DURATION = 0.5  # s
WALK_LENGTH = 7200  # s of bias random walk drawn for each sensor; it stays where it is afterwards


@dataclass(frozen=True, kw_only=True)
class SensorErrors:
    """Sizes (standard deviations unless noted) from which each sensor's own errors are drawn."""

    gyr_noise: float = option(
        0.01, "deg/s/sqrt(Hz)", "white noise density of the gyroscope", MPU9250
    )
    acc_noise: float = option(
        300e-6, "g/sqrt(Hz)", "white noise density of the accelerometer", MPU9250
    )
    mag_noise: float = option(
        0.6,
        "uT",
        "noise of one magnetometer sample",
        f"4 counts of 0.15 uT, {MPU9250}; number of counts ours",
    )
    gyr_bias: float = option(0.5, "deg/s", "bias of the gyroscope", CALIBRATED)
    acc_bias: float = option(0.05, "m/s^2", "bias of the accelerometer", CALIBRATED)
    mag_bias: float = option(1.0, "uT", "bias of the magnetometer", CALIBRATED)
    gyr_bias_walk: float = option(
        0.001,
        "deg/s/sqrt(s)",
        "random walk of the gyroscope's bias",
        "Allan deviations of consumer MEMS, about 10 deg/h; size ours",
    )
    gyr_scale: float = option(0.003, "1", "scale error of each gyroscope axis", CALIBRATED)
    acc_scale: float = option(0.003, "1", "scale error of each accelerometer axis", CALIBRATED)
    mag_scale: float = option(0.01, "1", "scale error of each magnetometer axis", CALIBRATED)
    cross_axis: float = option(0.003, "1", "share of another axis in each axis", CALIBRATED)
    misalignment: float = option(
        7.5,
        "deg",
        "middle of the angle of the sensor against its segment, about a random axis",
        "Salchow-Hoemmen 2019, 5: 5 to 10 deg",
    )
    misalignment_width: float = option(
        2.5,
        "deg",
        "largest difference from that angle, evenly spread",
        "Salchow-Hoemmen 2019, 5: 5 to 10 deg",
    )
    skin_angle: float = option(
        2.0,
        "deg",
        "turn of the sensor on its segment for 90 deg of flexion, about a random axis",
        "skin moves with the joint; size ours",
    )
    skin_shift: float = option(
        1.0,
        "mm",
        "slide of the sensor along its segment for 90 deg of flexion",
        "skin moves with the joint; size ours",
    )
    distribution: str = option(
        "listed",
        "1",
        "how these errors are distributed: as listed here, biases and scales normal; or all of them, misalignments and skin about each axis, with the same standard deviations",
        "ours",
        ("listed", *DISTRIBUTIONS),
    )
    skin_law: str = option(
        "proportional",
        "1",
        "how turn and slide follow the flexion",
        "ours: soft_tissue.py",
        tuple(soft_tissue.LAWS),
    )
    slip: float = option(
        0.0,
        "deg",
        "turn of a sensor's seat about a random axis, half way through what is performed",
        "none unless asked for",
    )
    slipping: int = option(17, "1", "how many of the sensors slip, drawn", "ours")
    gyr_range: float = option(2000.0, "deg/s", "full scale of the gyroscope", MPU9250)
    acc_range: float = option(16.0, "g", "full scale of the accelerometer", MPU9250)
    mag_range: float = option(4800.0, "uT", "full scale of the magnetometer", MPU9250)
    bits: int = option(
        16, "bit", "resolution of gyroscope and accelerometer; 0 = not rounded", MPU9250
    )


_NONE: dict[str, Any] = dict.fromkeys(
    (
        "gyr_noise",
        "acc_noise",
        "mag_noise",
        "gyr_bias",
        "acc_bias",
        "mag_bias",
        "gyr_bias_walk",
        "gyr_scale",
        "acc_scale",
        "mag_scale",
        "cross_axis",
        "misalignment",
        "misalignment_width",
        "skin_angle",
        "skin_shift",
    ),
    0.0,
)
IDEAL = SensorErrors(**_NONE, bits=0)
LSM330DLC = "LSM330DLC data sheet; HMC5983 data sheet; Kortier thesis ch. 2"
LSM330DLC_HMC5983 = SensorErrors(
    gyr_noise=0.03, acc_noise=220e-6, mag_noise=0.2, acc_range=8.0, mag_range=810.0
)
# what a preset does not name is as for the first
PRESET_SOURCES = {"MPU-9250": MPU9250, "LSM330DLC/HMC5983": LSM330DLC, "ideal": "no errors"}
PRESETS = {"MPU-9250": SensorErrors(), "LSM330DLC/HMC5983": LSM330DLC_HMC5983, "ideal": IDEAL}


@dataclass(frozen=True)
class SensorSet:
    """Sensors as mounted, errors drawn: rows belong to `segments`."""

    segments: tuple[str, ...]
    q_BS: Array  # (sensors, 4) true sensor-to-segment rotation of the straight hand, misalignment included
    nominal: Array  # (sensors, 4) mounting as configured
    p_BS: Array  # (sensors, 3) m, lever arm from the segment's origin in its frame, of the straight hand
    # (sensors, 3) rad of turn on the segment per rad of flexion, in the segment's frame
    skin_turn: Array
    skin_slide: Array  # (sensors, 3) m of slide per rad of flexion, in the segment's frame
    bias: Array  # (sensors, 9) gyroscope rad/s, accelerometer m/s^2, magnetometer T
    # (3 quantities, sensors, 3, 3) scale and cross-axis: reading = matrix @ truth + bias
    matrix: Array
    walk: Array  # (WALK_LENGTH + 1, sensors, 3) rad/s, the gyroscope bias's walk at full seconds
    errors: SensorErrors
    slips: Array | None = None  # (sensors, 3) rad, turn of the seat in the segment's frame
    slip_time: float = np.inf  # s, when it begins


def mount_sensors(
    segments: Sequence[str],
    geometry: HandGeometry,
    errors: SensorErrors,
    rng: np.random.Generator,
    nominal: Array | None = None,
) -> SensorSet:
    """Put sensors on the middle of the phalanges' backs, the hand's back and the forearm near the wrist, and draw their errors."""
    n, e = len(segments), errors
    straight = np.tile(quat.IDENTITY, (n, 1)) if nominal is None else nominal
    tilt = quat.exp(_misalignments(rng, n, e))
    sizes = np.repeat([np.radians(e.gyr_bias), e.acc_bias, e.mag_bias * 1e-6], 3)
    slide = (
        side_sign(geometry.hand)
        * np.array([0.0, e.skin_shift * 1e-3 / (np.pi / 2), 0.0])
        * rng.uniform(-1, 1, (n, 1))
    )
    steps = np.radians(e.gyr_bias_walk) * rng.normal(size=(WALK_LENGTH, n, 3))
    return SensorSet(
        tuple(segments),
        quat.multiply(tilt, straight),
        straight,
        np.array([_lever_arm(s, geometry) for s in segments]),
        np.radians(e.skin_angle) / (np.pi / 2) * _skin_axes(rng, n, e.distribution),
        slide,
        sizes * draw(rng, e.distribution, (n, 9)),
        np.stack(
            [_matrices(rng, n, scale, e) for scale in (e.gyr_scale, e.acc_scale, e.mag_scale)]
        ),
        np.concatenate([np.zeros((1, n, 3)), np.cumsum(steps, axis=0)]),
        e,
        _slips(rng, n, e) if e.slip else None,
    )


def simulate_inertial(
    sensors: SensorSet, k: Kinematics, rate: float, rng: np.random.Generator
) -> Array:
    """Readings (n, sensors, 6): gyroscope and accelerometer at the instants of the kinematics, `rate` Hz for the noise's bandwidth."""
    carried = _sensor_motion(sensors, k)
    e, bandwidth = sensors.errors, np.sqrt(rate / 2)
    gyr = (
        _distort(sensors, 0, quat.rotate(carried.q_SG, carried.w))
        + sensors.bias[:, :3]
        + _bias_walk(sensors, k.t)
    )
    acc = (
        _distort(sensors, 1, quat.rotate(carried.q_SG, carried.a + np.array([0, 0, GRAVITY])))
        + sensors.bias[:, 3:6]
    )
    gyr += np.radians(e.gyr_noise) * bandwidth * rng.normal(size=gyr.shape)
    acc += e.acc_noise * GRAVITY * bandwidth * rng.normal(size=acc.shape)
    return np.concatenate(
        [
            _convert(gyr, np.radians(e.gyr_range), e.bits),
            _convert(acc, e.acc_range * GRAVITY, e.bits),
        ],
        axis=-1,
    )


def simulate_magnetic(
    sensors: SensorSet, k: Kinematics, field: MagneticField, rng: np.random.Generator
) -> Array:
    """Magnetometer readings (n, sensors, 3) in T at the instants of the kinematics."""
    carried = _sensor_motion(sensors, k)
    e = sensors.errors
    mag = _distort(sensors, 2, quat.rotate(carried.q_SG, field.at(carried.p))) + sensors.bias[:, 6:]
    return _convert(
        mag + e.mag_noise * 1e-6 * rng.normal(size=mag.shape), e.mag_range * 1e-6, e.bits
    )


def true_mounting(sensors: SensorSet, k: Kinematics) -> Array:
    """True sensor-to-segment rotations q_BS (n, sensors, 4) at the instants of the kinematics, skin included."""
    flexion = _flexions(sensors, k)[0]
    turned = quat.exp(flexion[..., None] * sensors.skin_turn)
    return quat.multiply(turned, quat.multiply(_mounting_slip(sensors, k.t)[0], sensors.q_BS))


def sensor_poses(sensors: SensorSet, k: Kinematics) -> tuple[Array, Array]:
    """Orientation (n, sensors, 4) and place (n, sensors, 3) m of every sensor in the global frame, skin included."""
    carried = _sensor_motion(sensors, k)
    return quat.conjugate(carried.q_SG), carried.p


@dataclass(frozen=True)
class _SensorMotion:
    """Sensors moved along (n, sensors, ...) in the global frame."""

    q_SG: Array
    w: Array
    p: Array
    a: Array


def _sensor_motion(sensors: SensorSet, k: Kinematics) -> _SensorMotion:
    """Rigid-body motion of the segment plus the skin's own: Coriolis and Euler terms included."""
    s = np.array([SEGMENT[name] for name in sensors.segments])
    q_GB, w, dw = k.q_GB[:, s], k.w[:, s], k.dw[:, s]
    flexion, rate, acceleration = (f[..., None] for f in _flexions(sensors, k))
    arm = quat.rotate(q_GB, sensors.p_BS + flexion * sensors.skin_slide)
    drift, push = (
        quat.rotate(q_GB, rate * sensors.skin_slide),
        quat.rotate(q_GB, acceleration * sensors.skin_slide),
    )
    a = (
        k.a[:, s]
        + quat.cross(dw, arm)
        + quat.cross(w, quat.cross(w, arm))
        + 2 * quat.cross(w, drift)
        + push
    )
    skin = quat.exp(flexion * sensors.skin_turn)
    slipped, slip_rate = _mounting_slip(sensors, k.t)
    q_BS = quat.multiply(skin, quat.multiply(slipped, sensors.q_BS))
    # the turn's axis is fixed on the segment
    w_GS = w + quat.rotate(q_GB, rate * sensors.skin_turn + quat.rotate(skin, slip_rate))
    return _SensorMotion(quat.conjugate(quat.multiply(q_GB, q_BS)), w_GS, k.p[:, s] + arm, a)


def _flexions(sensors: SensorSet, k: Kinematics) -> tuple[Array, Array, Array]:
    """Flexion that each sensor's skin follows (n, sensors), with its first and second derivatives."""
    j = np.array([JOINT[_skin_joint(name)] for name in sensors.segments])
    flexion = k.angles[:, j, FLEXION], k.rates[:, j, FLEXION], k.accelerations[:, j, FLEXION]
    return soft_tissue.follow(sensors.errors.skin_law, k.t, flexion)


def _mounting_slip(sensors: SensorSet, t: Array) -> tuple[Array, Array]:
    """Turn of the seats at the instants t (n,) as rotations (n, sensors, 4), and its rate (n, sensors, 3) rad/s."""
    slips = np.zeros((len(sensors.segments), 3)) if sensors.slips is None else sensors.slips
    u = np.clip((t - sensors.slip_time) / SLIP_DURATION, 0.0, 1.0)[:, None, None]
    return quat.exp(u**2 * (3 - 2 * u) * slips), 6 * u * (1 - u) / SLIP_DURATION * slips


def _skin_joint(segment: str) -> str:
    """The joint whose flexion pulls the skin under a segment's sensor."""
    if segment == "forearm":
        return "wrist"
    return next((j.name for j in JOINTS if j.child == segment and segment != "hand"), "middle_mcp")


def _distort(sensors: SensorSet, quantity: int, truth: Array) -> Array:
    m = sensors.matrix[quantity]
    return np.asarray((m * truth[..., None, :]).sum(axis=-1))


def _bias_walk(sensors: SensorSet, t: Array) -> Array:
    """The gyroscope bias's walk (n, sensors, 3) at the instants t."""
    place = np.clip(t, 0.0, len(sensors.walk) - 1.001)
    before = place.astype(int)
    share = (place - before)[:, None, None]
    return np.asarray(sensors.walk[before] * (1 - share) + sensors.walk[before + 1] * share)


def _convert(values: Array, limit: float, bits: int) -> Array:
    """Clipped at full scale and rounded to the converter's counts."""
    clipped = np.clip(values, -limit, limit)
    if not bits:
        return np.asarray(clipped)
    count = limit / 2 ** (bits - 1)
    return np.asarray(np.rint(clipped / count) * count)


def _misalignments(rng: np.random.Generator, n: int, e: SensorErrors) -> Array:
    """Turns (n, 3) rad of sensors against their segments."""
    if e.distribution == "listed":
        angle = np.radians(e.misalignment + e.misalignment_width * rng.uniform(-1, 1, (n, 1)))
        return np.asarray(angle * _directions(rng, n))
    squared = (e.misalignment**2 + e.misalignment_width**2 / 3) / 3  # deg^2, about each axis
    return np.asarray(np.radians(np.sqrt(squared)) * draw(rng, e.distribution, (n, 3)))


def _skin_axes(rng: np.random.Generator, n: int, distribution: str) -> Array:
    """Axes (n, 3) that skin turns sensors about, of mean square 1."""
    if distribution == "listed":
        return _directions(rng, n)
    return np.asarray(draw(rng, distribution, (n, 3)) / np.sqrt(3.0))


def _slips(rng: np.random.Generator, n: int, e: SensorErrors) -> Array:
    """Turns (n, 3) rad of the seats of those that slip."""
    slips = np.radians(e.slip) * _directions(rng, n)
    slips[rng.permutation(n)[e.slipping :]] = 0.0
    return np.asarray(slips)


def _matrices(rng: np.random.Generator, n: int, scale: float, e: SensorErrors) -> Array:
    errors = e.cross_axis * draw(rng, e.distribution, (n, 3, 3))
    errors[:, range(3), range(3)] = scale * draw(rng, e.distribution, (n, 3))
    return np.eye(3) + errors


def _directions(rng: np.random.Generator, n: int) -> Array:
    """Unit vectors (n, 3) evenly spread over all directions."""
    v = rng.normal(size=(n, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def _lever_arm(segment: str, geometry: HandGeometry) -> Array:
    dorsal_distal = {"hand": (0.015, -0.5 * geometry.palm_length), "forearm": (0.025, -0.05)}.get(
        segment, (0.008, -0.5 * geometry.lengths[segment])
    )
    return side_sign(geometry.hand) * np.array([*dorsal_distal, 0.0])
