"""Simulated trunk with an inertial sensor and magnetometers on the breastbone, and a magnet on the
back of the hand.

Frames  trunk's sensor b: x up, z forward, y right, as in magnet.py; trunk: x forward, y up, z right
Out     readings of the trunk's inertial sensor and of the magnetometers while the hand moves; the
        declared plate; the truth
Source  seated healthy people reach within an arm's length with 2 to 4 cm of the trunk: Levin et al.
        2002, Exp Brain Res 143:171; sensors: magnet.py
Limits  the trunk leans about the hips, rotates in phase with the wrist, and breathes; it does not
        slide on its chair
"""

from dataclasses import dataclass, field, replace

import numpy as np

from handscope.estimators.data.magnet_declaration import Place, Plate
from handscope.estimators.data.samples import ACC, GYR, MAG, TRUNK, TRUNK_MAGNETOMETERS, Stream
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation import magnet, sensors
from handscope.estimators.simulation.kinematics import Kinematics
from handscope.estimators.simulation.magnet import NEUTRAL, MagnetErrors, Worn
from handscope.estimators.simulation.magnetic_field import DIP, EARTH, MagneticField, homogeneous
from handscope.estimators.simulation.motion import COORDINATES, Motion
from handscope.estimators.simulation.sensors import SensorErrors, SensorSet

# m of the breastbone above and behind the wrist at rest, and above the hips; ours
ABOVE_WRIST, BEHIND_WRIST, ABOVE_HIPS = 0.20, 0.12, 0.40
# rad a metre of the wrist forward: 4 cm of the breastbone in 0.28 m (Levin 2002)
LEAN, TURN = 0.30, 0.15
BREATH, BREATHS = 0.008, 0.25  # rad to either side, Hz
# A m^2: neodymium of 1.3 T (N42), 20 mm across, 5 mm thick
DISC = np.array([0.0, 0.0, 1.3 / (4e-7 * np.pi) * np.pi * 0.010**2 * 0.005])
MAGNETOMETERS = TRUNK_MAGNETOMETERS[: len(magnet.PLATE)]
# uT, 1, deg: residuals after calibration in an office, at most (magnetometer_ellipsoid.py)
CALIBRATION_RESIDUALS = MagnetErrors(hard_iron=0.2, soft_iron=0.004, turn=0.06)
# of the trunk's sensor and magnetometers
Q_BS = quat.from_matrix(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))


@dataclass(frozen=True, kw_only=True)
class TrunkGlove:
    """What is worn on the trunk."""

    rate: float = 100.0  # Hz of the inertial sensor
    mag_rate: float = 75.0  # Hz: the fastest of the HMC5883L's data sheet
    errors: SensorErrors = field(default_factory=lambda: magnet.ARRAY_ERRORS)
    plate: MagnetErrors = CALIBRATION_RESIDUALS
    lean: float = LEAN  # rad/m
    room: MagneticField = field(default_factory=homogeneous)


@dataclass(frozen=True)
class Carried:
    """Plate and magnet drawn for one person."""

    glove: TrunkGlove
    worn: Worn
    plate: Plate  # as declared

    @property
    def mounting(self) -> dict[str, Array]:
        return dict.fromkeys((TRUNK, *MAGNETOMETERS), Q_BS)


def streams(glove: TrunkGlove) -> tuple[Stream, Stream]:
    """The trunk's inertial sensor, and its magnetometers."""
    e = glove.errors
    scale = {GYR: float(np.radians(e.gyr_range)), ACC: e.acc_range * GRAVITY}
    array = Stream(
        "trunk_mag", MAGNETOMETERS, (MAG,), glove.mag_rate, "base", {MAG: 1e-6 * e.mag_range}
    )
    return Stream("trunk", (TRUNK,), (GYR, ACC), glove.rate, "base", scale), array


def draw_carried(glove: TrunkGlove, rng: np.random.Generator) -> Carried:
    """Draw plate and magnet; the user measures them with a ruler."""
    worn = magnet.draw_worn(rng, glove.errors, glove.plate, moment=DISC)
    places = {name: _place(p) for name, p in zip(MAGNETOMETERS, worn.declared_places)}
    return Carried(
        glove,
        worn,
        Plate(places, _place(worn.declared_moment), _place(worn.declared_lever), EARTH, DIP),
    )


def simulate_inertial(c: Carried, motion: Motion, t: Array, rng: np.random.Generator) -> Array:
    """Readings (n, 1, 6) of the trunk's sensor."""
    m = simulate_trunk(c, motion, t)
    return magnet.simulate_inertial(c.worn, m, rng)[:, :1] if len(t) > 1 else np.empty((0, 1, 6))


def simulate_magnetic(
    c: Carried, motion: Motion, k: Kinematics, worn: SensorSet, rng: np.random.Generator
) -> Array:
    """Readings (n, magnetometers, 3) in T."""
    return magnet.simulate_magnetic(
        c.worn, with_hand(simulate_trunk(c, motion, k.t), k, worn), c.glove.room, rng
    )


def simulate_trunk(c: Carried, motion: Motion, t: Array) -> magnet.Motion:
    """The trunk's sensor twice: in the row of the hand's stands its own."""
    y, dy, ddy = (x[:, COORDINATES["wrist_y"]] for x in motion.at(t))
    pace = 2 * np.pi * BREATHS
    breath = (
        BREATH * np.sin(pace * t),
        BREATH * pace * np.cos(pace * t),
        -BREATH * pace**2 * np.sin(pace * t),
    )
    lean, rate, push = (c.glove.lean * v + b for v, b in zip((y, dy, ddy), breath))
    q_lean, none = quat.about(0, -lean), np.zeros(len(t))
    q = quat.multiply(q_lean, quat.multiply(quat.about(2, -TURN * y), NEUTRAL))
    up = np.column_stack([none, np.sin(lean), np.cos(lean)])
    forward = np.column_stack([none, np.cos(lean), -np.sin(lean)])
    p = np.array([0.0, -BEHIND_WRIST, ABOVE_WRIST - ABOVE_HIPS]) + ABOVE_HIPS * up
    a = ABOVE_HIPS * (push[:, None] * forward - (rate**2)[:, None] * up)
    w = np.column_stack([-rate, none, none]) - (TURN * dy)[:, None] * up
    w_b = quat.rotate(quat.conjugate(q), w)
    return magnet.Motion(t, *(np.stack([v, v], axis=1) for v in (p, q, w_b, a)))


def with_hand(trunk: magnet.Motion, k: Kinematics, worn: SensorSet) -> magnet.Motion:
    """The trunk with the hand's sensor as the target; the target's rates and accelerations are not
    set."""
    q, p = sensors.sensor_poses(worn, k)
    row = worn.segments.index("hand")
    places, turns = trunk.p.copy(), trunk.q.copy()
    places[:, 1], turns[:, 1] = p[:, row], q[:, row]
    return magnet.Motion(trunk.t, places, turns, trunk.w, trunk.a)


def add_true_position(
    c: Carried, motion: Motion, k: Kinematics, worn: SensorSet, truth: Trajectory
) -> Trajectory:
    """The truth with the position of the hand's sensor from the trunk's, and the trunk's
    orientation."""
    m = with_hand(simulate_trunk(c, motion, k.t), k, worn)
    n = len(k.t)
    return replace(
        truth,
        place=quat.rotate(Q_BS, m.p_bt),
        place_sd=np.zeros((n, 3)),
        place_flags=np.zeros(n, np.uint8),
        q_trunk=quat.multiply(m.q[:, 0], quat.conjugate(Q_BS)),
        q_trunk_sd=np.zeros((n, 3)),
        signal=np.full(n, np.nan),
    )


def _place(v: Array) -> Place:
    return float(v[0]), float(v[1]), float(v[2])
