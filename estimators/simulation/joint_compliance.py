"""Joints that give about the axes that are none of their freedoms, as their flexion is.

In      a motion, a random generator
Out     the same motion with what its joints give added to the angles that are otherwise zero, its derivatives exact
Source  proximal interphalangeal joint through its flexion: 0.91 deg of ab-/adduction and 0.97 deg of axial rotation (standard deviations), one cadaveric
        index finger: Hess et al. 2013, Comput Math Methods Med 138063. That other joints give as much, and how that goes with flexion, is ours
Limits  the wrist and the thumb's CMC joint give nothing; no joint gives under a load
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.hand.anatomy import FLEXION, IS_DOF, JOINTS
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.motion import Motion

AS_MEASURED = 0.94  # deg, root mean square about one axis: Hess et al. 2013
BENDS = 1.5  # rad of the sine for a rad of flexion: there and back once over a joint's range
_GIVES = ~IS_DOF * np.array([[joint.name != "wrist"] for joint in JOINTS])


@dataclass(frozen=True)
class JointCompliance(Motion):
    """A movement whose joints also turn about axes that are no freedom."""

    size: float  # rad, root mean square over all phases
    phase: Array  # (joints, 3) rad, of the sine where the joint is straight

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Coordinates and derivatives (n, 54) as `Motion.at`; a straight joint gives nothing."""
        x, dx, ddx = super().at(t)
        f, df, ddf = (
            v[:, 6:].reshape(len(t), len(JOINTS), 3)[:, :, FLEXION, None] for v in (x, dx, ddx)
        )
        turned, size = BENDS * f + self.phase, np.sqrt(2) * self.size * _GIVES
        slope, bend = BENDS * np.cos(turned), -(BENDS**2) * np.sin(turned)
        given = np.sin(turned) - np.sin(self.phase), slope * df, slope * ddf + bend * df**2
        for whole, added in zip((x, dx, ddx), given):
            whole[:, 6:] += (size * added).reshape(len(t), -1)
        return x, dx, ddx


def draw_phases(rng: np.random.Generator) -> Array:
    """Somebody's own (joints, 3), rad."""
    return np.asarray(rng.uniform(0, 2 * np.pi, IS_DOF.shape))
