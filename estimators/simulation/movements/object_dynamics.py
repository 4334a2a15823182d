"""An object between thumb and index finger: lifted and put down again, or squeezed; the motion, and the forces that the fingers exert on it.

Source  Kortier, thesis 6.2.3: cylinders of 6 cm with 0.28 and 0.44 kg lifted by 0.5 m for 3 s; a spring of 0.6 N/mm, 4 cm long, 10 g, lifted by
        0.2 m and compressed eight times; grip in proportion to the load: Johansson & Westling 1984 (numbers ours: friction 0.8, margin 1.4)
Limits  fingertips do not give way; the object does not turn between them; both fingers carry about the same share
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from handscope.estimators.data.fingertip_contacts import FINGERTIPS, offset
from handscope.estimators.data.samples import Event
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.kinematics import Kinematics
from handscope.estimators.simulation.motion import (
    COORDINATES,
    interpolate_postures,
    join_motions,
    make_posture,
    move_through,
)
from handscope.estimators.simulation.movements.grasp_postures import Hold, close_holds
from handscope.estimators.simulation.movements.static_hold import GRASPED
from handscope.estimators.simulation.movements.task_performance import Performance, relaxed
from handscope.estimators.simulation.movements.whole_hand import smooth, swaying

RATE = 50.0  # Hz, of the samples that the motion goes through
CYLINDER, SPRING = 0.06, 0.04  # m between the fingertips
FRICTION, MARGIN, LIGHTEST = 0.8, 1.4, 0.6  # N of grip with which nothing is lifted yet
GRASP, LOAD, LIFT, OPEN = 0.35, 0.45, 1.0, 0.8  # s
OPEN_DISTANCE = make_posture(
    None, index_mcp_flexion=-14.0, index_pip_flexion=-8.0, thumb_cmc_deviation=-12.0
)
SLIPPING = 0.16  # s


@dataclass(frozen=True, kw_only=True)
class HeldObject:
    """What is held."""

    mass: float  # kg
    length: float = CYLINDER  # m between the fingertips that only touch it
    stiffness: float = 0.0  # N/m of the whole; 0: it does not give way
    damping: float = 0.0  # N s/m


@dataclass(frozen=True, kw_only=True)
class Mishap:
    """What may go wrong."""

    slips: Sequence[float] = ()  # s since the task's beginning
    third: float = 0.0  # share of load and grip that the middle finger carries, which has no sensor


NO_MISHAP = Mishap()


def lift(
    geometry: HandGeometry,
    rng: np.random.Generator | None = None,
    mass: float = 0.28,
    height: float = 0.5,
    hold: float = 3.0,
    mishap: Mishap = NO_MISHAP,
    task: str = "lift",
    lead: float = 1.5,
) -> Performance:
    """A cylinder taken from the table, held up and put down."""
    thing, held = HeldObject(mass=mass), _touching(geometry, CYLINDER)
    up = GRASP + LOAD
    down = up + LIFT + hold
    end = down + LIFT + LOAD + GRASP
    t = _times(OPEN + end + OPEN)
    own = t - OPEN
    x = np.tile(held, (len(t), 1)) + _open(own, end)[:, None] * OPEN_DISTANCE
    x += _raise_arm(own, rng, height, up, down)
    grip = _Grip(geometry, thing, OPEN + lead, up, down + LIFT, end, mishap)
    return _frame_motion(task, t, x, grip.forces, lead, OPEN + end)


def squeeze(
    geometry: HandGeometry,
    rng: np.random.Generator | None = None,
    stiffness: float = 600.0,
    damping: float = 0.0,
    times: int = 8,
    period: float = 1.2,
    depth: float = 0.011,
    mass: float = 0.010,
    mishap: Mishap = NO_MISHAP,
    task: str = "squeeze",
    lead: float = 1.5,
) -> Performance:
    """A spring taken from the table, lifted by 0.2 m, squeezed `times` by about `depth` m and put down."""
    thing = HeldObject(mass=mass, length=SPRING, stiffness=stiffness, damping=damping)
    up = GRASP + LOAD
    start = up + LIFT + 0.5
    down = start + times * period + 0.5
    end = down + LIFT + LOAD + GRASP
    t = _times(OPEN + end + OPEN)
    own = t - OPEN
    deep = depth * (np.ones(times) if rng is None else rng.uniform(0.75, 1.25, times))
    squeezed = sum(d * _bump(own, start + k * period, period) for k, d in enumerate(deep))
    touched = LIGHTEST / stiffness * _between(own, 0.0, end, GRASP)
    x = (
        _closing(geometry, np.asarray(SPRING - touched - squeezed))
        + _open(own, end)[:, None] * OPEN_DISTANCE
    )
    x += _raise_arm(own, rng, 0.2, up, down)
    grip = _Grip(geometry, thing, OPEN + lead, up, down + LIFT, end, mishap)
    return _frame_motion(task, t, x, grip.forces, lead, OPEN + end)


TASKS: Mapping[str, Callable[..., Performance]] = {"lift": lift, "squeeze": squeeze}


@dataclass(frozen=True)
class _Grip:
    """When the fingers hold what."""

    geometry: HandGeometry
    thing: HeldObject
    onset: float  # s of the performance: the fingers touch
    up: float  # s after that the object leaves the table
    down: float  # and is back
    end: float  # and is let go
    mishap: Mishap

    def forces(self, k: Kinematics) -> Array:
        """Forces (n, 5, 3) N that the fingers exert on the object, in the global frame."""
        t, thing = k.t - self.onset, self.thing
        held = _between(t, 0.0, self.end, GRASP)
        off = _between(t, self.up - LOAD, self.down + LOAD, LOAD)
        tips = [SEGMENT[CHAINS[f][-1]] for f in ("thumb", "index")]
        acceleration = k.a[:, tips].mean(axis=1) + self._slipping(t)[:, None] * np.array(
            [0.0, 0.0, 1.0]
        )
        total = thing.mass * (
            acceleration * (off > 0.999)[:, None] + off[:, None] * np.array([0.0, 0.0, GRAVITY])
        )
        offset = self._place(k, "thumb") - self._place(k, "index")
        distance = np.linalg.norm(offset, axis=1)
        grip = held * LIGHTEST + 0.5 * MARGIN / FRICTION * np.linalg.norm(total, axis=1)
        grip *= np.prod(
            [1 + 0.6 * smooth((t - s - SLIPPING) / 0.1) for s in self.mishap.slips], axis=0
        )
        if thing.stiffness:
            speed = -np.gradient(distance, k.t) if thing.damping and len(k.t) > 1 else 0.0
            grip = np.maximum(
                thing.stiffness * (thing.length - distance) + thing.damping * speed, 0.0
            ) * (held > 0)
        toward = offset / distance[:, None]
        push, carried = grip[:, None] * toward, (1 - self.mishap.third) * total
        forces = np.zeros((len(t), len(FINGERS), 3))
        forces[:, FINGERS.index("index")] = (1 - self.mishap.third) * push + 0.5 * carried
        forces[:, FINGERS.index("thumb")] = -push + 0.5 * carried
        forces[:, FINGERS.index("middle")] = self.mishap.third * (push + total)
        return forces

    def _place(self, k: Kinematics, finger: str) -> Array:
        s = SEGMENT[CHAINS[finger][-1]]
        return np.asarray(
            k.p[:, s]
            + quat.rotate(k.q_GB[:, s], offset(self.geometry, finger, "bottom", FINGERTIPS[finger]))
        )

    def _slipping(self, t: Array) -> Array:
        """Acceleration (n,) m/s^2 of the object against the fingers: down, then caught."""
        half, a = SLIPPING / 2, np.zeros(len(t))
        for s in self.mishap.slips:
            a += np.where((t >= s) & (t < s + half), -4.0, 0.0) + np.where(
                (t >= s + half) & (t < s + SLIPPING), 4.0, 0.0
            )
        return a


def _raise_arm(
    own: Array, rng: np.random.Generator | None, height: float, up: float, down: float
) -> Array:
    """What the arm adds to the coordinates (n, 54): the way up and down and, as people do, a sway."""
    x = np.zeros((len(own), len(make_posture())))
    x[:, COORDINATES["wrist_z"]] = (
        height * smooth((own - up) / LIFT) * smooth((down + LIFT - own) / LIFT)
    )
    if rng is not None:
        held = smooth((own - up) / LIFT) * smooth((down + LIFT - own) / LIFT)
        for name, size in {"wrist_x": 0.03, "wrist_y": 0.03, "wrist_z": 0.03}.items():
            x[:, COORDINATES[name]] += size * held * swaying(own, rng)
        for name in ("forearm_flexion", "forearm_deviation", "forearm_pronation"):
            x[:, COORDINATES[name]] += np.radians(6.0) * held * swaying(own, rng)
    return x


def _touching(geometry: HandGeometry, distance: float) -> Array:
    return np.asarray(
        close_holds(
            GRASPED[None], [Hold(("thumb", "bottom"), ("index", "bottom"), distance)], geometry
        )[0]
    )


def _closing(geometry: HandGeometry, distance: Array) -> Array:
    """Postures (n, 54) with the fingertips nearly `distance` (n,) m apart: a smooth way through exact ones."""
    knots = np.linspace(float(distance.min()) - 1e-3, float(distance.max()) + 1e-3, 7)
    postures = [_touching(geometry, d) for d in knots]
    return np.asarray(make_interp_spline(knots, postures, k=3)(distance))


def _frame_motion(
    task: str, t: Array, x: Array, forces: Callable[[Kinematics], Array], lead: float, end: float
) -> Performance:
    """From the relaxed posture into the motion and back."""
    motion = interpolate_postures(t, x)
    first, last = motion.spline(motion.spline.x[0]), motion.spline(motion.spline.x[-1])
    whole = join_motions(
        move_through([(0.0, relaxed()), (lead, first)]),
        motion,
        move_through([(0.0, last), (1.5, relaxed())]),
    )
    return Performance(whole, (Event(lead, motion.duration, "task", {"task_name": task}),), forces)


def _times(duration: float) -> Array:
    return np.linspace(0.0, duration, round(duration * RATE) + 1)


def _between(t: Array, start: float, stop: float, ramp: float) -> Array:
    """From 0 to 1 within `ramp` behind `start`, back to 0 at `stop` (n,)."""
    return np.asarray(smooth((t - start) / ramp) * smooth((stop - t) / ramp))


def _open(own: Array, end: float) -> Array:
    """How far the fingers are open (n,): closed from 0 to `end`."""
    return np.asarray(1 - smooth((own + OPEN) / OPEN) * smooth((end + OPEN - own) / OPEN))


def _bump(t: Array, start: float, period: float) -> Array:
    """From 0 to 1 and back (n,), a squeeze."""
    u = np.clip((t - start) / period, 0.0, 1.0)
    return np.asarray(0.5 * (1 - np.cos(2 * np.pi * u)))
