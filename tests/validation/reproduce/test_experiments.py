"""Trials: what is switched off is off, what is not stays as it was, what has no errors is recovered."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.data.fingertip_contacts import FINGERTIPS, contact_points_of
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGER_JOINTS, JOINT
from handscope.estimators.simulation.experiments import TABLE7
from handscope.estimators.simulation.sensors import IDEAL
from handscope.validation.papers import mechanical_finger, table6, table7
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.accuracy import angle_errors, distance_rmse, rms, tip_rmse
from handscope.validation.reproduce.experiments import (
    VARIANTS,
    Trial,
    estimated,
    in_either_field,
    performed,
)
from handscope.validation.studies import budget, drift

DEG = np.pi / 180


def test_without_any_error_the_truth_is_recovered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(
        VARIANTS, "m2", ("m2", {"gyr_reading": "instant"})
    )  # as the simulated gyroscopes read
    estimate, truth = estimated(
        performed(Trial("AF-F2", 0), IDEAL, pose_error=0.0, length_errors=False), "m2"
    )
    assert tip_rmse(estimate, truth, ["index"]) < 2e-4  # m
    assert rms(angle_errors(estimate, truth, FINGER_JOINTS["index"])) < 0.1 * DEG


def test_the_true_hand_holds_what_it_holds() -> None:
    recording = performed(Trial("P1 F1-F2", 1), IDEAL, pose_error=0.0, length_errors=False)
    _, truth = estimated(recording, "m2")
    a, b = (
        contact_points_of(truth, recording.geometry, f, point, FINGERTIPS[f])
        for f, point in TABLE7["P1 F1-F2"].contact
    )
    assert distance_rmse(a, b, 0.03) < 1e-4  # m


def test_either_field_is_around_the_same_person_with_the_same_movement() -> None:
    near, far = in_either_field(Trial("P2 F2-F3", 2))
    np.testing.assert_array_equal(near.truth.q_GS, far.truth.q_GS)
    np.testing.assert_array_equal(near.samples["imu"].values, far.samples["imu"].values)
    assert np.abs(near.samples["mag"].values - far.samples["mag"].values).max() > 1e-6  # T


def test_a_budget_switches_off_one_source_and_leaves_the_others() -> None:
    variants = budget._variants()
    full, silent = variants["no source off"], variants["no source alone"]
    assert len(variants) == 2 + 2 * len(budget.SOURCES)
    assert variants["soft tissue off"].errors == replace(
        full.errors, skin_angle=0.0, skin_shift=0.0
    )
    assert variants["soft tissue alone"].errors == replace(
        silent.errors, skin_angle=2.0, skin_shift=1.0
    )
    assert (silent.pose_error, silent.wrist_error, silent.lengths) == (0.0, 0.0, False)
    assert (silent.errors.misalignment, silent.errors.gyr_noise) == (0.0, 0.0)
    assert variants["initial pose missed by the fingers alone"] == replace(
        silent, pose_error=full.pose_error
    )
    assert variants["initial pose missed by the wrist off"] == replace(full, wrist_error=0.0)


def test_table_6_judges_the_experiments_asked_for() -> None:
    wanted = Wanted(seeds=2, experiments=("A-F2", "F-F3"))
    assert [(t.experiment, t.seed) for t in table6.trials(wanted)] == [
        ("A-F2", 0),
        ("A-F2", 1),
        ("F-F3", 0),
        ("F-F3", 1),
    ]
    with pytest.raises(InputError, match=r"no experiment 'A-F9'; experiments are A-F1, "):
        table6.trials(Wanted(experiments=("A-F9",)))


def test_the_pairs_of_the_block_are_judged_on_one_recording() -> None:
    assert [t.experiment for t in table7.trials(Wanted(seeds=1))] == [
        "P1 F1-F2",
        "P2 F2-F3",
        "P3 F1-F2",
        "P4 F1-F2",
    ]
    assert [t.experiment for t in table7.trials(Wanted(seeds=1, experiments=("P4 F2-F3",)))] == [
        "P4 F1-F2"
    ]


def test_a_joint_deviates_only_while_it_stays_and_another_moves() -> None:
    t = np.arange(300) / 100
    angles = np.zeros((300, 16, 3))
    mcp, pip, dip = (mechanical_finger.JOINT[j] for j in mechanical_finger.JOINTS)
    angles[:, dip, 0] = np.clip(t - 1, 0, 1)  # moves from 1 to 2 s
    truth = Trajectory(
        "left",
        t,
        angles,
        np.zeros((300, 17, 4)),
        np.zeros((300, 5, 3)),
        np.zeros((300, 17), np.uint8),
    )
    wrong = angles.copy()
    wrong[t < 0.9, mcp, 0] = 1.0  # nothing moves: does not count
    wrong[150, pip, 0] = -0.2
    wrong[150, dip, 0] += 0.5  # moves itself: does not count
    rates_of = Trajectory("left", t, wrong, truth.q_GS, truth.tips, truth.flags)
    with pytest.raises(ValueError, match="zero-size"):
        mechanical_finger.held_deviation(
            rates_of, truth
        )  # the end joint never stays while another moves
    angles[200:, pip, 0] = np.clip(t[200:] - 2, 0, 1)
    wrong[200:, pip, 0] = angles[200:, pip, 0]
    wrong[250, dip, 0] += 0.3
    np.testing.assert_allclose(
        mechanical_finger.held_deviation(rates_of, truth), [0.0, 0.2, 0.3], atol=1e-9
    )


def test_drift_begins_small_and_is_measured_minute_by_minute(tmp_path: Path) -> None:
    courses = drift.measure(drift.Trial(0, "pauses", 1))
    assert set(courses) == {f"{name}, pauses" for name in drift.VARIANTS}
    for course in courses.values():
        assert course.angles.shape == course.tips.shape == (1,)
        assert 0.1 < course.angles[0] < 10.0  # deg
        assert 0.05 < course.tips[0] < 3.0  # cm


def test_the_wrist_misses_the_pose_alone_where_it_is_told_to() -> None:
    missed = [
        performed(Trial("A-F2", 0), IDEAL, pose_error=pose, length_errors=False, wrist_error=wrist)
        for pose, wrist in ((0.0, 2.5), (2.5, 0.0))
    ]
    for made, wrist_off in zip(missed, (True, False)):
        pose = next(e for e in made.events if e.trial_type == "initial_pose")
        held = made.truth.between(pose.onset, pose.end).angles.mean(axis=0)
        assert bool(np.abs(held[JOINT["wrist"], :2]).max() > 0.01 * DEG) is wrist_off
        assert bool(np.abs(held[JOINT["index_pip"], 0]) > 0.01 * DEG) is not wrist_off
