"""What a person is told of a self-calibration: what a recording lacks and what to do, what movement did not tell, what was given and is not so.

In      readings, Solutions, Fingers
Out     sentences; InputError where nothing can be found
"""

import numpy as np

from estimators.errors import InputError
from estimators.self_calibration import findings, steadiness
from estimators.self_calibration.findings import Asked, Finger
from estimators.self_calibration.problem import Problem, Readings
from estimators.self_calibration.solver import Solution

ROUNDED = 0.05  # s, as durations are said


def require_length(asked: Asked, duration: float, where: str) -> None:
    if duration < asked.shortest - ROUNDED:
        raise InputError(
            f"there are {max(duration, 0.0):.1f} s of movement{where}, self-calibration needs {asked.shortest:g} s, better 40 s; move hand and fingers freely for longer"
        )


def require_movement(asked: Asked, finger: str, read: Readings) -> None:
    turning = float(np.degrees(np.linalg.norm(read.gyr[:, -1] - read.gyr[:, -1].mean(axis=0), axis=1).mean()))
    if turning < asked.moving:
        raise InputError(
            f"{finger}: it turned at {turning:.0f} deg/s on average ({asked.moving:g} are needed); move the hand in all directions while bending and stretching the finger"
        )


def require_one_minimum(finger: str, found: Solution) -> None:
    """InputError where a sensor slipped or the solver did not come to an end: what was found then is of no hand."""
    slipped = steadiness.slips(found)
    if slipped:
        first = slipped[0]
        raise InputError(
            f"{finger}: the sensor of {first.sensor} sat differently in the second half (its joints by {1e3 * first.shift:.0f} mm, its hinge by"
            f" {np.degrees(first.tilt):.0f} deg); fix it and record again; this finger is not calibrated"
        )
    if found.outcome != "converged":
        raise InputError(
            f"{finger}: the calibration did not come to an end; record 40 s of free movement again; this finger is not calibrated"
        )


def told(asked: Asked, finger: Finger) -> list[str]:
    """What a person should know of the result."""
    found, said = finger.solution, []
    links = found.problem.chain
    for k, joint in enumerate(links.joints):
        extent = float(np.degrees(np.ptp(np.percentile(found.problem.bent[:, k], [1, 99]))))
        if extent < asked.bent:
            said.append(
                f"{joint} was bent by {extent:.0f} deg only: its axis and the lengths beside it are not observable; bend it more, or give the lengths"
            )
    said += _doubted(found.problem)
    for segment, length in finger.segments.lengths.items():
        if not findings.known(asked, finger, segment):
            sd = finger.segments.lengths_sd[segment]
            said.append(
                f"the length of {segment} is not observable ({1e3 * length:.0f} mm, give or take {1e3 * sd:.0f}): that of the hand's measures is used"
            )
    return said


def _doubted(problem: Problem) -> list[str]:
    """What was given and is not so."""
    said = []
    for name, seat_sd, length, length_sd in zip(problem.chain.sensors, problem.seat_sd, problem.length, problem.length_sd):
        if length_sd > 1e-3 * problem.noise.length:
            said.append(
                f"the length of {name} was given as {1e3 * length:.0f} mm, movement says otherwise by {1e3 * length_sd:.0f} mm: measure it again; what movement says is used"
            )
        if seat_sd > np.radians(problem.noise.mounting):
            said.append(
                f"the sensor of {name} sits {np.degrees(seat_sd):.0f} deg off its nominal mounting: was another one put on there, or turned round?"
            )
    return said
