"""A pose taken three times with the hand lifted between: its mean counts, and its scatter is how well this person takes it."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.alignment import repeated_pose
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FLEXION, JOINT, JOINTS
from handscope.estimators.methods import METHODS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.pipeline.process import process
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.simulation.movements import functional_calibration, task_performance
from handscope.estimators.simulation.person import draw_person
from handscope.estimators.simulation.scenario import Simulated, simulate_performances
from handscope.estimators.simulation.sensors import PRESETS
from tests.simulated import DEG

EKF = METHODS["ekf"]
FLEXED = [j.name for j in JOINTS if j.name.endswith(("pip", "dip")) or "_mcp" in j.name]
FINGERS = [JOINT[name] for name in FLEXED if not name.startswith("thumb")]


@pytest.fixture(scope="module")
def three_poses() -> Simulated:
    """Somebody misses the pose by up to 4 deg, three times anew, and bends the index finger."""
    rng = np.random.default_rng(11)
    person = draw_person("left", rng)
    done = [
        task_performance.initial_pose(
            person.true,
            taken=functional_calibration.miss_posture(task_performance.flat(), 4.0, rng),
        )
        for _ in range(3)
    ]
    done.append(task_performance.TASKS["tapping"](person.true))
    return simulate_performances(
        done, "left", person.true, rng, PRESETS["MPU-9250"], known=person.declared
    )


def repeated(recording: Simulated, first: int = 1) -> Simulated:
    """The same with its poses as one row from the number `first` on."""
    events, number = [], 0
    for event in recording.events:
        if event.trial_type == "initial_pose":
            number += 1
            details = {"repetition": str(number - first + 1)} if number > first else {}
            event = replace(event, details={**event.details, **details})
        events.append(event)
    return replace(recording, events=tuple(events))


def flexion_error(recording: Simulated) -> float:
    """RMS over fingers' joints of the mean error after the last pose, rad."""
    moved = process(EKF, EKF.Params(), recording).trajectory
    start = max(e.end for e in recording.events if e.trial_type == "initial_pose") + 1
    rows = np.searchsorted(recording.truth.t, moved.t).clip(0, len(recording.truth.t) - 1)
    off = moved.angles - recording.truth.angles[rows]
    mean = np.nanmean(off[moved.t > start][:, FINGERS, FLEXION], axis=0)
    return float(np.sqrt((mean**2).mean()))


def test_the_mean_of_three_poses_is_nearer_than_one(three_poses: Simulated) -> None:
    assert flexion_error(repeated(three_poses)) < 0.8 * flexion_error(three_poses)


def test_its_scatter_is_the_persons(three_poses: Simulated) -> None:
    found, _ = calibrate(EKF.Params(), repeated(three_poses))
    assert [bool(c.pose_sd) for c in found] == [False, True, True]
    sd = found[-1].pose_sd["index_pip"]
    true = 4.0 * DEG / np.sqrt(3)  # of one pose, evenly spread
    assert sd[0] == pytest.approx(np.hypot(true / np.sqrt(3), repeated_pose.COMMON_SD), rel=0.35)
    assert sd[1] == pytest.approx(np.hypot(true, repeated_pose.COMMON_SD), rel=0.35)


def bent(calibration: Calibration, deg: float) -> Calibration:
    """As if the fingers had lain `deg` steeper on the hand."""
    q_BS = {
        s: quat.multiply(quat.about(2, (0 if s == "hand" else deg) * DEG), q)
        for s, q in calibration.q_BS.items()
    }
    q_GS = {
        s: quat.multiply(quat.multiply(q, quat.conjugate(calibration.q_BS[s])), q_BS[s])
        for s, q in calibration.q_GS.items()
    }
    return replace(calibration, q_BS=q_BS, q_GS=q_GS)


def test_poses_that_are_not_the_same_or_not_lifted_do_not_count_together(
    three_poses: Simulated,
) -> None:
    (first, *_), _ = calibrate(EKF.Params(), three_poses)
    same = repeated_pose.average([first, first])
    assert same.warnings[-1] == repeated_pose.NOT_LIFTED and same.q_BS == first.q_BS
    other = repeated_pose.average([bent(first, 30), first])
    assert "differ by" in other.warnings[-1] and other.pose_sd == {}


def test_what_was_measured_in_the_last_pose_keeps_its_own_standard_deviation(
    three_poses: Simulated,
) -> None:
    found, _ = calibrate(EKF.Params(), three_poses)
    measured = replace(found[-1], pose_sd={"index_mcp": (np.nan, 0.01, np.nan)})
    sd = repeated_pose.average([*found[:-1], measured]).pose_sd["index_mcp"]
    assert sd[1] == 0.01 and sd[0] < sd[2]


def test_a_row_begins_anew_where_nothing_says_that_it_goes_on(three_poses: Simulated) -> None:
    alone, _ = calibrate(EKF.Params(), three_poses)
    assert all(c.pose_sd == {} for c in alone)
    wrong = [replace(e, details={**e.details, "repetition": "x"}) for e in three_poses.events]
    with pytest.raises(InputError, match="repetition"):
        calibrate(EKF.Params(), replace(three_poses, events=tuple(wrong)))


def test_a_row_begins_anew_where_a_joint_was_measured_to_be_flexed_otherwise(
    three_poses: Simulated,
) -> None:
    """Else half of a contracture that was entered after the first pose would count."""
    number, events = 0, []
    for event in repeated(three_poses).events:
        if event.trial_type == "initial_pose":
            number += 1
            measured = {"index_pip_flexion_deg": 20.0} if number > 1 else {}
            event = replace(event, details={**event.details, **measured})
        events.append(event)
    found, _ = calibrate(EKF.Params(), replace(three_poses, events=tuple(events)))
    assert [bool(c.pose_sd) for c in found] == [False, False, True]
