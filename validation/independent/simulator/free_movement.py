"""A hand simulated by closed formulas, its sensors' readings by differences of rotations and places: it shares no line with estimators/.

Self-calibration is judged by it (`handscope reproduce independent`): a mistake that estimators/ and their own simulator had in common shows here.

Out     a Motion-BIDS folder, as anybody's glove might write it, and what is true
Frames  docs/conventions.md: segments z-x'-y'' on each other, origins at distal joints; vectors of a right hand have all signs changed
Limits  no field, no gaps, no knocks; joints are exact; a sensor gives what its scale, bias and white noise leave
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handscope.validation.independent.simulator.motion_files import axes, write_system

Array = NDArray[np.float64]
Wave = Callable[[Array], Array]  # of the time (n,) s, about 1 in size

DEG = np.pi / 180
RIGHT_ANGLE = np.pi / 2
GRAVITY = 9.81  # m/s^2
CHAINS = {"thumb": ("thumb_metacarpal", "thumb_proximal", "thumb_distal")} | {
    f: (f"{f}_proximal", f"{f}_middle", f"{f}_distal")
    for f in ("index", "middle", "ring", "little")
}
JOINTS = {"thumb": ("thumb_cmc", "thumb_mcp", "thumb_ip")} | {
    f: (f"{f}_mcp", f"{f}_pip", f"{f}_dip") for f in ("index", "middle", "ring", "little")
}
USUAL = {  # m, of the segments of a finger
    "thumb": (0.046, 0.032, 0.024),
    "index": (0.042, 0.025, 0.018),
    "middle": (0.046, 0.029, 0.019),
    "ring": (0.043, 0.028, 0.019),
    "little": (0.034, 0.020, 0.017),
}
ROOTS = {  # dorsal m, distal in palms, ulnar m, from the wrist
    "thumb": (-0.004, 0.23, -0.024),
    "index": (0.0, 1.0, -0.022),
    "middle": (0.0, 1.0, 0.0),
    "ring": (0.0, 0.93, 0.019),
    "little": (0.0, 0.84, 0.036),
}
PALM = 0.088  # m, wrist to MCP 3
MISALIGNMENT = 5.0 * DEG  # about each axis, a sensor's seat from its nominal mounting
TURN, SLIDE = 2.0 * DEG, 1e-3  # rad, m: what skin does to a sensor in 90 deg of its joint
SHARED = 0.4  # of that under the hand's sensor for each finger, where several move
GYR_BIAS, ACC_BIAS = 0.8 * DEG, 0.12  # rad/s, m/s^2, standard deviations of an axis
GYR_NOISE, ACC_NOISE = 0.007 * DEG, 150e-6 * GRAVITY  # white, a square root of a Hz
SCALE = 0.003  # of scales and of what axes see of each other
# Hz, s: the forearm's strip has a rate and instants of its own
FOREARM_RATE, FOREARM_LATE = 100.0, 0.0037
SHORT = 1.5e-3  # s between the instants of which differences are taken
# central differences of the sixth order
FIRST = np.array([-1, 9, -45, 0, 45, -9, 1]) / (60 * SHORT)
SECOND = np.array([2, -27, 270, -490, 270, -27, 2]) / (180 * SHORT**2)
TRAILS = 0.04  # s by which skin follows
# rad of bending by which skin is behind, rad/s at which it is so almost wholly
LAG, LAG_RATE = 9.0 * DEG, 60.0 * DEG
POSED, BEGUN = 4.0, 6.0  # s, until when an initial pose is held, from when the movement is free
LATEST = 4e-3  # s, the largest scatter of a stamp


@dataclass(frozen=True)
class Setup:
    """Who does what with which sensors; a person and his movement depend on the seed alone."""

    seed: int
    hand: str = "left"
    fingers: tuple[str, ...] = ("index",)
    forearm: bool = False
    rate: float = 100.0  # Hz
    duration: float = 40.0  # s
    pace: float = 1.3  # Hz, the fastest of what each angle is made of
    skin: float = 1.0  # of TURN and SLIDE
    misaligned: float = 1.0  # of MISALIGNMENT
    biased: float = 1.0  # of GYR_BIAS
    law: str = "proportion"  # of LAWS
    means: bool = False  # a rate is the mean since the sample before, not that of its instant
    scatter: float = 0.0  # s, standard deviation of a sample's stamp
    # rad, standard deviation of what every freedom misses an initial pose by; None: no pose
    missed: float | None = None
    # rad, by joint: flexion that the initial pose has beside, as of a finger that cannot be straightened
    bent: Mapping[str, float] = field(default_factory=dict)

    @property
    def side(self) -> float:
        return 1.0 if self.hand == "left" else -1.0

    @property
    def segments(self) -> tuple[str, ...]:
        return (
            "hand",
            *(s for f in self.fingers for s in CHAINS[f]),
            *(("forearm",) if self.forearm else ()),
        )


@dataclass(frozen=True)
class Body:
    """A person and a glove. Everything by segment, in its frame, but for roots and back: by finger, in the hand's."""

    palm: float  # m
    lengths: Mapping[str, float]  # m
    roots: Mapping[str, Array]  # (3,) m, from the wrist
    nominal: Mapping[str, Rotation]  # how a sensor is said to sit
    mountings: Mapping[str, Rotation]  # how it sits where its joint is straight
    places: Mapping[str, Array]  # (3,) m
    turned: Mapping[str, Array]  # (3,) rad a rad, by skin
    slid: Mapping[str, Array]  # (3,) m a rad
    back: Mapping[str, tuple[Array, Array]]  # the same under the hand's sensor


@dataclass(frozen=True)
class Movement:
    """Joint angles and wrist over time, rad."""

    angles: Mapping[str, Callable[[Array], Array]]  # by finger: (n, 3 joints, 3 angles) rad
    wrist: Callable[[Array], Array]  # (n, 3) rad
    turns: Callable[[Array], Array]  # (n, 3, 3), of the forearm, or of the hand that has none
    wanders: Callable[[Array], Array]  # (n, 3) m, of the wrist


@dataclass(frozen=True)
class Sensors:
    """Errors by segment."""

    gyr_bias: Mapping[str, Array]  # (3,) rad/s
    acc_bias: Mapping[str, Array]  # (3,) m/s^2
    gyr_scale: Mapping[str, Array]  # (3, 3)
    acc_scale: Mapping[str, Array]  # (3, 3)


@dataclass(frozen=True)
class _Posture:
    """Where the segments are."""

    t: Array  # (n,) s
    segments: Mapping[str, tuple[Array, Array]]  # orientation (n, 3, 3), origin (n, 3) m


@dataclass(frozen=True)
class Truth:
    """What is true of a simulated movement: angles (rad), tips (m)."""

    body: Body
    sensors: Sensors
    t: Array  # (n,) s
    angles: Mapping[str, Array]  # (n, 3) rad, by joint
    tips: Mapping[str, Array]  # (n, 3) m, ends of the last bones in the wrist's frame


@dataclass(frozen=True)
class Held:
    """A contact, from when to when, and the words of its event."""

    words: str
    onset: float  # s
    end: float


def written(
    setup: Setup, folder: Path, movement: Movement | None = None, held: Sequence[Held] = ()
) -> Truth:
    """A recording in Motion-BIDS, and what is true of it; of the set-up's free movement where no other is given."""
    body, sensors, movement = _body(setup), _sensors(setup), movement or _movement(setup)
    noise, t = _rng(setup, 4), np.arange(round(setup.duration * setup.rate)) / setup.rate
    at = folder / "sub-01" / "motion"
    at.mkdir(parents=True)
    (folder / "dataset_description.json").write_text(
        json.dumps({"Name": "simulated by formulas of its own", "BIDSVersion": "1.9.0"})
    )
    (at / "sub-01_task-free_events.tsv").write_text(
        "onset\tduration\ttrial_type\tcontacts\n"
        + (
            f"0\t{setup.duration}\tfree_movement\tn/a\n"
            if setup.missed is None
            else f"0.5\t{POSED - 1}\tinitial_pose\tn/a\n"
        )
        + "".join(f"{h.onset}\t{h.end - h.onset}\tcontact\t{h.words}\n" for h in held)
    )
    strips = [("imu", setup.rate, t, tuple(s for s in setup.segments if s != "forearm"))]
    if setup.forearm:
        strips.append(
            (
                "forearm",
                FOREARM_RATE,
                np.arange(round(setup.duration * FOREARM_RATE)) / FOREARM_RATE + FOREARM_LATE,
                ("forearm",),
            )
        )
    for name, rate, instants, segments in strips:
        around = _around(setup, body, movement, instants)
        read = {
            s: _spoilt(noise, sensors, s, rate, *_readings(setup, body, movement, s, around, rate))
            for s in segments
        }
        stamps = instants + np.clip(
            setup.scatter * noise.standard_normal(len(instants)), -LATEST, LATEST
        )
        _write_strip(f"{at}/sub-01_task-free", name, setup, body, rate, stamps, read)
    return Truth(body, sensors, t, *_true_values(setup, body, movement, t))


def _rng(setup: Setup, purpose: int) -> np.random.Generator:
    """Each purpose draws for itself: the same person moves alike at another rate or with other skin."""
    return np.random.default_rng([setup.seed, purpose, 2718])


def _somewhere(rng: np.random.Generator) -> Array:
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))


def _body(setup: Setup) -> Body:
    rng = _rng(setup, 1)
    size = rng.uniform(0.88, 1.12)
    palm = PALM * size * rng.uniform(0.97, 1.03)
    lengths = {
        s: m * size * rng.uniform(0.94, 1.06) for f in CHAINS for s, m in zip(CHAINS[f], USUAL[f])
    }
    roots = {f: setup.side * np.array([x, y * palm, z * size]) for f, (x, y, z) in ROOTS.items()}
    nominal, mountings, places, turned, slid = {}, {}, {}, {}, {}
    for s in ("hand", "forearm", *lengths):
        nominal[s] = Rotation.from_quat(rng.standard_normal(4))
        mountings[s] = (
            Rotation.from_rotvec(setup.misaligned * MISALIGNMENT * rng.standard_normal(3))
            * nominal[s]
        )
        places[s] = setup.side * _on_top(rng, s, lengths.get(s, 0.0))
        turned[s], slid[s] = (
            amount * setup.skin / RIGHT_ANGLE * _somewhere(rng) for amount in (TURN, SLIDE)
        )
    share = setup.skin / RIGHT_ANGLE * (1.0 if len(setup.fingers) == 1 else SHARED)
    back = {
        f: (share * TURN * _somewhere(rng), share * SLIDE * _somewhere(rng))
        for f in CHAINS
        if f != "thumb"
    }
    return Body(palm, lengths, roots, nominal, mountings, places, turned, slid, back)


def _on_top(rng: np.random.Generator, segment: str, length: float) -> Array:
    """Where a sensor lies on a segment of the left hand: dorsal, distal, ulnar, m."""
    if segment == "hand":
        return np.array(
            [rng.uniform(0.010, 0.014), -rng.uniform(0.03, 0.05), rng.uniform(-0.01, 0.01)]
        )
    if segment == "forearm":
        return np.array([0.02, -rng.uniform(0.05, 0.07), rng.uniform(-0.005, 0.005)])
    return np.array(
        [
            rng.uniform(0.009, 0.012),
            -length * rng.uniform(0.4, 0.65),
            1.2e-3 * rng.standard_normal(),
        ]
    )


def _sensors(setup: Setup) -> Sensors:
    rng = _rng(setup, 3)
    segments = ("hand", "forearm", *(s for f in CHAINS for s in CHAINS[f]))
    drawn = [
        (rng.standard_normal(3), rng.standard_normal(3), rng.standard_normal((2, 3, 3)))
        for _ in segments
    ]
    return Sensors(
        {s: setup.biased * GYR_BIAS * g for s, (g, _, _) in zip(segments, drawn)},
        {s: ACC_BIAS * a for s, (_, a, _) in zip(segments, drawn)},
        {s: np.eye(3) + SCALE * m[0] for s, (_, _, m) in zip(segments, drawn)},
        {s: np.eye(3) + SCALE * m[1] for s, (_, _, m) in zip(segments, drawn)},
    )


def _movement(setup: Setup) -> Movement:
    return free(setup) if setup.missed is None else after_pose(setup, setup.missed, free(setup))


def free(setup: Setup) -> Movement:
    """Every angle by sines of its own."""
    rng = _rng(setup, 2)
    turns, wanders, wrist = ([_wave(rng, setup.pace) for _ in range(k)] for k in (3, 3, 2))
    waves = {f: [_wave(rng, setup.pace) for _ in range(4)] for f in CHAINS}

    def turned(t: Array) -> Array:
        z, y, x = (reach * DEG * np.sin(wave(t)) for reach, wave in zip((55.0, 35.0, 55.0), turns))
        return _about(2, z) @ _about(1, y) @ _about(0, x)

    return Movement(
        {
            f: (lambda t, w=w, f=f: _thumb(w, t) if f == "thumb" else _finger(w, t))  # type: ignore[misc]
            for f, w in waves.items()
        },
        lambda t: (
            DEG
            * np.stack([38 * np.sin(1.2 * wrist[0](t)), 14 * np.sin(wrist[1](t)), 0 * t], axis=1)
        ),
        turned,
        lambda t: 0.09 * np.stack([np.sin(wave(t)) for wave in wanders], axis=1),
    )


def after_pose(setup: Setup, missed: float, free: Movement) -> Movement:
    """The movement that begins from a flat hand, palm down, held as exactly as somebody does."""
    rng, freedoms = _rng(setup, 5), {"thumb": np.array([[1, 1, 1], [1, 0, 0], [1, 0, 0]])}
    other = np.array([[1, 1, 0], [1, 0, 0], [1, 0, 0]])
    held = {f: missed * rng.normal(size=(3, 3)) * freedoms.get(f, other) for f in CHAINS}
    for f, joints in JOINTS.items():
        held[f][:, 0] += [setup.bent.get(j, 0.0) for j in joints]
    wrist = missed * rng.normal(size=3) * [1, 1, 0]
    palm_down = np.column_stack([(0, 0, setup.side), (0, setup.side, 0), (-1, 0, 0)])

    def share(t: Array) -> Array:
        x = np.clip((t - POSED) / (BEGUN - POSED), 0.0, 1.0)[:, None]
        return np.asarray(x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3))

    def turned(t: Array) -> Array:
        away = Rotation.from_matrix(free.turns(t)).as_rotvec()
        return np.asarray(Rotation.from_rotvec(share(t) * away).as_matrix() @ palm_down)

    def angles(t: Array, f: str) -> Array:
        s = share(t)[..., None]
        return np.asarray(s * free.angles[f](t) + (1 - s) * held[f])

    return Movement(
        {f: (lambda t, f=f: angles(t, f)) for f in CHAINS},  # type: ignore[misc]
        lambda t: share(t) * free.wrist(t) + (1 - share(t)) * wrist,
        turned,
        lambda t: share(t) * free.wanders(t),
    )


def _wave(rng: np.random.Generator, fastest: float) -> Wave:
    """Nine sines of random frequency (Hz), phase and size; 1 RMS."""
    f, phase, size = (
        rng.uniform(0.08 * fastest, fastest, 9),
        rng.uniform(0, 2 * np.pi, 9),
        rng.uniform(0.5, 1, 9),
    )
    size = size / np.sqrt((size**2).sum() / 2)
    return lambda t: np.sin(2 * np.pi * f * t[:, None] + phase) @ size


def _finger(waves: list[Wave], t: Array) -> Array:
    a, b, c, d = (wave(t) for wave in waves)
    mcp = np.stack([35 + 43 * np.sin(1.2 * a), 9 * np.sin(d), 0 * t], axis=1)
    pip, dip = 48 + 45 * np.sin(1.2 * b), 32 + 28 * np.sin(0.9 * b + 0.8 * c)
    return DEG * np.stack([mcp, *(np.stack([x, 0 * t, 0 * t], axis=1) for x in (pip, dip))], axis=1)


def _thumb(waves: list[Wave], t: Array) -> Array:
    a, b, c, d = (wave(t) for wave in waves)
    cmc = np.stack(
        [5 + 18 * np.sin(1.2 * a), -15 + 12 * np.sin(1.2 * b), 5 + 8 * np.sin(d)], axis=1
    )
    mcp, ip = 28 + 27 * np.sin(1.2 * c), 35 + 33 * np.sin(1.2 * (0.8 * a + 0.5 * c))
    return DEG * np.stack([cmc, *(np.stack([x, 0 * t, 0 * t], axis=1) for x in (mcp, ip))], axis=1)


def _about(axis: int, angle: Array) -> Array:
    """Rotations (n, 3, 3)."""
    return Rotation.from_rotvec(angle[:, None] * np.eye(3)[axis]).as_matrix()


def _joint_rotations(angles: Array) -> Array:
    """Rotations (n, 3, 3) of a child on its parent, z-x'-y''."""
    return _about(2, angles[:, 0]) @ _about(0, angles[:, 1]) @ _about(1, angles[:, 2])


def _rigid_motion(R: Array, v: Array) -> Array:
    """Vectors (n, 3) of one (3,) or of as many."""
    return np.asarray(np.einsum("nij,nj->ni", R, np.broadcast_to(v, (len(R), 3))))


def _segment_poses(
    setup: Setup, body: Body, movement: Movement, t: Array
) -> Iterator[tuple[str, Array, Array]]:
    """Every segment with its orientation (n, 3, 3) and its origin (n, 3) m in the world."""
    R, wrist = movement.turns(t), movement.wanders(t)
    yield "forearm", R, wrist
    if setup.forearm:
        R = R @ _joint_rotations(movement.wrist(t))
    yield "hand", R, wrist + _rigid_motion(R, body.roots["middle"])
    for finger in setup.fingers:
        on, end = R, wrist + _rigid_motion(R, body.roots[finger])
        for s, angles in zip(CHAINS[finger], np.moveaxis(movement.angles[finger](t), 1, 0)):
            on = on @ _joint_rotations(angles)
            end = end + _rigid_motion(on, setup.side * np.array([0.0, body.lengths[s], 0.0]))
            yield s, on, end


def _true_values(
    setup: Setup, body: Body, movement: Movement, t: Array
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Angles by joint; tips by finger in the wrist's frame, the hand's where there is no forearm."""
    angles = {
        j: movement.angles[f](t)[:, k] for f in setup.fingers for k, j in enumerate(JOINTS[f])
    }
    if setup.forearm:
        angles["wrist"] = movement.wrist(t)
    at = {s: (R, p) for s, R, p in _segment_poses(setup, body, movement, t)}
    R, wrist = at["forearm"]
    return angles, {
        f: np.einsum("nji,nj->ni", R, at[CHAINS[f][-1]][1] - wrist) for f in setup.fingers
    }


def _proportion(bent: Callable[[Array], Array], t: Array) -> Array:
    return bent(t)


def _growing(bent: Callable[[Array], Array], t: Array) -> Array:
    """More than in proportion: 0.6 of the angle and 0.6 of its square over 90 deg."""
    angle = bent(t)
    return np.asarray(angle * (0.6 + 0.6 * angle / RIGHT_ANGLE))


def _levelling(bent: Callable[[Array], Array], t: Array) -> Array:
    """The angle's sine."""
    return np.sin(bent(t))


def _lagging(bent: Callable[[Array], Array], t: Array) -> Array:
    """Ahead or behind by 9 deg, as the joint bends or straightens."""
    rate = (bent(t + 1e-3) - bent(t - 1e-3)) / 2e-3
    return np.asarray(bent(t) + LAG * np.tanh(rate / LAG_RATE))


def _trailing(bent: Callable[[Array], Array], t: Array) -> Array:
    """Behind by a time, not by an angle."""
    return bent(t - TRAILS)


LAWS = {
    "proportion": _proportion,
    "growing": _growing,
    "levelling": _levelling,
    "lagging": _lagging,
    "trailing": _trailing,
}  # rad of bending that skin follows


def _skin_displacement(
    setup: Setup, body: Body, movement: Movement, segment: str, t: Array
) -> tuple[Array, Array]:
    """How skin has turned (n, 3) rad and slid (n, 3) m the sensor on a segment."""

    def bending(finger: str, joint: int) -> Array:
        return LAWS[setup.law](lambda t: movement.angles[finger](t)[:, joint, 0], t)[:, None]

    if segment == "hand":
        by = [(bending(f, 0), *body.back[f]) for f in setup.fingers if f in body.back]
        still = np.zeros((len(t), 3))
        return sum((b * turn for b, turn, _ in by), still), sum(
            (b * slide for b, _, slide in by), still
        )
    if segment == "forearm":
        return np.zeros((len(t), 3)), np.zeros((len(t), 3))
    finger = segment.partition("_")[0]
    bent = bending(finger, CHAINS[finger].index(segment))
    return bent * body.turned[segment], bent * body.slid[segment]


def _around(setup: Setup, body: Body, movement: Movement, t: Array) -> list[_Posture]:
    """The segments at instants and shortly before and after them, of which differences are taken."""
    return [_posture(setup, body, movement, t + k * SHORT) for k in range(-3, 4)]


def _posture(setup: Setup, body: Body, movement: Movement, t: Array) -> _Posture:
    return _Posture(t, {s: (R, p) for s, R, p in _segment_poses(setup, body, movement, t)})


def _worn(
    setup: Setup, body: Body, movement: Movement, segment: str, posture: _Posture
) -> tuple[Array, Array]:
    """Orientation (n, 3, 3) and place (n, 3) m of a sensor in the world."""
    t, (R, p) = posture.t, posture.segments[segment]
    turn, slide = _skin_displacement(setup, body, movement, segment, t)
    return R @ body.mountings[segment].as_matrix() @ Rotation.from_rotvec(
        turn
    ).as_matrix(), p + _rigid_motion(R, body.places[segment] + slide)


def _readings(
    setup: Setup,
    body: Body,
    movement: Movement,
    segment: str,
    around: list[_Posture],
    rate: float,
) -> tuple[Array, Array]:
    """Rates (n, 3) rad/s and specific forces (n, 3) m/s^2 of a sensor without errors, at `rate` Hz."""
    worn = [_worn(setup, body, movement, segment, posture) for posture in around]
    R = worn[3][0]
    spin = np.swapaxes(R, 1, 2) @ sum(w * R for w, (R, _) in zip(FIRST, worn))
    felt = sum(w * p for w, (_, p) in zip(SECOND, worn)) + np.array([0.0, 0.0, GRAVITY])
    gyr = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    if setup.means:
        gyr[1:] = rate * Rotation.from_matrix(np.swapaxes(R[:-1], 1, 2) @ R[1:]).as_rotvec()
    return gyr, np.einsum("nji,nj->ni", R, felt)


def _spoilt(
    rng: np.random.Generator, sensors: Sensors, segment: str, rate: float, gyr: Array, acc: Array
) -> tuple[Array, Array]:
    """The readings as the sensor gives them."""
    white = np.sqrt(rate / 2)
    return (
        gyr @ sensors.gyr_scale[segment].T
        + sensors.gyr_bias[segment]
        + GYR_NOISE * white * rng.standard_normal(gyr.shape),
        acc @ sensors.acc_scale[segment].T
        + sensors.acc_bias[segment]
        + ACC_NOISE * white * rng.standard_normal(acc.shape),
    )


def _write_strip(
    stem: str,
    name: str,
    setup: Setup,
    body: Body,
    rate: float,
    stamps: Array,
    read: Mapping[str, tuple[Array, Array]],
) -> None:
    """Samples, channels and sidecar of one tracking system."""
    channels = [
        channel
        for s in read
        for channel in (*axes(s, "gyr", "GYRO", "rad/s"), *axes(s, "acc", "ACCEL", "m/s^2"))
    ]
    sidecar = {
        "TaskName": "free",
        "SamplingFrequency": rate,
        "MeasuredHand": setup.hand,
        "HandGeometry": {
            "palm_length": body.palm,
            "joint_positions": {JOINTS[f][0]: p.tolist() for f, p in body.roots.items()},
        },
        "SensorMounting": {s: body.nominal[s].as_quat(scalar_first=True).tolist() for s in read},
    }
    write_system(
        stem,
        name,
        stamps,
        np.concatenate([x for pair in read.values() for x in pair], axis=1),
        channels,
        sidecar,
    )
