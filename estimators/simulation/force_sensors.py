"""Force sensors in the cuffs of fingertips: what they read of the forces that the fingers exert.

In      true forces by finger in the global frame (n, 5, 3) N, exerted by the finger on what it touches; the inertial sensors of the same tips
Out     readings (n, fingers, 3) N in the sensors' frames, of sensors with six axes (n, fingers, 3) Nm as well, with the errors drawn for each sensor
Source  Kortier, thesis 6.2 and 6.4: cuffs hold both sensors rigidly, 12 Hz, readings that follow the supply; sizes are options with their source
Limits  a cuff that shifts under load is not simulated; a sensor is touched in one place, where nothing twists: its torque is the force times a lever
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.kinematics import Kinematics
from handscope.estimators.simulation.sensors import SensorSet, true_mounting

PRECISION = "full-scale errors of a four-axis skin-interface sensor, BioMed Eng OnLine 11:90, Table 4: 0 to 4 %"


@dataclass(frozen=True, kw_only=True)
class ForceErrors:
    """Sizes (standard deviations unless noted) from which each sensor's own errors are drawn."""

    noise: float = option(
        0.05,
        "N",
        "noise of one reading in each axis",
        "mean error 0.05 to 0.07 N: El-Azizi et al. 2024, arXiv 2410.03481",
    )
    offset: float = option(
        0.2, "N", "reading of an axis that nothing touches, when switched on", "ours"
    )
    drift: float = option(
        0.02,
        "N/sqrt(s)",
        "random walk of that reading",
        "supply fluctuations, Kortier thesis 6.4, no size given; ours: 0.15 N in a minute",
    )
    scale: float = option(0.02, "1", "scale error of each axis", PRECISION)
    cross_axis: float = option(0.01, "1", "share of another axis in each axis", PRECISION)
    cuff: float = option(
        1.0,
        "deg",
        "turn of the force sensor against the inertial sensor on the cuff, in each axis",
        "3D print; ours",
    )
    torque_noise: float = option(
        2.5e-4,
        "Nm",
        "noise of one reading of a torque about each axis, of a sensor with six",
        "ours: `noise` at a lever of 5 mm",
    )
    torque_offset: float = option(
        1e-3,
        "Nm",
        "reading of a torque that nothing exerts, when switched on",
        "ours: `offset` at 5 mm",
    )
    torque_drift: float = option(
        1e-4, "Nm/sqrt(s)", "random walk of that reading", "ours: `drift` at 5 mm"
    )
    off_centre: float = option(
        1.5,
        "mm",
        "how far from the middle of its face a sensor is touched, along the finger and across",
        "half of its radius: Kortier thesis Fig. 6.1",
    )
    torque_limit: float = option(0.15, "Nm", "full scale of a torque", "ours: `limit` at 5 mm")
    limit: float = option(
        30.0,
        "N",
        "full scale of an axis",
        "ours: beyond what a pinch needs (power pinch of adults about 50 N)",
    )


IDEAL = ForceErrors(
    noise=0.0,
    offset=0.0,
    drift=0.0,
    scale=0.0,
    cross_axis=0.0,
    cuff=0.0,
    torque_noise=0.0,
    torque_offset=0.0,
    torque_drift=0.0,
)


@dataclass(frozen=True)
class ForceSensors:
    """Force sensors as worn, errors drawn."""

    fingers: tuple[str, ...]
    q_BF: Array  # (fingers, 4) on the cuff, against the inertial sensor's nominal mounting
    matrix: Array  # (fingers, 3, 3)
    offset: Array  # (fingers, 3) N
    errors: ForceErrors


@dataclass(frozen=True)
class SixAxes:
    """What the same sensors tell of torques, where they have six axes."""

    touched: Array  # (fingers, 3) m from the sensor's origin, in its frame
    offset: Array  # (fingers, 3) Nm


def draw_sensors(
    fingers: Sequence[str], errors: ForceErrors, rng: np.random.Generator
) -> ForceSensors:
    """Draw the errors of one sensor a finger; their axes lie along the segment's but for the cuff's error."""
    n, e = len(fingers), errors
    matrix = np.eye(3) + e.cross_axis * rng.normal(size=(n, 3, 3))
    matrix[:, range(3), range(3)] = 1 + e.scale * rng.normal(size=(n, 3))
    return ForceSensors(
        tuple(fingers),
        quat.exp(np.radians(e.cuff) * rng.normal(size=(n, 3))),
        matrix,
        e.offset * rng.normal(size=(n, 3)),
        e,
    )


def draw_six_axes(sensors: ForceSensors, rng: np.random.Generator) -> SixAxes:
    """Draw where each sensor is touched, and what it reads of no torque."""
    n, e = len(sensors.fingers), sensors.errors
    # x is the face's normal: conventions, segment frames
    touched = 1e-3 * e.off_centre * rng.normal(size=(n, 3)) * np.array([0.0, 1.0, 1.0])
    return SixAxes(touched, e.torque_offset * rng.normal(size=(n, 3)))


def simulate_forces(
    sensors: ForceSensors, tips: SensorSet, k: Kinematics, forces: Array, rng: np.random.Generator
) -> Array:
    """Readings (n, fingers, 3) N at the instants of the kinematics of the true forces (n, 5, 3)."""
    e = sensors.errors
    read = (
        np.einsum("nfi,fji->nfj", forces_in_sensors(sensors, tips, k, forces), sensors.matrix)
        + sensors.offset
    )
    return np.asarray(
        np.clip(read + _errors(k.t, read.shape, e.drift, e.noise, rng), -e.limit, e.limit)
    )


def simulate_torques(
    sensors: ForceSensors,
    six: SixAxes,
    tips: SensorSet,
    k: Kinematics,
    forces: Array,
    rng: np.random.Generator,
) -> Array:
    """Readings (n, fingers, 3) Nm of the same, about the sensors' origins."""
    e = sensors.errors
    read = np.cross(six.touched, forces_in_sensors(sensors, tips, k, forces)) + six.offset
    return np.asarray(
        np.clip(
            read + _errors(k.t, read.shape, e.torque_drift, e.torque_noise, rng),
            -e.torque_limit,
            e.torque_limit,
        )
    )


def forces_in_sensors(
    sensors: ForceSensors, tips: SensorSet, k: Kinematics, forces: Array
) -> Array:
    """The true forces (n, 5, 3) of the fingers that have a sensor (n, fingers, 3), in its frame."""
    mounting, own = true_mounting(tips, k), np.empty((len(k.t), len(sensors.fingers), 3))
    for f, finger in enumerate(sensors.fingers):
        segment = CHAINS[finger][-1]
        row = tips.segments.index(segment)
        q_GI = quat.multiply(k.q_GB[:, SEGMENT[segment]], mounting[:, row])
        q_GF = quat.multiply(
            quat.multiply(q_GI, quat.conjugate(tips.nominal[row])), sensors.q_BF[f]
        )
        own[:, f] = quat.rotate(quat.conjugate(q_GF), forces[:, FINGERS.index(finger)])
    return own


def _errors(
    t: Array, shape: tuple[int, ...], drift: float, noise: float, rng: np.random.Generator
) -> Array:
    """A random walk and white noise."""
    steps = np.sqrt(np.diff(t, prepend=t[:1]))[:, None, None]
    return np.asarray(
        np.cumsum(drift * steps * rng.normal(size=shape), axis=0) + noise * rng.normal(size=shape)
    )
