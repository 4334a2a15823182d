"""Soft-tissue artefact: skin that turns and slides a sensor on its segment with the flexion of joints, and the segment in the frame of that sensor.

In      flexion of joints; turn and slide of the sensor with each of them
Out     Skin, by sample; places and directions of the segment as the sensor sees them, and their derivatives
Source  ours: turn and slide are proportional to the flexion, with a quadratic term (`law`); angles need not be small. To a sensor that turned by c and slid by s a place r is at exp(-c) (r - s)
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

QUARTER = np.pi / 2


@dataclass(frozen=True)
class SensorDisplacement:
    """How far a sensor is turned (rad) and displaced (m) on its segment."""

    bent: Array  # (..., F) rad, by how far it follows the joints that pull it
    turn: Array  # (..., 3) rad, in the sensor's frame
    slide: Array  # (..., 3) m, in the frame that the sensor has where joints are straight
    back: Array  # (..., 3, 3) from that frame to the sensor's


def tissue_response(bent: Array, law: Array) -> Array:
    """How far skin follows joints that are bent by (..., J) rad; by a `law` (J,) more than in proportion where they are bent by 90 deg, share of it."""
    return np.asarray(bent * (1 + law * bent / QUARTER))


def tissue_response_derivatives(bent: Array, law: Array) -> tuple[Array, Array]:
    """The derivatives (..., J) of `tissue_response` by the bending and by the law."""
    return 1 + 2 * law * bent / QUARTER, bent**2 / QUARTER


def displace_sensor(bent: Array, turn: Array, slide: Array) -> SensorDisplacement:
    """By joints bent by (..., F) rad, of which each turns the sensor by `turn` (F, 3) rad/rad and slides it by `slide` (F, 3) m/rad."""
    turned = bent @ turn
    return SensorDisplacement(bent, turned, bent @ slide, quat.matrix(quat.exp(-turned)))


def place_in_sensor(skin: SensorDisplacement, place: Array) -> Array:
    """A place (3,) m of the segment in the frame of the displaced sensor, (..., 3) m."""
    return np.asarray(np.einsum("...ij,...j->...i", skin.back, place - skin.slide))


def place_by_turn(skin: SensorDisplacement, place: Array) -> Array:
    """The derivative (..., 3, 3) of `place_in_sensor` by the turn of a joint that is bent by 1."""
    return np.asarray(skin.back @ quat.skew(place - skin.slide) @ right_jacobian(-skin.turn))


def right_jacobian(v: Array) -> Array:
    """exp(v + dv) = exp(v) exp(right_jacobian(v) dv), rotation vectors (..., 3) -> (..., 3, 3). Source: Sola et al. 2018, (143)."""
    size = np.linalg.norm(v, axis=-1)[..., None, None]
    small = size < 1e-4
    safe = np.where(small, 1.0, size)
    K = quat.skew(v)
    one = np.where(small, 0.5 - size**2 / 24, (1 - np.cos(safe)) / safe**2)
    two = np.where(small, 1 / 6 - size**2 / 120, (safe - np.sin(safe)) / safe**3)
    return np.asarray(np.eye(3) - one * K + two * K @ K)
