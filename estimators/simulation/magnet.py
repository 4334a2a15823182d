"""Simulated trunk with magnetometers and hand with a magnet: seated movements and sensor readings.

Frames  base b on the breastbone: x up, z forward, y right (Kortier 5.3); target t on the back of
        the hand; global g: z up, y magnetic north
Out     readings of both inertial sensors and of the array, the truth, and the declared setup (with
        the errors of a ruler)
Source  movements: Kortier, thesis 5.2.4, three conditions of 70 s; magnet: neodymium rod 2 mm long,
        7 mm radius; magnetometers HMC5883L; sizes that are not given there are options with their
        source
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from handscope.estimators.data.options import option
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY, MU0_4PI
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.magnetic_field import MagneticField
from handscope.estimators.simulation.sensors import LSM330DLC_HMC5983, SensorErrors

FINE = 16  # instants of the motion for each sample
REST, STARTING = 1.0, 2.0  # s before a movement begins, and until its full amplitude
# q_gb of somebody who sits upright and looks along y
NEUTRAL = quat.from_matrix(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]))
# m, places of the magnetometers: the first at the right shoulder
PLATE = np.array([[0.0, 0.0, 0.0], [0.0, -0.10, 0.0], [-0.12, 0.0, 0.0], [-0.12, -0.10, 0.0]])
# A m^2: remanence of 1.3 T (N42) times the volume
MOMENT = 1.3 / (4e-7 * np.pi) * np.pi * 0.007**2 * 0.002
ROD = MOMENT * np.array([0.0, 0.0, 1.0])
MAGNET_PLACE = np.array([0.005, 0.03, 0.0])  # m from the hand's sensor; ours

ARRAY_ERRORS = LSM330DLC_HMC5983


@dataclass(frozen=True, kw_only=True)
class MagnetErrors:
    """Standard deviations of declared values and of iron on the plate."""

    place: float = option(
        1.0,
        "mm",
        "place of a magnetometer or the magnet in each axis",
        "Kortier 5.2.4: a ruler; size ours",
    )
    moment: float = option(
        0.01, "1", "size of the moment", "remanence within a grade of neodymium; size ours"
    )
    moment_angle: float = option(
        1.0, "deg", "direction of the moment", "Kortier 5.2.4: a ruler; size ours"
    )
    hard_iron: float = option(
        20.0,
        "uT",
        "what magnetised parts add to an uncalibrated magnetometer",
        "BROAD: up to 20 uT before calibration; size ours",
    )
    soft_iron: float = option(
        0.05,
        "1",
        "share by which soft iron and the axes' scales stretch the field",
        "HMC5883L data sheet: 5 %",
    )
    turn: float = option(1.0, "deg", "turn of a magnetometer on the plate", "ours")


@dataclass(frozen=True)
class Motion:
    """Base and target at the instants of the samples, global frame; `w` in their own."""

    t: Array  # (n,) s
    p: Array  # (n, 2, 3) m
    q: Array  # (n, 2, 4) q_gb, q_gt
    w: Array  # (n, 2, 3) rad/s
    a: Array  # (n, 2, 3) m/s^2

    @property
    def p_bt(self) -> Array:
        """(n, 3) the target from the base in the base's frame."""
        return quat.rotate(quat.conjugate(self.q[:, 0]), self.p[:, 1] - self.p[:, 0])

    @property
    def q_bt(self) -> Array:
        return quat.relative(self.q[:, 0], self.q[:, 1])


@dataclass(frozen=True)
class Worn:
    """A plate and a magnet: true and declared."""

    places: Array  # (magnetometers, 3) m
    q_bl: Array  # (magnetometers, 4)
    soft: Array  # (magnetometers, 3, 3)
    hard: Array  # (magnetometers, 3) T
    moment: Array  # (3,) A m^2
    lever: Array  # (3,) m
    declared_places: Array
    declared_moment: Array
    declared_lever: Array
    matrix: Array  # (2 quantities, 2 sensors, 3, 3) of gyroscope and accelerometer
    bias: Array  # (2 sensors, 6)
    errors: SensorErrors


def draw_worn(
    rng: np.random.Generator,
    errors: SensorErrors = ARRAY_ERRORS,
    declaration: MagnetErrors | None = None,
    places: Array = PLATE,
    moment: Array = ROD,
) -> Worn:
    """Draw one plate and one magnet; `moment` is the declared one."""
    e, n = declaration or MagnetErrors(), len(places)
    turn = e.turn * np.pi / 180 * rng.normal(size=(n, 3))
    turn[0] = 0.0  # the first shares the axes of the inertial sensor in its housing
    soft = np.eye(3) + e.soft_iron * rng.normal(size=(n, 3, 3))
    true = places + 1e-3 * e.place * rng.normal(size=places.shape)
    true[0] = places[0]
    true_moment = quat.rotate(
        quat.exp(e.moment_angle * np.pi / 180 * rng.normal(size=3)), moment
    ) * (1 + e.moment * rng.normal())
    lever = MAGNET_PLACE + 1e-3 * e.place * rng.normal(size=3)
    sizes = np.repeat([np.radians(errors.gyr_bias), errors.acc_bias], 3)
    matrices = [
        np.eye(3) + np.diag(scale * rng.normal(size=3))
        for scale in (errors.gyr_scale,) * 2 + (errors.acc_scale,) * 2
    ]
    return Worn(
        true,
        quat.exp(turn),
        (soft + soft.transpose(0, 2, 1)) / 2,
        1e-6 * e.hard_iron * rng.normal(size=(n, 3)),
        true_moment,
        lever,
        places,
        moment,
        MAGNET_PLACE,
        np.array(matrices).reshape(2, 2, 3, 3),
        sizes * rng.normal(size=(2, 6)),
        errors,
    )


def simulate_inertial(w: Worn, m: Motion, rng: np.random.Generator) -> Array:
    """Readings (n, 2, 6) of the sensors on base and target at the instants of the motion."""
    e, rate = w.errors, 1.0 / float(m.t[1] - m.t[0])
    force = quat.rotate(quat.conjugate(m.q), m.a + np.array([0.0, 0.0, GRAVITY]))
    gyr = np.einsum("kij,nkj->nki", w.matrix[0], m.w) + w.bias[:, :3]
    acc = np.einsum("kij,nkj->nki", w.matrix[1], force) + w.bias[:, 3:]
    gyr += np.radians(e.gyr_noise) * np.sqrt(rate / 2) * rng.normal(size=gyr.shape)
    acc += e.acc_noise * GRAVITY * np.sqrt(rate / 2) * rng.normal(size=acc.shape)
    gyr, acc = (
        np.clip(gyr, *(np.radians(e.gyr_range) * np.array([-1, 1]))),
        np.clip(acc, *(e.acc_range * GRAVITY * np.array([-1, 1]))),
    )
    return np.concatenate([gyr, acc], axis=-1)


def simulate_magnetic(
    w: Worn,
    m: Motion,
    room: MagneticField,
    rng: np.random.Generator,
    magnet: bool = True,
    second: MagneticField | None = None,
) -> Array:
    """Raw readings (n, magnetometers, 3) in T of room, magnet (if present) and `second`, through
    iron, limits and noise."""
    q_gb = m.q[:, None, 0]
    places = m.p[:, None, 0] + quat.rotate(q_gb, w.places)
    B = room.at(places)
    if second is not None:
        B = B + second.at(places)
    if magnet:
        r = places - (m.p[:, 1] + quat.rotate(m.q[:, 1], w.lever))[:, None]
        mu = quat.rotate(m.q[:, 1], w.moment)[:, None]
        square = (r * r).sum(axis=-1, keepdims=True)
        B = B + MU0_4PI * (3 * (r * mu).sum(axis=-1, keepdims=True) * r - square * mu) / square**2.5
    own = quat.rotate(quat.conjugate(quat.multiply(q_gb, w.q_bl)), B)
    raw = (
        np.einsum("lij,nlj->nli", w.soft, own)
        + w.hard
        + 1e-6 * w.errors.mag_noise * rng.normal(size=own.shape)
    )
    limit = 1e-6 * w.errors.mag_range
    return np.asarray(np.clip(raw, -limit, limit))


def rotate_plate(
    rng: np.random.Generator, seconds: float = 60.0, rate: float = 60.0, spot: Array | None = None
) -> Motion:
    """The plate rotated by hand in all directions within some centimetres, for calibration; the
    magnet is away."""
    swing = _swings(rng, 3, 0.05, 0.15)
    where = np.zeros(3) if spot is None else spot

    def orientation(t: Array) -> Array:
        return quat.multiply(
            quat.about(2, 2 * np.pi * 0.11 * t),
            quat.multiply(quat.about(0, 2 * np.pi * 0.07 * t), quat.about(1, 2.0 * swing(t)[:, 0])),
        )

    def place(t: Array) -> Array:
        return where + 0.03 * swing(t)

    return _sample_motion(
        seconds,
        rate,
        place,
        orientation,
        lambda t: np.tile([0.0, 0.0, 5.0], (len(t), 1)),
        lambda t: np.tile(quat.IDENTITY, (len(t), 1)),
    )


def simulate_condition(
    name: str,
    rng: np.random.Generator,
    seconds: float = 70.0,
    rate: float = 60.0,
    spot: Array | None = None,
) -> Motion:
    """A movement of CONDITIONS: rest, then full amplitude. Amplitudes and pace are drawn."""
    return CONDITIONS[name](rng, seconds, rate, np.zeros(3) if spot is None else spot)


def _hand_moves(rng: np.random.Generator, seconds: float, rate: float, spot: Array) -> Motion:
    """Reach as far as possible and return; the trunk only breathes."""
    return _simulate_seated(rng, seconds, rate, spot, trunk=2.0, near=0.13, far=0.42, wrist=35.0)


def _trunk_moves(rng: np.random.Generator, seconds: float, rate: float, spot: Array) -> Motion:
    """Rotation about the long axis, the hand held in place against the trunk as well as possible."""
    return _simulate_seated(rng, seconds, rate, spot, trunk=40.0, near=0.20, far=0.22, wrist=3.0)


def _both_move(rng: np.random.Generator, seconds: float, rate: float, spot: Array) -> Motion:
    """Pick and place: trunk and hand rotate and move at once."""
    return _simulate_seated(rng, seconds, rate, spot, trunk=25.0, near=0.12, far=0.30, wrist=40.0)


CONDITIONS: Mapping[str, Callable[[np.random.Generator, float, float, Array], Motion]] = {
    "hand": _hand_moves,
    "trunk": _trunk_moves,
    "both": _both_move,
}


def move_hand_away(m: Motion, begin: float, end: float, by: float = 0.6) -> Motion:
    """The same with the hand `by` m further forward from `begin` to `end` s: out of the
    magnetometers' reach."""
    t = m.t
    share = np.clip(np.minimum(t - begin, end - t) + 0.5, 0.0, 1.0)
    smooth = share**3 * (10 - 15 * share + 6 * share**2)
    shift = quat.rotate(m.q[:, 0], by * smooth[:, None] * np.array([-0.3, 0.3, 1.0]))
    p = m.p.copy()
    p[:, 1] += shift
    a = m.a.copy()
    a[:, 1] += make_interp_spline(t, shift, k=5).derivative(2)(t)
    return Motion(t, p, m.q, m.w, a)


def _simulate_seated(
    rng: np.random.Generator,
    seconds: float,
    rate: float,
    spot: Array,
    trunk: float,
    near: float,
    far: float,
    wrist: float,
) -> Motion:
    """Trunk rotated by `trunk` deg mostly about its long axis, hand between `near` and `far` m of
    the plate, rotated by `wrist` deg against the trunk."""
    reach, side, turn, lean = (
        _swings(rng, 1, 0.2, 0.4),
        _swings(rng, 2, 0.1, 0.3),
        _swings(rng, 3, 0.15, 0.4),
        _swings(rng, 3, 0.15, 0.35),
    )
    held = quat.exp(np.array([0.0, -0.5 * np.pi, 0.0]) + 0.2 * rng.normal(size=3))
    middle = PLATE.mean(axis=0)

    def trunk_turn(t: Array) -> Array:
        return quat.multiply(
            NEUTRAL, quat.exp(np.radians(trunk) * lean(t) * np.array([1.0, 0.25, 0.25]))
        )

    def trunk_place(t: Array) -> Array:
        return np.asarray(spot + trunk / 40.0 * 0.05 * lean(t))

    def hand_place(t: Array) -> Array:
        azimuth, elevation = (
            np.radians(c) for c in (35.0 * side(t)[:, 0], -20.0 + 20.0 * side(t)[:, 1])
        )
        distance = near + (far - near) * 0.5 * (1 - reach(t)[:, 0])
        toward = np.column_stack(
            [
                np.sin(elevation),
                np.cos(elevation) * np.sin(azimuth),
                np.cos(elevation) * np.cos(azimuth),
            ]
        )
        return np.asarray(middle + distance[:, None] * toward)

    def hand_turn(t: Array) -> Array:
        return quat.multiply(held, quat.exp(np.radians(wrist) * turn(t)))

    return _sample_motion(seconds, rate, trunk_place, trunk_turn, hand_place, hand_turn)


def _swings(rng: np.random.Generator, n: int, slow: float, fast: float) -> Callable[[Array], Array]:
    """n smooth coordinates (len(t), n) within +-1: two oscillations each, of `slow` to `fast` Hz,
    that begin from rest."""
    pace, phase, share = (
        rng.uniform(slow, fast, (2, n)),
        rng.uniform(0, 2 * np.pi, (2, n)),
        rng.uniform(0.6, 0.8, n),
    )

    def swing(t: Array) -> Array:
        u = np.clip((t - REST) / STARTING, 0.0, 1.0)
        # its slope is a smooth step
        own = STARTING * (u**6 - 3 * u**5 + 2.5 * u**4) + np.maximum(t - REST - STARTING, 0.0)
        a, b = (np.sin(2 * np.pi * np.outer(own, pace[k]) + phase[k]) for k in range(2))
        return np.asarray(share * a + (1 - share) * b)

    return swing


def _sample_motion(
    seconds: float,
    rate: float,
    base_place: Callable[[Array], Array],
    base_turn: Callable[[Array], Array],
    hand_place: Callable[[Array], Array],
    hand_turn: Callable[[Array], Array],
) -> Motion:
    """Position and orientation of base, and of the hand against it, as functions of time, with
    their derivatives at the samples."""
    n = round(seconds * rate)
    fine = np.arange(-4 * FINE, (n + 3) * FINE + 1) / (rate * FINE)
    clipped = np.maximum(fine, 0.0)
    q_gb, p_b = base_turn(clipped), base_place(clipped)
    p_t, q_gt = (
        p_b + quat.rotate(q_gb, hand_place(clipped)),
        quat.multiply(q_gb, hand_turn(clipped)),
    )
    at = 4 * FINE + FINE * np.arange(n)
    step = fine[1] - fine[0]
    w = np.stack(
        [quat.log(quat.relative(q[at - 1], q[at + 1])) / (2 * step) for q in (q_gb, q_gt)], axis=1
    )
    a = np.stack(
        [make_interp_spline(fine, p, k=5).derivative(2)(fine[at]) for p in (p_b, p_t)], axis=1
    )
    p, q = np.stack([p_b[at], p_t[at]], axis=1), np.stack([q_gb[at], q_gt[at]], axis=1)
    return Motion(np.arange(n) / rate, p, q, w, a)
