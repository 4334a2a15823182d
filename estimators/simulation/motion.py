"""A motion of arm and hand: smooth coordinates of time with exact derivatives.

Coordinates (54,): wrist centre in the global frame (3, m), forearm turned against its base orientation (3, rad: z-x'-y''), then flexion, deviation
and pronation of the 16 joints (48, rad). The base orientation has the palm down and the fingers along the global y axis, on either hand.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BPoly, PPoly, make_interp_spline
from scipy.special import factorial

from handscope.estimators.hand.anatomy import ANGLES, JOINT, JOINTS
from handscope.estimators.numerics.typing import Array

SIZE = 6 + 3 * len(JOINTS)
COORDINATES = {
    name: k
    for k, name in enumerate(
        (
            "wrist_x",
            "wrist_y",
            "wrist_z",
            "forearm_flexion",
            "forearm_deviation",
            "forearm_pronation",
        )
    )
}
COORDINATES |= {
    f"{joint.name}_{angle}": 6 + 3 * JOINT[joint.name] + a
    for joint in JOINTS
    for a, angle in enumerate(ANGLES)
}


def make_posture(base: Array | None = None, **degrees_or_metres: float) -> Array:
    """A coordinate vector: `base` (default: all zero) with the named coordinates replaced; angles in degrees, wrist places in metres."""
    x = np.zeros(SIZE) if base is None else base.copy()
    for name, value in degrees_or_metres.items():
        k = COORDINATES[name]
        x[k] = value if k < 3 else np.radians(value)
    return x


@dataclass(frozen=True)
class Motion:
    """Coordinates as a piecewise polynomial of time, at least twice continuously differentiable."""

    spline: PPoly

    @property
    def duration(self) -> float:
        return float(self.spline.x[-1] - self.spline.x[0])

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Coordinates, their first and second derivatives at t (n,): three (n, 54). Before and after the motion it rests."""
        inside = np.clip(t, self.spline.x[0], self.spline.x[-1])
        moving = (t >= self.spline.x[0]) & (t <= self.spline.x[-1])
        return (
            self.spline(inside),
            self.spline(inside, 1) * moving[:, None],
            self.spline(inside, 2) * moving[:, None],
        )


def move_through(points: Sequence[tuple[float, Array]]) -> Motion:
    """Rest at each (time, posture) and move between them with minimum jerk (Flash & Hogan 1985): quintic, at rest at both ends."""
    t = np.array([time for time, _ in points])
    x = np.array([p for _, p in points])
    derivatives = np.stack([x, np.zeros_like(x), np.zeros_like(x)], axis=1)
    return Motion(PPoly.from_bernstein_basis(BPoly.from_derivatives(t, list(derivatives))))


def interpolate_postures(t: Array, x: Array) -> Motion:
    """The quintic spline through postures x (n, 54) at times t (n,), at rest at both ends."""
    still = [(1, np.zeros(x.shape[1])), (2, np.zeros(x.shape[1]))]
    spline = make_interp_spline(t, x, k=5, bc_type=(still, still))  # type: ignore[arg-type]  # the stubs know only scalars
    breaks = np.unique(spline.t)
    c = np.stack([spline(breaks[:-1], m) / factorial(m) for m in range(5, -1, -1)])
    return Motion(PPoly(c, breaks))


def shift_motion(motion: Motion, by: float) -> Motion:
    """The same motion, later by `by` seconds."""
    return Motion(PPoly(motion.spline.c, motion.spline.x + by))


def join_motions(*motions: Motion) -> Motion:
    """One after the other; each begins where the one before it ends."""
    breaks, here = [np.zeros(1)], motions[0].spline(motions[0].spline.x[0])
    for spline in (m.spline for m in motions):
        assert np.allclose(spline(spline.x[0]), here, atol=1e-9), "the postures do not meet"
        breaks.append(spline.x[1:] - spline.x[0] + breaks[-1][-1])
        here = spline(spline.x[-1])
    return Motion(
        PPoly(np.concatenate([m.spline.c for m in motions], axis=1), np.concatenate(breaks))
    )


def continue_through(
    state: tuple[Array, Array, Array], points: Sequence[tuple[float, Array]], t: float
) -> Motion:
    """Go on from coordinates with their first and second derivatives (each (54,)) at time t, then through `points` as `move_through` does."""
    times = np.array([t, *(time for time, _ in points)])
    still = [np.stack([p, np.zeros(SIZE), np.zeros(SIZE)]) for _, p in points]
    return Motion(
        PPoly.from_bernstein_basis(BPoly.from_derivatives(times, [np.stack(state), *still]))
    )
