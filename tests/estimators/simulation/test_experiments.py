"""The experiments of the papers' tables: as fast, as long and as closed as they say."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from handscope.estimators.data.fingertip_contacts import (
    FINGERTIPS,
    contact_points,
    contact_points_of,
)
from handscope.estimators.data.samples import ACC, GYR
from handscope.estimators.hand.anatomy import FINGERS, HANDS, IS_DOF, JOINT, JOINTS, LIMITS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.simulation import kinematics, person
from handscope.estimators.simulation.experiments import (
    EXPERIMENTS,
    KORTIER2,
    OTHERS,
    TABLE6,
    TABLE7,
    Experiment,
    PersonErrors,
    judged_samples,
    record_experiment,
)
from handscope.estimators.simulation.kinematics import Kinematics
from handscope.estimators.simulation.magnetic_field import office
from handscope.estimators.simulation.motion import COORDINATES
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.movements.grasp_postures import NATURAL
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors
from tests.schedule import swept
from tests.simulated import DEG

FAST = ("tapping", "open_close 116/min")
every_experiment = pytest.mark.parametrize("name", EXPERIMENTS)
every_contact = pytest.mark.parametrize("name", TABLE7)


@cache
def _somebody(hand: Hand) -> HandGeometry:
    return person.draw_person(hand, np.random.default_rng(8)).true


@cache
def _done(name: str, hand: Hand = "left") -> Performance:
    return EXPERIMENTS[name].perform(_somebody(hand), np.random.default_rng(3))[1]


@cache
def _moved(name: str, hand: Hand = "left") -> Kinematics:
    motion = _done(name, hand).motion
    return kinematics.compute_kinematics(
        motion, _somebody(hand), np.arange(0.0, motion.duration, 0.007)
    )


@cache
def _recorded(
    name: str,
    seed: int = 1,
    errors: SensorErrors = IDEAL,
    pose_error: float = 0.0,
    lengths: bool = True,
) -> Simulated:
    return record_experiment(
        EXPERIMENTS[name],
        np.random.default_rng(seed),
        errors,
        None,
        "left",
        person=PersonErrors(pose_deg=pose_error, lengths=lengths),
    )


def _within(k: Kinematics, name: str, values: np.ndarray) -> np.ndarray:
    return np.concatenate([values[(k.t >= e.onset) & (k.t <= e.end)] for e in _done(name).events])


def test_the_tables_have_all_rows_of_the_paper() -> None:
    assert set(TABLE6) == {"A-F1", "A-F2", "A-F3", "AF-F1", "AF-F2", "AF-F3", "F-F2", "F-F3"}
    assert {name: e.distance for name, e in TABLE7.items()} == {
        "P1 F1-F2": 0.030,
        "P2 F2-F3": 0.030,
        "P3 F1-F2": 0.0,
        "P4 F1-F2": 0.053,
        "P4 F1-F3": 0.046,
        "P4 F2-F3": 0.025,
    }


@pytest.mark.parametrize("name", [name for name in EXPERIMENTS if name not in (*FAST, *KORTIER2)])
def test_joints_turn_slower_than_two_radians_a_second(name: str) -> None:
    assert np.abs(_moved(name).rates).max() < 2.0


@pytest.mark.parametrize("name", TABLE6)
def test_ten_to_fifteen_repetitions_take_thirty_to_fifty_seconds(name: str) -> None:
    (event,) = _done(name).events
    k, finger = _moved(name), FINGERS.index(TABLE6[name].fingers[0])
    away = np.linalg.norm(
        _within(k, name, k.tips[:, finger]) - k.tips[np.searchsorted(k.t, event.onset), finger],
        axis=-1,
    )
    turns = np.flatnonzero(np.diff((away > 0.5 * away.max()).astype(int)) == 1)
    assert 10 <= len(turns) <= 15
    assert 30 <= event.duration <= 50


@pytest.mark.parametrize("name", TABLE6)
def test_only_the_finger_asked_for_moves(name: str) -> None:
    k = _moved(name)
    moved = np.ptp(_within(k, name, k.angles), axis=0).max(axis=-1) > 1e-9
    assert {JOINTS[j].name.split("_")[0] for j in np.flatnonzero(moved)} == set(
        TABLE6[name].fingers
    )


@pytest.mark.parametrize("name", ["A-F1", "A-F2", "A-F3"])
def test_pure_abduction_turns_about_one_axis_only(name: str) -> None:
    k = _moved(name)
    assert (np.ptp(_within(k, name, k.angles), axis=0) > 1e-9).sum() == 1


@every_contact
def test_contact_points_keep_their_distance_while_the_hand_moves_about(name: str) -> None:
    e, k = TABLE7[name], _moved(name)
    a, b = (
        contact_points(k.angles, _somebody("left"), f, point, FINGERTIPS[f])
        for f, point in e.contact
    )
    apart = _within(k, name, np.linalg.norm(a - b, axis=-1))
    np.testing.assert_allclose(apart, e.distance, atol=0.1e-3)
    wrist = _within(k, name, k.p[:, 0])
    assert (np.ptp(wrist, axis=0) > 0.05).all()
    assert 15 <= sum(event.duration for event in _done(name).events) <= 35


@every_contact
def test_the_hand_moves_about_above_the_desk(name: str) -> None:
    k, events = _moved(name), _done(name).events
    lifted = (k.t > events[0].onset + 2.0) & (k.t < events[-1].end - 2.0)
    assert k.p[lifted][..., 2].min() > 0.0


def test_a_pinch_is_closed_twice_and_opened_between() -> None:
    e, k = TABLE7["P3 F1-F2"], _moved("P3 F1-F2")
    first, second = _done("P3 F1-F2").events
    a, b = (
        contact_points(k.angles, _somebody("left"), f, point, FINGERTIPS[f])
        for f, point in e.contact
    )
    between = (k.t > first.end) & (k.t < second.onset)
    assert np.linalg.norm(a - b, axis=-1)[between].max() > 0.02


def test_the_block_is_one_performance_judged_three_ways() -> None:
    motions = [_done(name).motion.spline.c for name in TABLE7 if name.startswith("P4")]
    assert len(motions) == 3
    for c in motions[1:]:
        np.testing.assert_array_equal(c, motions[0])


@every_experiment
def test_joints_stay_within_the_permitted_ranges(name: str) -> None:
    angles = _moved(name).angles
    assert (angles >= LIMITS[..., 0] - 1e-9)[:, IS_DOF].all()
    assert (angles <= LIMITS[..., 1] + 1e-9)[:, IS_DOF].all()
    np.testing.assert_allclose(angles[:, ~IS_DOF], 0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["P1 F1-F2", "P2 F2-F3", "P3 F1-F2", "P4 F1-F3"])
@pytest.mark.parametrize("seed", swept(range(3), kept=[0]))
def test_no_grasp_leaves_the_natural_ranges_whoever_does_it(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = TABLE7[name].perform(person.draw_person("left", rng).true, rng)[1].motion
    angles = motion.at(np.arange(0.0, motion.duration, 0.1))[0][:, 6:].reshape(-1, len(JOINTS), 3)
    for joint, ranges in NATURAL.items():
        for a, (low, high) in enumerate(ranges):
            assert angles[:, JOINT[joint], a].min() > low * DEG - 1e-6
            assert angles[:, JOINT[joint], a].max() < high * DEG + 1e-6


@pytest.mark.parametrize("name", ["A-F1", "AF-F2", "P3 F1-F2", "P4 F1-F3", "free"])
def test_the_right_hand_is_the_left_ones_mirror_image(name: str) -> None:
    left, right = _moved(name, "left"), _moved(name, "right")
    np.testing.assert_allclose(right.angles, left.angles, atol=1e-12)
    np.testing.assert_allclose(right.tips, -left.tips, atol=1e-12)


@pytest.mark.parametrize("name", ["AF-F1", "P2 F2-F3", "free"])
def test_sensors_on_the_right_hand_read_the_mirror_image(name: str) -> None:
    left, right = (
        record_experiment(
            EXPERIMENTS[name],
            np.random.default_rng(6),
            IDEAL,
            None,
            hand,
            person=PersonErrors(pose_deg=2.5),
        ).samples["imu"]
        for hand in HANDS
    )
    np.testing.assert_allclose(
        right.of(GYR), left.of(GYR), atol=1e-9
    )  # rotations have the same components on both hands
    np.testing.assert_allclose(right.of(ACC), -left.of(ACC), atol=1e-8)


@pytest.mark.parametrize("name", ["AF-F1", "P1 F1-F2", "P3 F1-F2", "free"])
def test_velocities_are_those_of_the_places_however_the_motion_was_put_together(name: str) -> None:
    motion, dt = _done(name).motion, 1e-4
    for start in (0.25, 0.5, 0.75):
        k = kinematics.compute_kinematics(
            motion, _somebody("left"), start * motion.duration + np.arange(60) * dt
        )
        second = (k.p[2:] - 2 * k.p[1:-1] + k.p[:-2]) / dt**2
        np.testing.assert_allclose(second, k.a[1:-1], atol=1e-3)
        np.testing.assert_allclose(
            (k.angles[2:] - k.angles[:-2]) / (2 * dt), k.rates[1:-1], atol=1e-5
        )


@every_experiment
def test_every_performance_begins_and_ends_relaxed_and_has_a_task(name: str) -> None:
    performance = _done(name)
    x, dx, _ = performance.motion.at(np.array([0.0, performance.motion.duration]))
    np.testing.assert_allclose(x, np.tile(task_performance.relaxed(), (2, 1)), atol=1e-9)
    np.testing.assert_allclose(dx, 0.0, atol=1e-6)
    kinds = [e.trial_type for e in performance.events]
    assert "task" in kinds and set(kinds) <= {
        "task",
        "annotation",
    }  # annotations mark the phases of a task


def test_the_mechanical_finger_bends_joint_after_joint_and_its_dip_stays_at_ninety_degrees() -> (
    None
):
    (event,) = _done("mechanical finger").events
    x = _done("mechanical finger").motion.at(
        event.onset + np.array([30.0, 51.0, 76.0, 96.0, 111.0, 131.0, 139.0, 160.0])
    )[0]
    told = {
        joint: x[:, COORDINATES[f"index_{joint}_flexion"]] / DEG for joint in ("dip", "pip", "mcp")
    }
    np.testing.assert_allclose(told["dip"], [0, 90, 90, 90, 90, 90, 90, 0], atol=1e-9)
    np.testing.assert_allclose(told["pip"], [0, 0, 90, 90, 90, 0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(told["mcp"], [0, 0, 0, 90, 0, 0, 0, 0], atol=1e-9)


def test_the_hand_opens_and_closes_116_times_a_minute_by_80_degrees() -> None:
    (event,) = _done("open_close 116/min").events
    at = event.onset + np.arange(0.0, event.duration + 1e-9, 30 / 116)
    pip = _done("open_close 116/min").motion.at(at)[0][:, COORDINATES["index_pip_flexion"]] / DEG
    np.testing.assert_allclose(pip, np.resize([0.0, 80.0], len(at)), atol=1e-6)
    assert len(at) // 2 == 58  # in half a minute


def test_a_pose_error_is_in_the_motion_and_the_truth_but_not_in_what_is_told() -> None:
    exact, missed = _recorded("A-F2"), _recorded("A-F2", pose_error=2.5)
    pose = next(e for e in missed.events if e.trial_type == "initial_pose")
    assert pose == next(e for e in exact.events if e.trial_type == "initial_pose")
    off = missed.truth.angles - exact.truth.angles
    held = np.abs(off[(missed.truth.t > pose.onset) & (missed.truth.t < pose.end)])[:, IS_DOF] / DEG
    assert 2.0 < held.max() <= 2.5
    assert 0.8 < held.mean() < 1.7
    np.testing.assert_allclose(off[judged_samples(missed)][:, IS_DOF], 0.0, atol=1e-12)


def test_a_method_is_told_the_measured_lengths_and_the_mean_ratios() -> None:
    true, told = (_recorded("A-F2", lengths=flag).truth.tips[-1] for flag in (True, False))
    assert 0.5e-3 < np.linalg.norm(true - told, axis=-1).max() < 15e-3
    assert _recorded("A-F2").geometry == _recorded("A-F2", lengths=False).geometry


def _without(errors: SensorErrors) -> Callable[[Experiment], np.ndarray]:
    return lambda e: record_experiment(e, np.random.default_rng(5), errors, None).truth.tips


def test_switching_a_source_of_error_off_leaves_the_motion_as_it_was() -> None:
    e = OTHERS["circles"]
    np.testing.assert_array_equal(_without(IDEAL)(e), _without(SensorErrors())(e))
    with_field = record_experiment(
        e, np.random.default_rng(5), SensorErrors(), office(np.random.default_rng(0))
    )
    np.testing.assert_array_equal(
        with_field.samples["imu"].values,
        record_experiment(e, np.random.default_rng(5), SensorErrors(), None).samples["imu"].values,
    )


def test_a_seed_draws_the_same_person_pose_and_motion_and_another_one_another() -> None:
    a, b, c = (
        record_experiment(
            TABLE7["P1 F1-F2"],
            np.random.default_rng(s),
            SensorErrors(),
            None,
            person=PersonErrors(pose_deg=2.5),
        )
        for s in (4, 4, 5)
    )
    np.testing.assert_array_equal(a.samples["imu"].values, b.samples["imu"].values)
    assert a.geometry == b.geometry != c.geometry
    assert not np.array_equal(a.truth.tips[:500], c.truth.tips[:500])


def test_contact_points_of_a_trajectory_are_those_of_its_angles() -> None:
    made = _recorded("P2 F2-F3", lengths=False)
    for finger, point in TABLE7["P2 F2-F3"].contact:
        ours = contact_points_of(made.truth, made.geometry, finger, point, FINGERTIPS[finger])
        np.testing.assert_allclose(
            ours,
            contact_points(made.truth.angles, made.geometry, finger, point, FINGERTIPS[finger]),
            atol=1e-12,
        )


@pytest.mark.parametrize("name", ["brisk flexion", "brisk circles"])
def test_five_brisk_movements_take_a_second_each_and_only_the_index_moves(name: str) -> None:
    (event,) = _done(name).events
    k = _moved(name)
    assert 4.5 <= event.duration <= 7.0
    moved = np.ptp(_within(k, name, k.tips), axis=0).max(axis=-1)
    assert (
        moved[FINGERS.index("index")] > 0.03 > 0.01 > np.delete(moved, FINGERS.index("index")).max()
    )
    away = _within(k, name, k.tips[:, FINGERS.index("index")])[:, 0]
    assert (
        len(np.flatnonzero(np.diff((away > 0.5 * (away.min() + away.max())).astype(int)) == 1)) == 5
    )
