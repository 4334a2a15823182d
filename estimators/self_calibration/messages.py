"""Messages to people about a self-calibration: what a recording lacks, what was not observable, which declared values are wrong, and what to do.

In      readings, Solutions, Fingers
Out     sentences; InputError where nothing can be found
"""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import CHAINS, JOINT, JOINTS, LIMITS
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.self_calibration import mounting_shift, residuals, sensor_order
from handscope.estimators.self_calibration import result as self_calibration_result
from handscope.estimators.self_calibration.problem import LIMBS, Problem, Readings
from handscope.estimators.self_calibration.result import Finger, Requirements
from handscope.estimators.self_calibration.sample_preparation import (
    DOUBTFUL,
    LONGEST_GAP,
    Gap,
    average_turning,
)
from handscope.estimators.self_calibration.solver import Solution

ROUNDED = 0.05  # s, rounding of durations in messages
LEFT_OUT = 3.0  # s of a recording: a shorter part that is left out is not reported
LACKING = 0.15  # share of missing rates from which on they are named as the reason of a failure
LOST = 0.25  # of DOUBTFUL: a mean of samples of which at least so many are bridged, at the slowest rates, too
NAMED = 3  # sensors with most gaps
RECOMMENDED_RATE = 100.0  # deg/s, of a finger's last sensor: slower ones were refused at 40
BEYOND = 45.0  # deg out of a joint's range: no loose glove
ROUND = 90.0  # deg by which a sensor that was put on the other way round is off at least
MOMENT = 0.15  # s: knocks that lie closer are one
OFTEN = 0.5  # knocks in a second, beyond which a person should do something about them


def require_length(asked: Requirements, duration: float) -> None:
    """InputError where the movement is shorter than self-calibration needs, s."""
    if duration < asked.shortest - ROUNDED:
        raise InputError(
            "self_calibration.too_short",
            length=max(duration, 0.0),
            least=asked.shortest,
        )


def require_samples(asked: Requirements, duration: float, holes: Sequence[Gap]) -> None:
    """InputError where too many samples are missing to leave a stretch that is long enough."""
    if duration < asked.shortest - ROUNDED:
        by = Counter(hole.sensor for hole in holes)
        names = ", ".join(name for name, _ in by.most_common(NAMED))
        raise InputError(
            "self_calibration.gaps",
            longest=LONGEST_GAP,
            count=len(holes),
            names=names,
            duration=duration,
            least=asked.shortest,
        )


def describe_stretch(start: float, stop: float, whole: float) -> list[str]:
    """Which part of a longer recording is used, s."""
    messages: list[str] = []
    if stop - start < whole - LEFT_OUT:
        messages.append(phrase("self_calibration.found_stretch", start=start, stop=stop))
    return messages


def describe_silent_sensors(finger: str, silent: Sequence[str], clipped: bool) -> list[str]:
    """What a finger loses by its silent sensors (the first one and those behind it); InputError where nothing is left.

    `clipped`: the first is silent because it was at its limit all the time.
    """
    if not silent:
        return []
    if silent[0] in ("hand", LIMBS[finger][0]):
        if clipped:
            raise InputError("self_calibration.saturated", finger=finger, segment=silent[0])
        raise InputError("self_calibration.sensor_silent", finger=finger, segment=silent[0])
    without = ", ".join(silent)
    if clipped:
        return [
            phrase(
                "self_calibration.found_saturated",
                finger=finger,
                segment=silent[0],
                segments=without,
            )
        ]
    return [
        phrase("self_calibration.found_silent", finger=finger, segment=silent[0], segments=without)
    ]


def require_movement(asked: Requirements, finger: str, read: Readings) -> None:
    """InputError where a finger or the hand moves too little for self-calibration."""
    hand, turning = (average_turning(read.gyr[:, k]) for k in (0, -1))
    if turning < asked.moving:
        if finger == "forearm":
            raise InputError(
                "self_calibration.forearm_turned_too_slowly", rate=turning, needed=asked.moving
            )
        raise InputError(
            "self_calibration.finger_turned_too_slowly",
            finger=finger,
            rate=turning,
            needed=asked.moving,
        )
    if hand < asked.hand_moving:
        raise InputError(
            "self_calibration.hand_turned_too_slowly",
            finger=finger,
            rate=hand,
            needed=asked.hand_moving,
        )


def require_one_minimum(
    asked: Requirements, finger: str, read: Readings, solution: Solution, start_time: float = 0.0
) -> None:
    """InputError where a gyroscope was at its limit or knocked too often, a sensor slipped, or the solver did not converge: its estimate is then no hand's.

    `start_time` (s): of the readings' first sample.
    """
    if solution.outcome != "converged":
        _require_calm(finger, solution, start_time)
    slipped = mounting_shift.find_mounting_shifts(solution, read)
    if slipped or solution.outcome != "converged":
        _require_rates(finger, read, solution)
        _require_order(finger, read, solution.problem)
    if slipped:
        first = slipped[0]
        raise InputError(
            "self_calibration.sensor_slipped",
            finger=finger,
            segment=first.sensor,
            shift=1000.0 * first.shift,
            tilt=np.degrees(first.tilt),
        )
    if solution.outcome != "converged":
        if stiff := ", ".join(self_calibration_result.stiff_joints(asked, solution)):
            raise InputError("self_calibration.not_converged_at_joint", finger=finger, joints=stiff)
        raise InputError(
            "self_calibration.not_converged",
            finger=finger,
            rate=average_turning(read.gyr[:, -1]),
            recommended=RECOMMENDED_RATE,
        )


def require_possible(finger: Finger) -> None:
    """InputError where a joint would be bent as none can: the hand's sensor, or the last phalanx', does not sit as declared."""
    for joint in finger.solution.problem.chain.joints:
        about, q_GB = JOINTS[JOINT[joint]], finger.segments.q_GB
        angles, limits = (
            joint_angles.decompose(quat.relative(q_GB[about.parent], q_GB[about.child])),
            LIMITS[JOINT[joint]],
        )
        beyond = float(
            np.degrees(
                np.median(np.maximum(limits[:, 0] - angles, angles - limits[:, 1]).max(axis=1))
            )
        )
        if beyond > BEYOND:
            name = about.child if about.parent not in ("hand", "forearm") else about.parent
            raise InputError(
                "self_calibration.mounting_contradicts_joint",
                finger=finger.name,
                name=name,
                joint=joint,
                beyond=beyond,
            )


def _require_calm(finger: str, solution: Solution, start_time: float) -> None:
    """InputError where the reason is that sensors were knocked again and again."""
    dt, by = solution.problem.dt, Counter(outlier.sensor for outlier in solution.outliers)
    times = _merge_moments([start_time + dt * outlier.sample for outlier in solution.outliers])
    if len(times) > OFTEN * dt * len(solution.problem):
        name = solution.problem.chain.sensors[by.most_common(1)[0][0]]
        raise InputError(
            "self_calibration.impacts",
            finger=finger,
            count=len(times),
            seconds=dt * len(solution.problem),
            name=name,
            time=times[0],
        )


def _require_rates(finger: str, read: Readings, solution: Solution) -> None:
    """InputError where the reason is that sensors turned faster than their gyroscopes can measure."""
    lacking = (read.gyr_doubt > LOST * DOUBTFUL).mean(axis=0)
    worst = int(np.argmax(lacking))
    if lacking[worst] > LACKING:
        raise InputError(
            "self_calibration.rates_missing",
            finger=finger,
            segment=solution.problem.chain.sensors[worst],
            share=100 * lacking[worst],
        )


def _require_order(finger: str, read: Readings, problem: Problem) -> None:
    """InputError where the reason is that sensors sit in another order than they are named in."""
    names = problem.chain.sensors
    sitting = sensor_order.find_sensor_order(problem.chain, problem.noise, read, problem.flexing)
    elsewhere = [name for name, there in zip(names, sitting) if name != there]
    if len(elsewhere) == 2:
        raise InputError(
            "self_calibration.sensors_exchanged",
            finger=finger,
            first=elsewhere[0],
            second=elsewhere[1],
        )
    if elsewhere:
        raise InputError(
            "self_calibration.sensors_in_other_order", finger=finger, names=", ".join(sitting)
        )


def describe_result(asked: Requirements, finger: Finger) -> list[str]:
    """Messages about the result: what was not observable, which priors it contradicts."""
    solution, messages = finger.solution, []
    stiff = self_calibration_result.stiff_joints(asked, solution)
    beside_stiff = {
        segment
        for joint in stiff
        for segment in self_calibration_result.adjacent_segments(solution.problem.chain, joint)
    }
    if "wrist" in stiff:
        messages.append(phrase("self_calibration.found_stiff_wrist", extent=stiff["wrist"]))
    elif stiff:
        joints = ", ".join(f"{joint} ({extent:.0f} deg)" for joint, extent in stiff.items())
        given = ", ".join(s for s in CHAINS[finger.name] if s in beside_stiff)
        messages.append(phrase("self_calibration.found_stiff", joints=joints, segments=given))
    messages += _describe_wrong_priors(solution.problem) + _describe_reversed_sensors(finger)
    for segment in finger.segments.p_BS:
        if segment not in beside_stiff and not self_calibration_result.is_placed(
            asked, finger, segment
        ):
            sd = float(np.linalg.norm(finger.sure.p_BS[segment]))
            messages.append(
                phrase(
                    "self_calibration.found_no_place",
                    segment=segment,
                    finger=finger.name,
                    sd=1e3 * sd,
                )
            )
    for segment, length in finger.segments.lengths.items():
        if segment not in beside_stiff and not self_calibration_result.is_length_known(
            asked, finger, segment
        ):
            sd = finger.segments.lengths_sd[segment]
            messages.append(
                phrase(
                    "self_calibration.found_no_length",
                    segment=segment,
                    length=1e3 * length,
                    sd=1e3 * sd,
                )
            )
    return messages


def describe_misfit(finger: Finger, joint: int, misfit: float) -> list[str]:
    """A message where the movement of a finger contradicts the model by more than independent errors explain: `misfit` above 1, largest at one of its joints."""
    if misfit <= 1.0:
        return []
    links = finger.solution.problem.chain
    return [
        phrase(
            "self_calibration.found_misfit",
            finger=finger.name,
            joint=links.joints[joint],
            times=np.sqrt(misfit),
        )
    ]


def _describe_reversed_sensors(finger: Finger) -> list[str]:
    """Sensors that sit the other way round than their nominal mounting, which an axis or a bone alone does not show."""
    problem, at, messages = finger.solution.problem, finger.solution.at, []
    bones = {s: at.far[a] - at.near[b] for s, b, a in residuals.bones(problem.chain)}
    for s, name in enumerate(problem.chain.sensors):
        z = quat.rotate(quat.conjugate(finger.segments.q_BS[name]), np.array([0.0, 0.0, 1.0]))
        ways = [z @ problem.flexing[s]] + (
            [bones[s] @ problem.distal[s] / np.linalg.norm(bones[s])] if s in bones else []
        )
        tilt = float(np.degrees(np.arccos(np.clip(min(ways), -1.0, 1.0))))
        if tilt > ROUND:
            messages.append(phrase("self_calibration.found_other_mounting", name=name, tilt=tilt))
    return messages


def describe_outliers(fingers: Sequence[Finger]) -> list[str]:
    """Which sensors contradict the others for moments, each named once though fingers share the hand's."""
    by: dict[tuple[str, str], list[float]] = {}
    for finger in fingers:
        for outlier in finger.solution.outliers:
            name = finger.solution.problem.chain.sensors[outlier.sensor]
            by.setdefault((name, outlier.kind), []).append(float(finger.t[outlier.sample]))
    messages = []
    for (name, kind), times in by.items():
        at = _merge_moments(times)
        messages.append(
            phrase("self_calibration.found_gyroscope_impacts", name=name, count=len(at), time=at[0])
            if kind == "gyr"
            else phrase(
                "self_calibration.found_accelerometer_impacts",
                name=name,
                count=len(at),
                time=at[0],
            )
        )
    return messages + _describe_frequent_impacts(
        by, max((float(finger.t[-1] - finger.t[0]) for finger in fingers), default=0.0)
    )


def _describe_frequent_impacts(
    by: Mapping[tuple[str, str], Sequence[float]], duration: float
) -> list[str]:
    """What to do where sensors were knocked again and again."""
    times = _merge_moments([t for at in by.values() for t in at])
    if len(times) <= OFTEN * duration:
        return []
    counts = Counter({name: 0 for name, _ in by})
    for (name, _), at in by.items():
        counts[name] += len(at)
    return [
        phrase(
            "self_calibration.found_many_impacts",
            count=len(times),
            seconds=duration,
            name=counts.most_common(1)[0][0],
        )
    ]


def _merge_moments(times: Sequence[float]) -> list[float]:
    """Instants (s) in order; those of one impact count once."""
    solution: list[float] = []
    for t in sorted(times):
        if not solution or t - solution[-1] > MOMENT:
            solution.append(t)
    return solution


def _describe_wrong_priors(problem: Problem) -> list[str]:
    """Declared values that the estimate contradicts."""
    messages = []
    for name, mounting_sd, length, length_sd in zip(
        problem.chain.sensors, problem.mounting_sd, problem.length, problem.length_sd
    ):
        if length_sd > 1e-3 * problem.noise.length:
            messages.append(
                phrase(
                    "self_calibration.found_other_length",
                    name=name,
                    length=1e3 * length,
                    sd=1e3 * length_sd,
                )
            )
        if mounting_sd > np.radians(problem.noise.mounting):
            messages.append(
                phrase(
                    "self_calibration.found_other_mounting", name=name, tilt=np.degrees(mounting_sd)
                )
            )
    return messages
