"""Phases of a grasp: grip force, load force, each finger's share, height of the object, flags of unreliable samples.

In      a stretch of a trajectory with forces
Out     a GraspPhase for each grasp
Source  Kortier, thesis 6.2.1: the sum of the forces moves the object (6.5), what cancels squeezes it (6.6); the object is taken to rest where it is grasped
        and let go, so that its height is the specific force integrated twice with no velocity at both ends: ours
Limits  the height's error grows with the square of the time held, by a centimetre or two in 5 s
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.fingertip_contacts import FINGERTIPS, contact_points_of
from handscope.estimators.data.trajectory import FORCE_WORDS, ForceFlag, Trajectory
from handscope.estimators.force import contact, fingertip_torques, load_exchange
from handscope.estimators.force.contact import ContactParams
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.messages.sentence import join
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array, Bools


@dataclass(frozen=True)
class GraspPhase:
    """One grasp: n instants from touch to release."""

    t: Array  # (n,) s
    fingers: tuple[str, ...]  # with a force sensor, in the order of the hand
    forces: Array  # (n, S, 3) N, in the global frame
    sd: Array  # (n, S, 3) N
    common_sd: Array  # (n, S, 3) N, of that what a hold does not average out
    lifting: Array  # (n, 3) m/s^2, specific force g + a
    axis: Array  # (n, 3) unit vector from the other fingers towards the thumb, in the global frame; NaN without a thumb
    distance: Array  # (n,) m between the pads, along it
    speed: Array  # (n,) m/s upwards
    height: Array  # (n,) m above where it was grasped
    flags: NDArray[np.uint8]  # (n, S)
    # (n,) W that the fingertips' torques put into it; None where not all of them are known all the
    # time
    turning: Array | None = None
    turning_sd: Array | None = None  # (n,) W
    velocity: Array | None = None  # (n, 3) m/s of the object, in the global frame
    # (n, S) Nm about the normal of each fingertip, as a right-handed screw driven the way its pad
    # faces; NaN where not known
    twist: Array | None = None
    twist_sd: Array | None = None  # (n, S) Nm
    # (S,) share by which each sensor's forces may be wrong alike, where one was calibrated
    scale_sd: Array | None = None

    @property
    def net(self) -> Array:
        """(n, 3) N: what moves the object."""
        return np.asarray(self.forces.sum(axis=1))

    @property
    def up(self) -> Array:
        """(n, 3) the direction in which the object must be held."""
        return np.asarray(self.lifting / np.linalg.norm(self.lifting, axis=1, keepdims=True))

    @property
    def load(self) -> Array:
        """(n,) N: the net force along that direction."""
        return np.asarray((self.net * self.up).sum(axis=1))

    @property
    def grip(self) -> Array:
        """(n,) N with which thumb and fingers squeeze: half of the difference of their forces; without a thumb the largest force."""
        if "thumb" not in self.fingers or len(self.fingers) < 2:
            return np.asarray(np.linalg.norm(self.forces, axis=2).max(axis=1))
        k = self.fingers.index("thumb")
        others = np.delete(self.forces, k, axis=1).sum(axis=1)
        return np.asarray(0.5 * np.linalg.norm(others - self.forces[:, k], axis=1))

    @property
    def squeeze(self) -> Array:
        """(n,) N: grip force along the line between the pads (half of (6.6))."""
        k = self.fingers.index("thumb")
        others = np.delete(self.forces, k, axis=1).sum(axis=1)
        return np.asarray(0.5 * ((others - self.forces[:, k]) * self.axis).sum(axis=1))

    @property
    def squeeze_scale_sd(self) -> float | None:
        """Standard deviation of the scale of `squeeze` where the sensors were calibrated: half of either side's, the worst of the fingers'."""
        if self.scale_sd is None:
            return None
        k = self.fingers.index("thumb")
        return float(0.5 * np.hypot(self.scale_sd[k], np.delete(self.scale_sd, k).max()))

    @property
    def shares(self) -> Array:
        """(n, S) of the fingers in the sum of the sizes of their forces."""
        size = np.linalg.norm(self.forces, axis=2)
        return np.asarray(size / size.sum(axis=1, keepdims=True))

    def flagged(self, within: Bools, but: int = 0) -> str:
        """Flags of the samples within, as sentences."""
        present = (
            int(np.bitwise_or.reduce(self.flags[within] & ~np.uint8(but), axis=None))
            if within.any()
            else 0
        )
        return join(words for flag, words in FORCE_WORDS.items() if present & flag)


UNREAD = ForceFlag.MISSING | ForceFlag.SATURATED  # forces that nobody read
UNSURE = int(
    ForceFlag.MISSING
    | ForceFlag.SATURATED
    | ForceFlag.DRIFT
    | ForceFlag.UNBALANCED
    | ForceFlag.UNORIENTED
)


def measured_fingers(trajectory: Trajectory) -> tuple[str, ...]:
    """The fingers whose forces are known at any time."""
    if trajectory.forces is None or not len(trajectory):
        return ()
    return tuple(f for k, f in enumerate(FINGERS) if np.isfinite(trajectory.forces[:, k]).any())


def find_grasp_phases(
    params: ContactParams, trajectory: Trajectory, geometry: HandGeometry | None = None
) -> list[GraspPhase]:
    """Every grasp of the stretch, in order; with a geometry places are those of the pads, without those of the bones' ends."""
    fingers = measured_fingers(trajectory)
    if not fingers or trajectory.forces is None:
        return []
    sizes = np.linalg.norm(trajectory.forces[:, [FINGERS.index(f) for f in fingers]], axis=2)
    found = contact.find_grasps(params, trajectory.t, sizes, contact.thumb_column(fingers))
    return [_grasp_phase(trajectory.between(g.onset, g.end), fingers, geometry) for g in found]


def unobserved_share(h: GraspPhase, used: Bools) -> float:
    """Residual along the grip axis as a share of the grip force: a finger without a sensor may take as much of the force, and of the load."""
    up, axis = h.up[used], h.axis[used]
    level = axis - (axis * up).sum(axis=1, keepdims=True) * up
    level = level / np.linalg.norm(level, axis=1, keepdims=True)
    rest = (h.net[used] * level).sum(axis=1)
    return float(abs(rest.mean()) / h.grip[used].mean()) if np.isfinite(rest).all() else 0.0


def _grasp_phase(
    part: Trajectory, fingers: Sequence[str], geometry: HandGeometry | None
) -> GraspPhase:
    rows = [FINGERS.index(f) for f in fingers]
    assert (
        part.forces is not None and part.forces_sd is not None and part.forces_common_sd is not None
    )
    assert part.force_flags is not None and part.lifting is not None
    axis, distance = _line_between_pads(
        part, _contact_points(part, fingers, geometry), part.forces[:, rows], fingers
    )
    return GraspPhase(
        part.t,
        tuple(fingers),
        part.forces[:, rows],
        part.forces_sd[:, rows],
        part.forces_common_sd[:, rows],
        part.lifting,
        axis,
        distance,
        *_integrate_between_rests(part.t, part.lifting[:, 2] - GRAVITY),
        part.force_flags[:, rows],
        *_torque_power(part, fingers),
        np.stack(
            [
                _integrate_between_rests(part.t, a)[0]
                for a in (part.lifting - np.array([0.0, 0.0, GRAVITY])).T
            ],
            axis=1,
        ),
        *_twist(part, fingers),
        part.force_scale_sd[:, rows].mean(axis=0)
        if part.force_scale_sd is not None and len(part)
        else None,
    )


def _torque_power(part: Trajectory, fingers: Sequence[str]) -> tuple[Array | None, Array | None]:
    """(n,) W of the torques of all fingertips that hold it, which turn with their distal phalanges, and its standard deviation (n,)."""
    rows = [FINGERS.index(f) for f in fingers]
    if (
        part.torques is None
        or part.torques_sd is None
        or len(part) < 3
        or not np.isfinite(part.torques[:, rows]).all()
    ):
        return None, None
    q = part.q_GS[:, [SEGMENT[CHAINS[f][-1]] for f in fingers]]
    step = (
        quat.log(quat.multiply(q[2:], quat.conjugate(q[:-2])))
        / (part.t[2:] - part.t[:-2])[:, None, None]
    )
    rates = np.concatenate([step[:1], step, step[-1:]])
    return load_exchange.rotational_power(part.torques[:, rows], rates), np.sqrt(
        ((part.torques_sd[:, rows] * rates) ** 2).sum(axis=(1, 2))
    )


def _twist(part: Trajectory, fingers: Sequence[str]) -> tuple[Array | None, Array | None]:
    """Torque (n, S) Nm of each fingertip about the normal of its contact, and its standard deviation."""
    rows = [FINGERS.index(f) for f in fingers]
    if (
        part.forces is None
        or part.torques is None
        or part.torques_sd is None
        or not np.isfinite(part.torques[:, rows]).any()
    ):
        return None, None
    # of every segment: docs/conventions.md
    palmar = np.array([1.0 if part.hand == "right" else -1.0, 0.0, 0.0])
    normal = quat.rotate(part.q_GS[:, [SEGMENT[CHAINS[f][-1]] for f in fingers]], palmar)
    return fingertip_torques.fingertip_twist(
        part.forces[:, rows], part.torques[:, rows], part.torques_sd[:, rows], normal
    )


def _contact_points(
    part: Trajectory, fingers: Sequence[str], geometry: HandGeometry | None
) -> Array:
    """Where the fingers touch (n, S, 3) in the wrist frame."""
    if geometry is None:
        return part.tips[:, [FINGERS.index(f) for f in fingers]]
    return np.stack(
        [contact_points_of(part, geometry, f, "bottom", FINGERTIPS[f]) for f in fingers], axis=1
    )


def _line_between_pads(
    part: Trajectory, pads: Array, forces: Array, fingers: Sequence[str]
) -> tuple[Array, Array]:
    """The line from the other fingers to the thumb in the global frame, and how far apart they are along it.

    The line is the direction of the forces; from the two positions, some centimetres apart and each wrong by one, it would be off by ten degrees.
    """
    if "thumb" not in fingers or len(fingers) < 2:
        return np.full((len(part), 3), np.nan), np.full(len(part), np.nan)
    k = fingers.index("thumb")
    offset = pads[:, k] - np.delete(pads, k, axis=1).mean(axis=1)
    q_GW = part.q_GS[:, SEGMENT["forearm"]]
    # without a forearm sensor WCS moves with the hand
    q_GW = np.where(np.isfinite(q_GW), q_GW, part.q_GS[:, SEGMENT["hand"]])
    push = quat.rotate(
        quat.conjugate(q_GW), np.delete(forces, k, axis=1).sum(axis=1) - forces[:, k]
    )
    line = np.nansum(push, axis=0)
    line = line / max(float(np.linalg.norm(line)), 1e-9)
    return quat.rotate(q_GW, line), np.asarray(offset @ line)


def _integrate_between_rests(t: Array, acceleration: Array) -> tuple[Array, Array]:
    """Speed and distance (n,) from an acceleration between two instants of rest."""
    if len(t) < 3 or not np.isfinite(acceleration).all():
        return np.full(len(t), np.nan), np.full(len(t), np.nan)
    speed = _cumulative_integral(acceleration, t)
    speed -= speed[-1] * (t - t[0]) / (t[-1] - t[0])
    return speed, _cumulative_integral(speed, t)


def _cumulative_integral(values: Array, t: Array) -> Array:
    """The integral (n,) from the first instant on, by trapezoids."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t))])
