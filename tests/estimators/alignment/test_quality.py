"""The grade of each joint's calibration follows the worse of its two sensors, and says what decided
it."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.alignment import initial_pose
from handscope.estimators.alignment.quality import JointQuality, of_joints
from handscope.estimators.data.calibration import Calibration, CalibrationSource, SensorQuality
from handscope.estimators.hand.anatomy import JOINTS, SEGMENTS
from handscope.estimators.hand.geometry import sized
from tests.simulated import INSTANT, in_strips

DEG = np.pi / 180
STILL = SensorQuality(0.2 * DEG, 0.1 * DEG, 0.0, 5.0 * DEG)
GOOD = replace(
    initial_pose.uncalibrated("left", sized("left"), {}, SEGMENTS, 0.0),
    source=CalibrationSource.POSE,
    quality=dict.fromkeys(SEGMENTS, STILL),
)


def graded(calibration: Calibration, faulty: tuple[str, ...] = ()) -> dict[str, JointQuality]:
    return {j.joint: j for j in of_joints(calibration, faulty)}


def test_a_careful_pose_of_a_simulated_hand_is_good_for_every_joint() -> None:
    made = in_strips("left")
    pose = initial_pose.pose_of(made.events[0])
    found = graded(
        initial_pose.calibrate(
            INSTANT, "left", made.geometry, made.mounting, list(made.samples.values()), pose
        )
    )
    assert set(found) == {j.name for j in JOINTS}
    assert {j.grade for j in found.values()} == {"good"}


@pytest.mark.parametrize(
    ("changed", "grade", "reason"),
    [
        ({"misalignment": 20 * DEG}, "fair", "turned"),
        ({"misalignment": 50 * DEG}, "poor", "turned"),
        ({"rate_wander": 2.5 * DEG}, "fair", "restless"),
        ({"tilt_change": 2.0 * DEG}, "fair", "tilted"),
    ],
)
def test_one_sensor_decides_the_joints_on_either_side_and_no_other(
    changed: dict[str, float], grade: str, reason: str
) -> None:
    found = graded(
        replace(GOOD, quality={**GOOD.quality, "index_middle": replace(STILL, **changed)})
    )
    for joint in ("index_pip", "index_dip"):
        assert (found[joint].grade, found[joint].reason, found[joint].segment) == (
            grade,
            reason,
            "index_middle",
        )
    assert {j.grade for name, j in found.items() if name not in ("index_pip", "index_dip")} == {
        "good"
    }


def test_where_movements_told_how_a_sensor_sits_their_doubt_counts_and_not_how_askew_it_is() -> (
    None
):
    misaligned = replace(
        GOOD, quality={**GOOD.quality, "index_distal": replace(STILL, misalignment=60 * DEG)}
    )
    determined = replace(misaligned, q_BS_sd={"index_distal": np.array([1.0, 1.0, 1.0]) * DEG})
    assert (graded(misaligned)["index_dip"].grade, graded(determined)["index_dip"].grade) == (
        "poor",
        "good",
    )
    doubtful = replace(misaligned, q_BS_sd={"index_distal": np.array([9.0, 1.0, 1.0]) * DEG})
    assert (graded(doubtful)["index_dip"].grade, graded(doubtful)["index_dip"].reason) == (
        "poor",
        "axis",
    )


def test_a_fault_defaults_and_a_missing_sensor_are_told_apart() -> None:
    assert graded(GOOD, ("ring_distal",))["ring_dip"] == JointQuality(
        "ring_dip", "poor", "fault", "ring_distal"
    )
    assert {j.reason for j in of_joints(replace(GOOD, source=CalibrationSource.NONE))} == {
        "uncalibrated"
    }
    without = replace(GOOD, q_BS={s: q for s, q in GOOD.q_BS.items() if s != "forearm"})
    assert graded(without)["wrist"].grade == "none"
