"""Angles that no joint of a hand reaches, in what an estimator made of a recording: told as questions.

In      a trajectory
Out     suspicions of severity `info`: which joint, how far, for what share of the time
Source  limits and their sources: hand/anatomy.py; how certain an angle is: the trajectory's standard deviations, `ANGLE_SD` where it has none
Limits  a method that clips angles to their limits hides how far they went: then the share of the time at a limit is asked about
"""

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.hand.anatomy import ANGLES, IS_DOF, JOINTS, LIMITS
from handscope.estimators.numerics.tail_probabilities import normal_sf
from handscope.estimators.numerics.typing import Array

ANGLE_SD = np.radians(5.0)  # of an angle whose method tells none
FALSE_ALARM = 1e-3  # of all joints of one recording
SHARE = 0.02  # of the time that counts: single samples are knocks
CLIPPED, AT_LIMIT = (
    0.2,
    np.radians(0.05),
)  # share of the time at a limit from which on it is asked about; how near that is


def check_anatomy(trajectory: Trajectory, angles: Array) -> list[Suspicion]:
    """Ask about joints that went, or stayed, where joints of a hand do not go.

    Parameters
    ----------
    trajectory : Trajectory
        When, and how certain its angles are.
    angles : Array
        (n, joints, 3) rad, of its joints; what is not measured is NaN.

    Returns
    -------
    list of Suspicion
        Severity `info`, largest excess first.
    """
    if len(trajectory) == 0:
        return []
    tests, found = int(IS_DOF.sum()) * 2, []
    for k, joint in enumerate(JOINTS):
        for a in joint.dofs:
            sd = (
                ANGLE_SD
                if trajectory.angles_sd is None
                else _typical(trajectory.angles_sd[:, k, a])
            )
            for sign, limit in zip((-1.0, 1.0), LIMITS[k, a]):
                excess = sign * (angles[:, k, a] - limit)
                excess_found = _beyond(trajectory.t, excess, sd, tests)
                if excess_found is not None:
                    far, p, span = excess_found
                    values: dict[str, float | str] = {
                        "joint": joint.name,
                        "angle": ANGLES[a],
                        "beyond_deg": float(np.degrees(far)),
                        "limit_deg": float(np.degrees(limit)),
                    }
                    code = "person.angle_beyond" if far > AT_LIMIT else "person.angle_at_limit"
                    found.append(
                        (
                            far,
                            Suspicion(
                                Message(code, values, "info"),
                                (joint.parent, joint.child),
                                (span,),
                                p,
                            ),
                        )
                    )
    return [s for _, s in sorted(found, key=lambda f: -f[0])]


def _typical(sd: Array) -> float:
    known = sd[np.isfinite(sd)]
    return float(np.hypot(np.median(known), np.radians(2.0))) if len(known) else ANGLE_SD


def _beyond(
    t: Array, excess: Array, sd: float, tests: int
) -> tuple[float, float, tuple[float, float]] | None:
    """How far beyond its limit an angle was for a share of the time, with the probability of that of an angle at its limit."""
    known = np.isfinite(excess)
    if not known.any():
        return None
    excess_known = excess[known]
    stays = float((np.abs(excess_known) < AT_LIMIT).mean())
    if stays <= CLIPPED and normal_sf(excess_known.max() / sd) * tests >= FALSE_ALARM:
        return None  # nor is any quantile beyond
    far = float(np.quantile(excess_known, 1 - SHARE))
    p = min(1.0, float(normal_sf(far / sd)) * tests)
    where = known & (excess > (0.0 if p < FALSE_ALARM else -AT_LIMIT))
    if p < FALSE_ALARM or stays > CLIPPED:
        return (
            (far if p < FALSE_ALARM else 0.0),
            (p if p < FALSE_ALARM else FALSE_ALARM),
            (float(t[where].min()), float(t[where].max())),
        )
    return None
