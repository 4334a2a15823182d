"""A trunk with magnetometers, a hand with a magnet, and the room around them: motion, field and faults of sensors from physics alone.

It shares nothing with the estimators or with their own simulator: no quaternion, no dipole, no motion, no constant. It imports numpy and scipy only, which a test holds.

Frames  room: x right, y forward, z up; sensor on the breastbone: x right, y down, z forward; hand's sensor: on the back of the left hand, x dorsal, y distal
Source  field of a current loop: Smythe, Static and dynamic electricity, 3rd ed., 7.10; a cylinder magnetised along its axis is the sheet of current around it; reach of minimum
        jerk: Flash & Hogan 1985, J Neurosci 5:1688; magnetometers: LIS3MDL data sheet; inertial sensors: BMI160 data sheet; sway of the trunk in walking: Winter 1991
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp
from scipy.special import ellipe, ellipk

Array = NDArray[np.float64]
FINE = 1000.0  # Hz of the motion
STILL = 5.0  # s at the start, the hand flat and at rest
G = 9.81  # m/s^2
MU0 = 4e-7 * np.pi
# breastbone to room
UPRIGHT = Rotation.from_matrix([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
# left hand to room, fingers forward
PALM_DOWN = Rotation.from_matrix([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
RADIUS, LENGTH, REMANENCE = 0.004, 0.008, 1.2  # m, m, T: a rod of neodymium of 8 mm by 8 mm
MOMENT = REMANENCE / MU0 * np.pi * RADIUS**2 * LENGTH  # A m^2
# m, breastbone's sensor
PLATE = np.array([[0.0, 0.0, 0.004], [0.085, 0.01, 0.0], [-0.04, 0.06, 0.012], [0.05, 0.095, 0.0]])
ON_HAND = np.array([0.008, 0.02, 0.0])  # m of the magnet from the hand's sensor
# T in the room
EARTH = 48e-6 * np.array([0.0, np.cos(np.radians(64.0)), -np.sin(np.radians(64.0))])
# T/m, root mean square of the components' slopes: BROAD's laboratory (decision 0011)
GRADIENT = 2.3e-6
RATE, MAG_RATE = 100.0, 75.0  # Hz
# s by which samples of the trunk and of the magnetometers come after the hand's
TRUNK_PHASE, MAG_PHASE = 0.004, 0.007
LATEST = 0.010  # s: longest time from a magnetometer's measurement to its time stamp
BIAS_GYR, BIAS_ACC = np.radians(0.3), 0.05  # rad/s, m/s^2
SCALE, MISALIGNMENT = 0.003, np.radians(0.2)  # of the inertial sensors' axes
NOISE_GYR, NOISE_ACC = np.radians(0.007), 180e-6 * G  # a root hertz
STEP_GYR, STEP_ACC = np.radians(2000.0) / 2**15, 8 * G / 2**15
NOISE_MAG, STEP_MAG, LIMIT_MAG = 0.35e-6, 0.0146e-6, 400e-6  # T
# T, 1, rad of a magnetometer on the plate, of the first against the inertial sensor
HARD, SOFT, TURNED, BESIDE = 30e-6, 0.04, np.radians(1.0), np.radians(0.2)
# m, rad, share: errors of the declared places, of the moment's direction and of its size
RULER, ANGLE, GRADE = 0.001, np.radians(1.0), 0.01
LOOPS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True)
class Motion:
    """Trunk's and hand's sensor at FINE instants in the room."""

    t: Array  # (n,) s
    p: tuple[Array, Array]  # (n, 3) m, trunk and hand
    R: tuple[Rotation, Rotation]  # sensor to room

    def at(self, t: Array) -> tuple[tuple[Array, Array], tuple[Rotation, Rotation]]:
        """Places and rotations at other instants."""
        p, q = (
            np.column_stack([np.interp(t, self.t, axis) for axis in place.T]) for place in self.p
        )
        a, b = (Slerp(self.t, turn)(np.clip(t, self.t[0], self.t[-1])) for turn in self.R)
        return (p, q), (a, b)


@dataclass(frozen=True)
class Worn:
    """Sensors and magnet of one person as they are, and as they are declared."""

    # of trunk's and hand's gyroscope, then accelerometers: matrix (3, 3), bias (3,)
    imu: tuple[tuple[Array, Array], ...]
    places: Array  # (magnetometers, 3) m
    iron: Array  # (magnetometers, 3, 3) soft iron, with the axes' misalignment
    hard: Array  # (magnetometers, 3) T, hard iron
    late: float  # s by which time stamps of the magnetometers are late
    moment: Array  # (3,) A m^2, hand's sensor
    lever: Array  # (3,) m
    declared_places: Array
    declared_moment: Array


@dataclass(frozen=True)
class Room:
    """The room's field in T and its gradient in T/m."""

    field: Array  # (3,) T
    slopes: Array  # (3, 3) T/m, symmetric and without trace: no current, no magnet here
    origin: Array  # (3,) m, where the field is `field`

    def at(self, p: Array) -> Array:
        """Field (n, 3) T at places (n, 3) m."""
        return np.asarray(self.field + (p - self.origin) @ self.slopes)


def room(rng: np.random.Generator, gradient: float = GRADIENT) -> Room:
    """A room with a field drawn at random."""
    raw = rng.normal(size=(3, 3))
    raw = raw + raw.T
    raw -= np.eye(3) * np.trace(raw) / 3
    return Room(EARTH, gradient * raw / np.sqrt((raw**2).mean()), rng.normal(size=3) * 0.1)


def worn(rng: np.random.Generator, magnetometers: int) -> Worn:
    """A board and a magnet as they are worn, drawn at random."""
    sizes = ((BIAS_GYR, 0), (BIAS_GYR, 1), (BIAS_ACC, 2), (BIAS_ACC, 3))
    imu = tuple((_matrix(rng, SCALE, MISALIGNMENT), bias * rng.normal(size=3)) for bias, _ in sizes)
    turned = TURNED * rng.normal(size=(len(PLATE), 3))
    turned[0] *= BESIDE / TURNED
    stretch = SOFT * rng.normal(size=(len(PLATE), 3, 3))
    stretch = (stretch + stretch.transpose(0, 2, 1)) / 2  # soft iron turns nothing
    iron = np.array(
        [
            (np.eye(3) + s) @ Rotation.from_rotvec(r).inv().as_matrix()
            for s, r in zip(stretch, turned)
        ]
    )
    true, lever = PLATE + RULER * rng.normal(size=PLATE.shape), ON_HAND + RULER * rng.normal(size=3)
    declared = MOMENT * np.array([1.0, 0.0, 0.0])
    moment = Rotation.from_rotvec(ANGLE * rng.normal(size=3)).apply(declared) * (
        1 + GRADE * rng.normal()
    )
    hard, late = HARD * rng.normal(size=PLATE.shape), rng.uniform(0, LATEST)
    some = slice(magnetometers)
    return Worn(imu, true[some], iron[some], hard[some], late, moment, lever, PLATE[some], declared)


def _matrix(rng: np.random.Generator, scale: float, misalignment: float) -> Array:
    return np.asarray(
        np.diag(1 + scale * rng.normal(size=3))
        + misalignment * rng.normal(size=(3, 3)) * (1 - np.eye(3))
    )


def cylinder(r: Array, along: Array, moment: float) -> Array:
    """Field (n, 3) T at r (n, 3) m from the middle of a rod of RADIUS and LENGTH that is magnetised along the unit vectors `along` (n, 3)."""
    z = (r * along).sum(axis=1)
    across = r - z[:, None] * along
    rho = np.maximum(np.linalg.norm(across, axis=1), 1e-7)
    out = np.zeros_like(r)
    for node, weight in zip(*LOOPS):
        by_z, by_rho = _loop(
            rho, z - 0.5 * LENGTH * node, 0.5 * weight * moment / (np.pi * RADIUS**2)
        )
        out += by_z[:, None] * along + (by_rho / rho)[:, None] * across
    return out


def _loop(rho: Array, z: Array, current: float) -> tuple[Array, Array]:
    """Along the axis and away from it, T, of a current (A) around RADIUS. (Smythe 7.10)"""
    near, far = (RADIUS - rho) ** 2 + z**2, (RADIUS + rho) ** 2 + z**2
    K, E = ellipk(4 * RADIUS * rho / far), ellipe(4 * RADIUS * rho / far)
    scale, square = MU0 * current / (2 * np.pi * np.sqrt(far)), rho**2 + z**2
    return scale * (K + (RADIUS**2 - square) / near * E), scale * z / rho * (
        -K + (RADIUS**2 + square) / near * E
    )


def magnetometers(
    w: Worn, m: Motion, r: Room, rng: np.random.Generator, magnet: bool = True
) -> tuple[Array, Array]:
    """Time stamps (n,) s and raw readings (n, magnetometers, 3) T."""
    t = np.arange(m.t[0] + MAG_PHASE, m.t[-1], 1 / MAG_RATE)
    (trunk, hand), (R_b, R_t) = m.at(t - w.late)
    size = float(np.linalg.norm(w.moment))
    rod, along = hand + R_t.apply(w.lever), R_t.apply(w.moment / size)
    read = []
    for place, iron, hard in zip(w.places, w.iron, w.hard):
        at = trunk + R_b.apply(place)
        B = r.at(at) + (cylinder(at - rod, along, size) if magnet else 0.0)
        read.append(R_b.inv().apply(B) @ iron.T + hard)
    raw = np.stack(read, axis=1) + NOISE_MAG * rng.normal(size=(len(t), len(read), 3))
    return t, np.clip(np.round(raw / STEP_MAG) * STEP_MAG, -LIMIT_MAG, LIMIT_MAG)


def inertial(w: Worn, m: Motion, which: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Time stamps (n,) and samples (n, 6), gyroscope rad/s and accelerometer m/s^2, of the trunk's (0) or hand's (1) sensor: means since the sample before."""
    h, R, p = 1 / FINE, m.R[which], m.p[which]
    rate = (R[:-1].inv() * R[1:]).as_rotvec() / h
    pulled = np.zeros_like(p)
    pulled[1:-1] = (p[2:] - 2 * p[1:-1] + p[:-2]) / h**2
    force = R.inv().apply(pulled + [0.0, 0.0, G])
    t = np.arange(m.t[0] + 1 / RATE + (TRUNK_PHASE if which == 0 else 0.0), m.t[-1] - h, 1 / RATE)
    edges = np.concatenate([[t[0] - 1 / RATE], t])
    turned = np.concatenate([np.zeros((1, 3)), np.cumsum(rate, axis=0) * h])
    pushed = np.concatenate(
        [np.zeros((1, 3)), np.cumsum(0.5 * (force[1:] + force[:-1]), axis=0) * h]
    )
    gyr, acc = (
        np.diff(np.column_stack([np.interp(edges, m.t, axis) for axis in v.T]), axis=0) * RATE
        for v in (turned, pushed)
    )
    (by_gyr, off_gyr), (by_acc, off_acc) = w.imu[which], w.imu[2 + which]
    white = np.sqrt(RATE / 2) * rng.normal(size=(len(t), 6))
    gyr, acc = (
        gyr @ by_gyr.T + off_gyr + NOISE_GYR * white[:, :3],
        acc @ by_acc.T + off_acc + NOISE_ACC * white[:, 3:],
    )
    return t, np.concatenate(
        [np.round(gyr / STEP_GYR) * STEP_GYR, np.round(acc / STEP_ACC) * STEP_ACC], axis=1
    )


def turned_about(rng: np.random.Generator, seconds: float = 60.0) -> Motion:
    """The plate in somebody's hands, turned every way in a quarter of a cubic metre; the hand is elsewhere."""
    t = np.arange(0.0, seconds, 1 / FINE)
    pace = rng.uniform(0.6, 1.0, 3)
    R = Rotation.from_euler(
        "zyx", np.column_stack([pace[0] * t, 1.7 * np.sin(0.31 * pace[1] * t), 0.83 * pace[2] * t])
    )
    p = 0.05 * np.column_stack([np.sin(0.9 * t), np.cos(0.7 * t), np.sin(0.5 * t + 1)])
    return Motion(t, (p, p + 5.0), (R, R))


def minimum_jerk(u: Array) -> Array:
    """Minimum-jerk course from 0 to 1 for u from 0 to 1. (Flash & Hogan 1985)"""
    s = np.clip(u, 0.0, 1.0)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def moves(
    rng: np.random.Generator,
    t: Array,
    n: int,
    size: float,
    lasting: tuple[float, float],
    rest: float,
) -> Array:
    """Coordinates (len(t), n) that go from value to value within +-size, each with durations of its own and rests between."""
    out = np.zeros((len(t), n))
    for k in range(n):
        begin, value = STILL + rng.uniform(0, 1), 0.0
        while begin < t[-1]:
            to, long = rng.uniform(-size, size), rng.uniform(*lasting)
            out[:, k] += (to - value) * minimum_jerk((t - begin) / long)
            begin, value = begin + long * rng.uniform(0.8, 1.0) + rng.exponential(rest), to
    return out


def breathing(rng: np.random.Generator, t: Array) -> tuple[Array, Array]:
    """Position (n, 3) m and angles (n, 3) rad about right, down, forward of a trunk that breathes."""
    breath = np.sin(2 * np.pi * rng.uniform(0.2, 0.3) * t + 0.6 * np.sin(2 * np.pi * 0.05 * t))
    slow = np.sin(2 * np.pi * 0.07 * t[:, None] + rng.uniform(0, 6, 3))
    return 0.003 * breath[:, None] * [0, 1, 0.3] + 0.002 * slow, np.radians(0.8) * breath[
        :, None
    ] * [1, 0, 0] + np.radians(0.4) * slow


def seated(rng: np.random.Generator, t: Array) -> tuple[Array, Array]:
    """Trunk of a seated person, as `breathing`."""
    return breathing(rng, t)


def leaning(rng: np.random.Generator, t: Array) -> tuple[Array, Array]:
    """Trunk that leans by some centimetres and turns by up to 30 deg, as `breathing`."""
    p, angles = breathing(rng, t)
    yaw, pitch, roll = moves(rng, t, 3, 1.0, (1.5, 3.0), 0.5).T
    turned = np.column_stack([np.radians(12) * pitch, np.radians(30) * yaw, np.radians(6) * roll])
    # the breastbone above the hips, sensor's axes
    hips = Rotation.from_euler("XYZ", turned).apply([0.0, -0.35, 0.0]) - [0.0, -0.35, 0.0]
    return p + UPRIGHT.apply(hips), angles + turned


def stepping(rng: np.random.Generator, t: Array) -> tuple[Array, Array]:
    """Trunk in stepping on the spot: sideways with every stride, up and down with every step; as `breathing`."""
    stride = 2 * np.pi * rng.uniform(0.8, 1.0) * np.maximum(t - STILL, 0.0)
    begun = minimum_jerk((t - STILL) / 3.0)[:, None]
    p, angles = breathing(rng, t)
    sway = np.column_stack(
        [0.025 * np.sin(stride), 0.008 * np.sin(2 * stride + 1), 0.015 * np.sin(2 * stride)]
    )
    turn = np.radians(1.0) * np.column_stack(
        [1.5 * np.sin(2 * stride), 6 * np.sin(stride + 0.5), 2 * np.sin(stride)]
    )
    return p + begun * sway, angles + begun * turn


def reaching(
    rng: np.random.Generator, t: Array, trunk: Callable[[float], tuple[Array, Rotation]]
) -> tuple[Array, Array]:
    """Hand, position (n, 3) m and angles (n, 3) rad: reaches to places 12 to 38 cm from the breastbone at the beginning of the reach, with random orientations."""
    return _reaches(rng, t, trunk, 0.12, 0.38), moves(rng, t, 3, np.radians(40), (0.7, 1.5), 0.4)


def touching(
    rng: np.random.Generator, t: Array, trunk: Callable[[float], tuple[Array, Rotation]]
) -> tuple[Array, Array]:
    """Hand to the chest and away, as `reaching`: the nearest magnetometers saturate."""
    return _reaches(rng, t, trunk, 0.04, 0.25), moves(rng, t, 3, np.radians(30), (0.7, 1.5), 0.4)


def resting(
    rng: np.random.Generator, t: Array, trunk: Callable[[float], tuple[Array, Rotation]]
) -> tuple[Array, Array]:
    """Hand at rest on a table, a quarter of a metre before the breastbone; as `reaching`."""
    p, R = trunk(0.0)
    at = p + R.apply(rng.uniform([-0.06, 0.02, 0.18], [0.10, 0.10, 0.26]))
    tremor = 2e-4 * np.sin(2 * np.pi * 8.5 * t[:, None] + rng.uniform(0, 6, 3))
    return at + tremor, np.zeros((len(t), 3))


def sliding(
    rng: np.random.Generator, t: Array, trunk: Callable[[float], tuple[Array, Rotation]]
) -> tuple[Array, Array]:
    """Hand that slides to and fro over a table without turning, as `reaching`."""
    p, R = trunk(0.0)
    level = moves(rng, t, 2, 1.0, (1.0, 2.5), 0.6) * [0.10, 0.09]
    return p + R.apply([0.03, 0.08, 0.23]) + np.column_stack([level, np.zeros(len(t))]), np.zeros(
        (len(t), 3)
    )


def _reaches(
    rng: np.random.Generator,
    t: Array,
    trunk: Callable[[float], tuple[Array, Rotation]],
    near: float,
    far: float,
) -> Array:
    p, R = trunk(0.0)
    at = p + R.apply([0.02, 0.08, 0.2])
    out, begin = np.tile(at, (len(t), 1)), STILL
    while begin < t[-1]:
        (p, R), long, away = trunk(begin), rng.uniform(0.7, 1.4), rng.uniform(near, far)
        side, up = rng.uniform(-0.6, 0.6), rng.uniform(-0.3, 0.5)
        to = p + R.apply(
            [0.02, 0.05, 0.0]
            + away * np.array([np.sin(side) * np.cos(up), np.sin(up), np.cos(side) * np.cos(up)])
        )
        out += (to - at) * minimum_jerk((t - begin) / long)[:, None]
        begin, at = begin + long * rng.uniform(0.85, 1.0) + rng.exponential(0.3), to
    return out


TRUNKS: Mapping[str, Callable[[np.random.Generator, Array], tuple[Array, Array]]] = {
    "reaches": seated,
    "reaches, trunk leans": leaning,
    "reaches, stepping": stepping,
    "to the chest": seated,
    "hand at rest": seated,
    "hand slides": seated,
    "10 s out of reach": leaning,
}
HANDS = {"hand at rest": resting, "hand slides": sliding, "to the chest": touching}
OUT, BACK = 25.0, 35.0  # s between which the hand is out of reach
FAR = 0.45  # m by which it is further away than its reach


def moving(name: str, rng: np.random.Generator, seconds: float = 60.0) -> Motion:
    """A movement of TRUNKS; for the first STILL seconds the hand rests and the trunk breathes."""
    t = np.arange(0.0, seconds, 1 / FINE)
    place, angles = TRUNKS[name](rng, t)
    R_b = UPRIGHT * Rotation.from_euler("XYZ", angles)
    # the arm goes with the body
    carried = place - place[0] if name == "reaches, stepping" else np.zeros_like(place)
    hand, turned = HANDS.get(name, reaching)(
        rng, t, lambda s: ((place - carried)[int(s * FINE)], R_b[int(s * FINE)])
    )
    hand = hand + carried
    if name == "10 s out of reach":
        share = minimum_jerk((t - OUT + 1.0) / 1.0) - minimum_jerk((t - BACK) / 1.0)
        hand = hand + FAR * share[:, None] * np.array([0.3, 0.9, 0.1])
    R_t = PALM_DOWN * Rotation.from_euler("XYZ", turned)
    return Motion(t, (place, hand), (R_b, R_t))
