"""The order of a finger's sensors, by how the finger bends: PIP and DIP bend forward together, so that segments are turned the more the farther out they are.

In      the hand as its sensors alone have it, from an initial pose on (free_joints.move_freely)
Out     suspicions: sensors in whose declared order a joint stays bent backward while the finger is bent, and in whose other order none is
Source  an unloaded DIP bends with its PIP: Landsmeer 1963, J Bone Joint Surg 45A:1654; error of an angle: a pose held within POSE_SD, skin that turns a sensor by SKIN
Limits  fingers that stay straight tell nothing; a swan-neck finger, or a tip that is pressed backward all the time, looks the same and is asked. Thumbs are left out:
        their IP goes backward
"""

import itertools

import numpy as np

from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, FLEXION, JOINTS, SEGMENT
from handscope.estimators.numerics.tail_probabilities import normal_sf
from handscope.estimators.numerics.typing import Array

UNSURE = Flag.MISSING | Flag.SATURATED | Flag.HEADING_LOST
BENT = np.radians(12.0)  # of PIP or DIP, either way: from here on a finger is bent
# of PIP and DIP together in the other order: a straight finger has none, whatever a heading's drift seems to bend
CLEAR = 2 * BENT
POSE_SD = np.radians(2.5)  # of a joint in the pose
SKIN = 4.0 / 90.0  # turn of a sensor per turn of its joint
FALSE_ALARM = 1e-3  # of all fingers of one recording
EVERY, FEWEST = 0.1, 10  # s, and samples that far apart in which a finger is bent


def check_order(free: Trajectory, angles: Array) -> list[Suspicion]:
    """Sensors of fingers that are probably in another order than declared.

    Parameters
    ----------
    free : Trajectory
        Without constraints; angles are those from the initial pose on.
    angles : Array
        (n, joints, 3) rad, of its joints.

    Returns
    -------
    list of Suspicion
        `sensors.exchanged_bending`, with the exchange where two sensors change places.
    """
    return [s for f in FINGERS[1:] if (s := _order(free, angles, f)) is not None]


def _order(free: Trajectory, angles: Array, finger: str) -> Suspicion | None:
    """The other order of a finger's sensors, where the declared one bends a joint backward and that one none."""
    turned, t, sensors = _turned(free, angles, finger)
    if len(t) < FEWEST or len(sensors) < 2:
        return None
    k, z = _backward(turned)
    orders = [list(o) for o in itertools.permutations(range(len(sensors)))][1:]
    fits = [o for o in orders if _backward(turned[:, o])[1] < 1.0 and _bent(turned[:, o]) > CLEAR]
    p = min(1.0, float(normal_sf(z)) * 2 * len(FINGERS[1:]))
    if p >= FALSE_ALARM or not fits:
        return None
    order = min(fits, key=lambda o: _backward(turned[:, o])[1])
    moved = tuple(s for s, o in zip(sensors, order) if sensors[o] != s)
    joint = next(j.name for j in JOINTS if j.child == sensors[k + 1])
    values: dict[str, float | str] = {
        "sensors": ", ".join(moved),
        "joint": joint,
        "backward_deg": float(np.degrees(-np.median(turned[:, k + 1] - turned[:, k]))),
        "odds": float(np.floor(min(1.0 / p, 1e6))),
    }
    span = (float(t[0]), float(t[-1]))
    correction = {"exchange": moved} if len(moved) == 2 and len(fits) == 1 else None
    message = Message("sensors.exchanged_bending", values, "warning")
    return Suspicion(message, moved, (span,), p, correction)


def _turned(free: Trajectory, angles: Array, finger: str) -> tuple[Array, Array, tuple[str, ...]]:
    """How far (n, S) rad segments with a sensor are bent against the hand while the finger is bent, when (n,) s, and the segments."""
    joints = [k for k, j in enumerate(JOINTS) if j.child in CHAINS[finger]]
    step = max(1, int(EVERY * (len(free) - 1) / max(float(free.t[-1] - free.t[0]), EVERY)))
    flags, bending = free.flags[::step], angles[::step, joints, FLEXION]
    worn = [
        s
        for k, s in enumerate(CHAINS[finger])
        if np.isfinite(bending[:, : k + 1]).all(axis=1).any()
    ]
    turned = np.cumsum(bending, axis=1)[:, : len(worn)]
    known = np.isfinite(turned).all(axis=1)
    known &= ((flags[:, [SEGMENT[s] for s in worn]] & UNSURE) == 0).all(axis=1)
    bent = known & (np.abs(np.diff(turned, axis=1)) > BENT).any(axis=1)
    return turned[bent], free.t[::step][bent], tuple(worn)


def _bent(turned: Array) -> float:
    """By how much (rad) a finger's segments are bent on each other together, in the middle of the time."""
    return float(np.median(turned[:, -1] - turned[:, 0]))


def _backward(turned: Array) -> tuple[int, float]:
    """The joint that is bent backward most surely, and by how many standard deviations; in the middle of the time."""
    bent = np.median(np.diff(turned, axis=1), axis=0)
    sd = np.hypot(POSE_SD, SKIN * np.abs(bent).max())
    k = int(np.argmin(bent))
    return k, float(-bent[k] / sd)
