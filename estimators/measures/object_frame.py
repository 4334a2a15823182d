"""What is held, as it seems so far: mass or stiffness by recursive least squares while a task still goes on.

In      a trajectory with fingertip forces up to now
Out     the estimate as it stood after every sample of the newest grasp, with its standard deviation; None where it is not observable
Source  Kortier, thesis (6.5), (6.6), recursive with forgetting; lift.py and squeeze.py tell the same of the finished task
Limits  the object is taken to be at rest now: while it is being raised its speed is not known, and the mass is estimated from the samples since it left the table
"""

from collections.abc import Callable, Mapping

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.force import grasp_phases
from handscope.estimators.force.grasp_phases import UNSURE, GraspPhase
from handscope.estimators.force.identification import RunningEstimate
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import lift, spring_identification, squeeze
from handscope.estimators.measures.signals import LEAST, resample_even


def lifted_mass(trajectory: Trajectory, geometry: HandGeometry) -> RunningEstimate | None:
    """kg, of what was lifted last."""
    params = lift.Params()
    h = _newest_grasp(trajectory, geometry)
    moving = (
        np.flatnonzero(np.abs(h.speed) > params.moving)
        if h is not None and np.isfinite(h.speed).all()
        else np.empty(0, int)
    )
    if h is None or not len(moving):
        return None
    # neither let go nor back on the table
    up = h.t[-1] > trajectory.t[-1] - params.shortest and h.height[-1] > params.lifted
    last = np.inf if up else h.t[moving[-1]] - params.margin
    used = (
        (h.t >= h.t[moving[0]] + params.margin)
        & (h.t <= last)
        & np.isfinite(h.forces).all(axis=(1, 2))
    )
    if used.sum() < LEAST or _is_unsure(h, used) or h.height[used].max() < params.lifted:
        return None
    return lift.estimate_mass(params, h, used).running


def squeezed_stiffness(trajectory: Trajectory, geometry: HandGeometry) -> RunningEstimate | None:
    """N/m, of what was squeezed last."""
    params = squeeze.Params()
    h = _newest_grasp(trajectory, geometry)
    if h is None or "thumb" not in h.fingers or len(h.fingers) < 2:
        return None
    used = (h.t > h.t[0] + params.margin) & np.isfinite(h.squeeze) & np.isfinite(h.distance)
    if used.sum() < 2 * LEAST or _is_unsure(h, used):
        return None
    force, distance = (
        resample_even(h.t[used], v[used], lowpass=params.lowpass) for v in (h.squeeze, h.distance)
    )
    if np.ptp(force.values) < params.least_force or np.ptp(distance.values) < params.least_depth:
        return None
    bent = spring_identification.stiffness_change(force.t, force.values, distance.values)
    return spring_identification.running_stiffness(
        squeeze.with_calibrated_scale(params, h),
        force.t,
        force.values,
        distance.values,
        grasp_phases.unobserved_share(h, used),
        bent,
    )


SO_FAR: Mapping[
    str, tuple[str, Callable[[Trajectory, HandGeometry], RunningEstimate | None]]
] = {  # by measure: the quantity and its running estimate
    "lift": ("mass", lifted_mass),
    "squeeze": ("stiffness", squeezed_stiffness),
}


def _newest_grasp(trajectory: Trajectory, geometry: HandGeometry) -> GraspPhase | None:
    found = grasp_phases.find_grasp_phases(lift.Params(), trajectory, geometry)
    return found[-1] if found and len(found[-1].t) >= LEAST else None


def _is_unsure(h: GraspPhase, used: np.ndarray) -> bool:
    return bool(np.bitwise_or.reduce(h.flags[used], axis=None) & UNSURE)
