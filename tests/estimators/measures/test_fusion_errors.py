"""What errors of the pose, the sensors' mounting and the gyroscopes have become later: of angles and tips by m2."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.calibration import Calibration, SensorQuality
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.finger_ekf.filter import FilterParams
from handscope.estimators.hand import joint_angles, length_covariance
from handscope.estimators.hand import pose as hand_pose
from handscope.estimators.hand.anatomy import IS_DOF, JOINT, JOINTS, LIMITS, SEGMENTS
from handscope.estimators.hand.forward_kinematics import segments_on
from handscope.estimators.measures import fusion_errors
from handscope.estimators.measures.accuracy import accuracy_of, with_sd
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.validation.studies import honesty
from handscope.validation.studies.honesty import OTHER, Cell
from tests.estimators.finger_ekf.test_pose_inference import MOUNTING_SD, taken
from tests.estimators.measures.trajectories import made
from tests.schedule import swept
from tests.simulated import DEG

POSE_SD = 2.0 * DEG * IS_DOF
NOTHING_ELSE = FilterParams(
    skin=1e-3, acc_bias=0.0, inclination=0.0, bias_sd=1e-6, bias_walk=0.0, gyr_noise=1e-6
)


STILL = dict.fromkeys(SEGMENTS, SensorQuality(0.0, 0.0, 0.0, 0.0))


def _posed(rng: np.random.Generator) -> tuple[Calibration, Array, Array]:
    """As `taken`, held still."""
    calibration, missed, q_BS = taken(rng, MOUNTING_SD, POSE_SD)
    return replace(calibration, quality=STILL), missed, q_BS


def _moved(
    calibration: Calibration, missed: Array, q_BS: Array, true: Array
) -> tuple[Trajectory, Array]:
    """What m2 makes of true angles (n, joints, 3) without any other error, and the true tips."""
    q_0 = segments_on(quat.IDENTITY, joint_angles.compose(missed))
    q = segments_on(quat.exp(0.4 * np.ones(3)), joint_angles.compose(true))
    seen = quat.multiply(q, q_BS)
    started = np.array([calibration.q_GS[s] for s in SEGMENTS])
    found = np.array([calibration.q_BS[s] for s in SEGMENTS])
    # each sensor's heading is what the pose made of it
    upright = quat.multiply(started, quat.conjugate(quat.multiply(q_0, q_BS)))
    q_GB = quat.multiply(quat.multiply(upright, seen), quat.conjugate(found))
    pose = hand_pose.pose_hand(
        hand_pose.joint_rotations(q_GB), q_GB, calibration.geometry, constraints=True
    )
    truth = hand_pose.pose_hand(joint_angles.compose(true), q, calibration.geometry, True)
    return made(len(true), pose.freedoms, pose.q_GS, pose.tips, rate=5.0), truth.tips


@pytest.mark.parametrize("people", swept([15, 40], kept=[15]))
def test_angles_and_tips_err_as_pose_and_mounting_make_them(
    people: int, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """People in thirty postures each, every heading with an error of its own."""
    monkeypatch.setattr(fusion_errors, "PARAMS", NOTHING_ELSE)
    monkeypatch.setattr(
        length_covariance, "covariance", lambda geometry, sd, found: np.zeros((5, 6, 6))
    )
    monkeypatch.setattr(length_covariance, "of_palm", lambda geometry: np.zeros((5, 6, 6)))
    angles, tips = [], []
    low, high = 0.4 * LIMITS[..., 0], 0.4 * LIMITS[..., 1]
    for _ in range(people):
        calibration, missed, q_BS = _posed(rng)
        true = rng.uniform(low, high, (30, len(JOINTS), 3))
        moved, true_tips = _moved(calibration, missed, q_BS, true)
        angles_sd, tips_sd = fusion_errors.deviations(moved, calibration)
        angles.append(np.nanmean(((moved.angles - true) / angles_sd) ** 2))
        tips.append(np.mean(((moved.tips - true_tips) / tips_sd) ** 2))
    assert 0.75 < np.mean(angles) < 1.25
    assert 0.75 < np.mean(tips) < 1.25


def test_a_heading_drifts_with_time(rng: np.random.Generator) -> None:
    """A bias of 0.01 deg/s makes at least 6 deg in ten minutes, in a joint that turns about the vertical."""
    calibration, missed, q_BS = _posed(rng)
    moved, _ = _moved(calibration, missed, q_BS, np.zeros((2, len(JOINTS), 3)))
    later = replace(moved, t=np.array([5.0, 605.0]))
    sd = fusion_errors.deviations(later, calibration)[0][:, JOINT["thumb_cmc"]]
    assert np.sqrt(sd[1] ** 2 - sd[0] ** 2).max() > 6 * DEG


def test_what_was_measured_in_the_pose_is_more_certain(rng: np.random.Generator) -> None:
    calibration, missed, q_BS = _posed(rng)
    moved, _ = _moved(calibration, missed, q_BS, np.zeros((1, len(JOINTS), 3)))
    known = replace(calibration, pose_sd={"index_mcp": (np.nan, 0.7 * DEG, np.nan)})
    plain, measured = (
        fusion_errors.deviations(moved, c)[0][0, JOINT["index_mcp"], 1]
        for c in (calibration, known)
    )
    assert measured < 0.75 * plain


def test_what_is_known_without_a_sensor_on_the_forearm_has_its_error_bars(
    rng: np.random.Generator,
) -> None:
    calibration, missed, q_BS = _posed(rng)
    whole, _ = _moved(calibration, missed, q_BS, np.zeros((2, len(JOINTS), 3)))
    moved = replace(whole, angles=whole.angles.copy(), q_GS=whole.q_GS.copy())
    moved.angles[:, JOINT["wrist"]] = moved.q_GS[:, SEGMENTS.index("forearm")] = np.nan
    fewer = {s: q for s, q in calibration.q_GS.items() if s != "forearm"}
    angles_sd, tips_sd = fusion_errors.deviations(moved, replace(calibration, q_GS=fewer))
    assert np.isfinite(tips_sd).all()
    assert np.array_equal(np.isnan(angles_sd), np.isnan(moved.angles))


@pytest.mark.parametrize(
    ("world", "experiment"),
    [
        ("as believed", "free"),
        pytest.param("misalignment x 2", "free", marks=pytest.mark.slow),
        pytest.param("as believed", OTHER, marks=pytest.mark.slow),
        pytest.param("misalignment x 2", OTHER, marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("people", swept([1, 3], kept=[1]))
def test_error_bars_of_m2_are_as_large_as_its_errors(
    world: str, experiment: str, people: int
) -> None:
    found = [honesty.measure(Cell(world, experiment, seed)) for seed in range(300, 300 + people)]
    for column in ("NEES angles", "NEES tips"):
        assert 0.3 < np.mean([f[f"m2, {column}"] for f in found]) < 2.0


def test_a_pose_before_which_there_is_no_sample_changes_nothing(rng: np.random.Generator) -> None:
    calibration, missed, q_BS = _posed(rng)
    moved, _ = _moved(calibration, missed, q_BS, np.zeros((3, len(JOINTS), 3)))
    again = replace(calibration, t=-1.0)
    known, _ = with_sd(moved, accuracy_of("m2", [replace(calibration, t=-2.0), again]))
    np.testing.assert_array_equal(
        known.tips_sd, with_sd(moved, accuracy_of("m2", [again]))[0].tips_sd
    )


def test_error_bars_change_nothing_of_the_movement(rng: np.random.Generator) -> None:
    calibration, missed, q_BS = _posed(rng)
    moved, _ = _moved(calibration, missed, q_BS, np.zeros((40, len(JOINTS), 3)))
    known, basis = with_sd(moved, accuracy_of("m2", [calibration]))
    assert (known.angles is moved.angles) and (known.tips is moved.tips)
    assert np.array_equal(np.isnan(known.angles_sd), np.isnan(moved.angles))
    assert "initial pose" in basis
    whole, halves = (
        known,
        [
            with_sd(moved.between(a, b), accuracy_of("m2", [calibration]))[0]
            for a, b in ((-1, 4), (4, 9))
        ],
    )
    np.testing.assert_array_equal(whole.tips_sd, np.concatenate([h.tips_sd for h in halves]))
