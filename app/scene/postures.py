"""Postures to draw: what stands in for angles that are not measured, and smooth ways from one posture to the next for the ghost hand.

In/Out  joint angles (joints, 3) rad of anatomy.JOINTS
Source  minimum jerk: Flash & Hogan 1985, J Neurosci 5:1688
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.hand.anatomy import JOINTS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.movements import task_performance

PASSAGE = 0.7  # s


def angles_of(posture: Array) -> Array:
    """Joint angles (joints, 3) of a posture (54,) of estimators.simulation.motion."""
    angles: Array = posture[6:].reshape(len(JOINTS), 3)
    return angles


def relaxed() -> Array:
    """The resting hand."""
    return angles_of(task_performance.relaxed())


def filled(angles: Array) -> Array:
    """The same angles, the resting hand's where they are not known (NaN)."""
    return np.where(np.isnan(angles), relaxed(), angles)


def between(start: Array, stop: Array, share: float) -> Array:
    """The posture on the way from `start` (share 0) to `stop` (share 1) in a movement of minimum jerk."""
    return start + (stop - start) * eased(share)


def eased(share: float) -> float:
    """How far a movement of minimum jerk has come after a share of its time."""
    s = min(max(share, 0.0), 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


@dataclass(frozen=True)
class Passage:
    """A smooth way from a hand that was shown to another one, which may move meanwhile."""

    since: float  # s
    angles: Array  # (joints, 3) at its beginning, all known
    q: Array  # (4,) orientation at its beginning

    def at(self, now: float, angles: Array, q: Array) -> tuple[Array, Array]:
        """The hand to draw at `now` s on the way to `angles` (joints, 3) and `q` (4,)."""
        share = eased((now - self.since) / PASSAGE)
        if share >= 1.0:
            return angles, q
        return self.angles + share * (angles - self.angles), quat.slerp(
            self.q, q, np.asarray(share)
        )


def along(postures: Sequence[Array], t: float, move: float = 1.0, hold: float = 0.8) -> Array:
    """A ghost that shows what to do: at time t (s) of an endless round through `postures`, each held `hold` s, `move` s to the next."""
    leg, within = divmod(t, move + hold)
    k = int(leg) % len(postures)
    return between(postures[k], postures[(k + 1) % len(postures)], (within - hold) / move)
