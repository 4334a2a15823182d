"""What a stretch of free movement tells already of a joint, while it goes on: where the joint lies from both its sensors, and how far it was bent.

In      gyroscopes of the sensors before and behind a joint, on the same instants, and how one is turned against the other as live tracking has it
Out     information (6, 6) on the joint's place in both sensors' frames, which adds up over stretches; its standard deviation along the bones
Source  Kortier, thesis ch. 4, (4.11), (4.12) differentiated once more: both sensors see one acceleration of the joint,
        a_p + G(w_p) r_p = R_pc (a_c + G(w_c) r_c) with G(w) = [w]x [w]x + [w']x; the noise is that of self-calibration
Limits  a joint by itself, orientations counted as known: self-calibration, which knows that a bone's joints lie along it, finds lengths two to four
        times surer (13 s of a simulated hand: 1.6 to 3.9 mm here, lengths to 0.6 to 1.0 mm there), so enough here is enough there: of twelve
        recordings of an index finger (12, 15, 20 s) eight had enough and all eight got both lengths; it may find them long before
"""

from dataclasses import dataclass

import numpy as np

from estimators import quaternions as quat
from estimators.options import option
from estimators.quaternions import Array
from estimators.self_calibration.problem import Noise

ALONG = (1, 4)  # the bones' direction in the place before and behind the joint: sensors lie along them, nearly
SPREAD = (1.0, 99.0)  # per cent of the angles between which a joint's excursion lies


@dataclass(frozen=True, kw_only=True)
class ObservabilityParams:
    acc: float = option(
        Noise().acc, "m/s^2", "noise of an accelerometer's sample, play of joints and skin included", "Kortier, thesis 4.5.1"
    )
    place: float = option(
        Noise().place, "m", "distance of a joint's centre from a sensor, before anything is known", "Kortier, thesis 4.3.1"
    )
    enough: float = option(
        1.0, "mm", "standard deviation of a joint's place along the bones that is enough", "ours: 2 % of a proximal phalanx"
    )
    bent: float = option(30.0, "deg", "excursion of a joint that is enough", "ours: twice what self-calibration asks for at least")


@dataclass(frozen=True)
class Observed:
    """How much of what self-calibration needs a joint has shown."""

    joint: str
    place_sd: float  # m, along the bones
    excursion: float  # rad
    share: float  # 0 to 1: of what is enough; the lesser of both


def information(params: ObservabilityParams, gyr_p: Array, gyr_c: Array, q_pc: Array, dt: float) -> Array:
    """(6, 6) 1/m^2, of the place of the joint in the frames before (3) and behind it (3), from even samples (n, 3) rad/s every dt s.

    q_pc (n, 4) takes vectors from the frame of the sensor behind to that of the one before. Samples with NaN tell nothing.
    """
    if len(gyr_p) < 3:
        return np.zeros((6, 6))
    rows = np.concatenate([_lever(gyr_p, dt), -quat.matrix(q_pc) @ _lever(gyr_c, dt)], axis=2)
    rows = rows[np.isfinite(rows).all(axis=(1, 2))].reshape(-1, 6)
    return np.asarray(rows.T @ rows / (2.0 * params.acc**2))


def place_sd(params: ObservabilityParams, told: Array) -> float:
    """Standard deviation (m) of the joint's place along the bones, the larger one of both sides, from the information (6, 6) so far."""
    covariance = np.linalg.inv(told + np.eye(6) / params.place**2)
    return float(np.sqrt(max(covariance[k, k] for k in ALONG)))


def observed(params: ObservabilityParams, joint: str, told: Array, flexion: Array) -> Observed:
    """What a joint has shown by the information (6, 6) and the flexion (n,) rad so far, NaN where it was not followed."""
    known = flexion[np.isfinite(flexion)]
    excursion = float(np.ptp(np.percentile(known, SPREAD))) if len(known) else 0.0
    sd = place_sd(params, told)
    share = min(1.0, 1e-3 * params.enough / sd, excursion / np.radians(params.bent))
    return Observed(joint, sd, excursion, share)


def _lever(gyr: Array, dt: float) -> Array:
    """How the acceleration at a point changes with the point's place: G (n, 3, 3), 1/s^2."""
    turning = quat.skew(gyr)
    return np.asarray(turning @ turning + quat.skew(np.gradient(gyr, dt, axis=0)))
