"""Somebody takes something between thumb and index finger, lifts and holds it, or squeezes it eight times, and lets go: movement, forces, inertial sensors.

Frames  the ground's: z up, heading anyhow. Forces are those that the fingers exert
Units   SI, angles in rad; sampled at 1 kHz
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handscope.validation.independent.simulator import hand as hands
from handscope.validation.independent.simulator.hand import PALM, SEGMENTS, Hand, Values

Rows = NDArray[np.int_]
RATE, GRAVITY = 1000.0, 9.81
INERTIAL = 100.0  # Hz
REACH, BEGUN = 7.0, 0.35  # s: when the pads touch, and how long until they hold
TIMES, PERIOD = 8, 1.2  # squeezes and s of each
# deg: of the initial pose in every freedom, of the sensors on their segments
MISSED, MISALIGNMENT_DEG = 2.5, 6.0


@dataclass(frozen=True, kw_only=True)
class Held:
    """What is held, and what goes wrong with it."""

    mass: float | None = None  # kg, lifted; None: a spring is squeezed
    stiffness: float = 600.0  # N/m
    damping: float = 0.0  # N s/m
    bend: float = 0.0  # share by which the stiffness changes from none to all of the way
    # share of forces that a third finger takes from the index finger and the load
    third: float = 0.0
    slips: bool = False
    support: float = 0.0  # N with which something not measured pushes up while it is lifted


@dataclass(frozen=True)
class Pinch:
    """What was done and what inertial sensors read of it."""

    held: Held
    hand: Hand
    t: Values  # (n,) s
    forces: Values  # (n, 2, 3) N of thumb and index finger
    # of inertial sensors on the last phalanges, thumb and index finger: sensor to ground, (n,) each
    q: list[Rotation]
    rows: Rows  # of t at which inertial sensors tell
    inertial: Values  # (m, sensors, 6) rad/s and m/s^2
    task: tuple[float, float]  # s: onset and end
    stiffness: float  # N/m, of the straight line through force and closing while it is squeezed; NaN of what is lifted


@dataclass(frozen=True)
class Times:
    """Of what is done, s."""

    rises: float
    lasts: float  # of rise and descent
    sinks: float
    ends: float  # the pads let go
    squeezed: float  # from where on
    height: float  # m


def smooth(t: Values, begins: float, lasts: float) -> Values:
    """From 0 to 1 with least jerk."""
    u = np.clip((t - begins) / lasts, 0, 1)
    return np.asarray(u**3 * (10 - 15 * u + 6 * u * u))


def during(t: Values, begins: float, ends: float, lasts: float) -> Values:
    """1 from `begins + lasts` to `ends - lasts`, 0 outside."""
    return smooth(t, begins, lasts) * (1 - smooth(t, ends - lasts, lasts))


def wandering(rng: np.random.Generator, t: Values, low: float, high: float) -> Values:
    """Five sines between these frequencies, about 1 large."""
    waves = [
        np.sin(2 * np.pi * rng.uniform(low, high) * t + rng.uniform(0, 2 * np.pi)) for _ in range(5)
    ]
    return np.asarray(np.sum(waves, axis=0) / np.sqrt(10.0))


def accelerations(places: Values) -> Values:
    """Of places (n, 3)."""
    speeds = np.gradient(places, 1 / RATE, axis=0, edge_order=2)
    return np.asarray(np.gradient(speeds, 1 / RATE, axis=0, edge_order=2))


def pinched(held: Held, side: str, rng: np.random.Generator) -> Pinch:
    """By somebody drawn."""
    hand = hands.draw_hand(rng, side)
    when = _when(held, rng)
    t = np.arange(0, when.ends + 3.0, 1 / RATE)
    distance = _distance(held, when, t, rng)
    phalanges = hand.rotations(_angles(hand, when, t, distance, rng))
    q_hand, place = _carry(side, when, t, rng)
    ends, thumb, index = hand.ends(phalanges)
    pads = [place + q_hand.apply(pad) for pad in (thumb, index)]
    forces = _forces(held, when, t, pads, rng)
    squeezed = (t >= when.squeezed) & (t < when.squeezed + TIMES * PERIOD)
    closed = 0.04 - np.linalg.norm(pads[0] - pads[1], axis=1)[squeezed]
    stiffness = (
        float(np.polyfit(closed, _spring(held, closed), 1)[0]) if held.mass is None else np.nan
    )
    rotations = [q_hand, *(q_hand * phalanx for phalanx in phalanges)]
    places = [
        place + q_hand.apply(hand.sign * np.array([0.0, PALM, 0.0])),
        *(place + q_hand.apply(ends[s]) for s in SEGMENTS[1:]),
    ]
    rows = np.arange(int(RATE / INERTIAL), len(t), int(RATE / INERTIAL))
    inertial, q = _inertial(hand, rotations, places, rows, rng)
    return Pinch(
        held, hand, t, forces, [q[3], q[6]], rows, inertial, (5.9, float(t[-1]) - 0.3), stiffness
    )


def _when(held: Held, rng: np.random.Generator) -> Times:
    rises = REACH + 0.8
    if held.mass is not None:
        return Times(rises, 1.2, rises + 4.2, rises + 6.2, np.inf, rng.uniform(0.2, 0.45))
    squeezed = rises + 1.4
    sinks = squeezed + TIMES * PERIOD + 0.4
    return Times(rises, 1.0, sinks, sinks + 1.8, squeezed, 0.15)


def _distance(held: Held, when: Times, t: Values, rng: np.random.Generator) -> Values:
    """Between the pads while they hold (n,)."""
    if held.mass is not None:
        return np.full(len(t), 0.055)
    depth = _depth(held)
    distance = 0.04 - 0.7 / held.stiffness * during(t, REACH, when.ends, BEGUN)
    for k in range(TIMES):
        share = np.clip((t - when.squeezed - k * PERIOD) / PERIOD, 0, 1)
        distance -= depth * rng.uniform(0.75, 1.25) * 0.5 * (1 - np.cos(2 * np.pi * share))
    return distance


def _spring(held: Held, closed: Values) -> Values:
    """Its force, N, closed by so much."""
    return np.asarray(held.stiffness * closed * (1 + held.bend * (closed / _depth(held) - 0.5)))


def _depth(held: Held) -> float:
    return min(0.011, 9.0 / held.stiffness)


def _angles(
    hand: Hand, when: Times, t: Values, distance: Values, rng: np.random.Generator
) -> Values:
    """Flat at the beginning and the end, missed by a little; opened, closed on the object, opened (n, 9)."""
    opened = np.radians([0, -14, 0, 0, -8, -12, 0, -10, -4.0])
    angles = (
        hand.closing(distance)
        + (1 - during(t, REACH - 0.8, when.ends + 0.8, 0.8))[:, None] * opened
    )
    bent = (smooth(t, 4.3, 1.5) * (1 - smooth(t, t[-1] - 1.6, 1.4)))[:, None]
    return np.asarray(angles * bent + (1 - bent) * np.radians(MISSED) * rng.uniform(-1, 1, 9))


def _carry(side: str, when: Times, t: Values, rng: np.random.Generator) -> tuple[Rotation, Values]:
    """The hand against the ground, and the place of its wrist (n, 3)."""
    off = during(t, when.rises, when.sinks + when.lasts, when.lasts)
    place = np.stack([off * 0.02 * wandering(rng, t, 0.2, 0.7) for _ in range(3)], axis=1)
    place[:, 2] += when.height * off
    sways = (
        np.radians(5.0)
        * off[:, None]
        * np.stack([wandering(rng, t, 0.15, 0.6) for _ in range(3)], axis=1)
    )
    flat = np.array([[0, 1, 0], [0, 0, 1.0], [1, 0, 0]]) * (
        1.0 if side == "left" else np.array([[-1.0, -1.0, 1.0]])
    )
    roll = np.radians(rng.uniform(20, 50)) * (-1 if side == "left" else 1)
    turned = np.outer(roll * smooth(t, 5, 1.0) * (1 - smooth(t, t[-1] - 1.7, 1.0)), [1.0, 0.0, 0.0])
    heading = Rotation.from_rotvec([0, 0, rng.uniform(-np.pi, np.pi)])
    return heading * Rotation.from_rotvec(sways) * Rotation.from_rotvec(
        turned
    ) * Rotation.from_matrix(flat), place


def _forces(
    held: Held, when: Times, t: Values, pads: list[Values], rng: np.random.Generator
) -> Values:
    """That thumb and index finger exert (n, 2, 3): the grip along the line between the pads, and each its share of the load."""
    line = pads[0] - pads[1]
    distance = np.linalg.norm(line, axis=1)
    load = _load(held, when, t, (pads[0] + pads[1]) / 2)
    if held.mass is not None:
        size = 0.7 + rng.uniform(0.7, 1.1) * np.linalg.norm(load, axis=1)
        grip = during(t, REACH, when.ends, BEGUN) * size * (1 + 0.03 * wandering(rng, t, 0.5, 6))
    else:
        closed = 0.04 - distance
        grip = np.maximum(
            _spring(held, closed) - held.damping * np.gradient(distance, 1 / RATE), 0
        ) * (during(t, REACH, when.ends, BEGUN) > 0)
    share = (0.5 + rng.normal(0, 0.06) + 0.02 * wandering(rng, t, 0.1, 1))[:, None]
    push, left = grip[:, None] * line / distance[:, None], 1 - held.third
    return np.stack([left * (1 - share) * load - push, left * (push + share * load)], axis=1)


def _load(held: Held, when: Times, t: Values, middle: Values) -> Values:
    """What carries the object (n, 3); while it stands the table does."""
    accelerated = accelerations(middle)
    if held.slips:
        since = t - when.rises - when.lasts - 1.0
        accelerated[:, 2] += 4.0 * (
            ((since >= 0.075) & (since < 0.15)).astype(float) - ((since > 0) & (since < 0.075))
        )
    carried = during(t, when.rises - 0.45, when.sinks + when.lasts + 0.45, 0.45)[:, None]
    mass = 0.012 if held.mass is None else held.mass
    load = mass * (carried * [0, 0, GRAVITY] + (carried > 0.999) * accelerated)
    return np.asarray(load - carried * [0, 0, held.support])


def _inertial(
    hand: Hand,
    rotations: list[Rotation],
    places: list[Values],
    rows: Rows,
    rng: np.random.Generator,
) -> tuple[Values, list[Rotation]]:
    """Readings (m, sensors, 6) and how each sensor was turned to the ground (n,): misaligned on its segment, gyroscopes tell means between samples."""
    step, read, turned = int(RATE / INERTIAL), [], []
    lengths = [PALM, *(hand.lengths[s] for s in SEGMENTS[1:])]
    for rotation, place, length in zip(rotations, places, lengths):
        axis = rng.normal(size=3)
        q = rotation * Rotation.from_rotvec(
            axis / np.linalg.norm(axis) * np.radians(MISALIGNMENT_DEG)
        )
        at = place + rotation.apply(hand.sign * np.array([0.009, -0.5 * length, 0.0]))
        rates = (q[rows - step].inv() * q[rows]).as_rotvec() * INERTIAL
        specific = q.inv().apply(accelerations(at) + np.array([0.0, 0.0, GRAVITY]))[rows]
        rates = rates * (1 + 0.003 * rng.normal(size=3)) + np.radians(0.3) * rng.normal(size=3)
        specific = specific * (1 + 0.002 * rng.normal(size=3)) + 0.04 * rng.normal(size=3)
        white = np.sqrt(INERTIAL / 2)
        rates += np.radians(0.02) * white * rng.normal(size=rates.shape)
        specific += 2.2e-3 * white * rng.normal(size=specific.shape)
        read.append(np.concatenate([rates, specific], axis=1))
        turned.append(q)
    return np.stack(read, axis=1), turned
