"""Sensors put on anyhow, from the steps to joint angles: alone, by process, with steps missing, on
either hand."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handscope.estimators.alignment import functional_calibration, initial_pose
from handscope.estimators.alignment.functional_movements import STEPS
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import FINGERS, HANDS, JOINT, SEGMENTS, Hand
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import m2
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.movements import functional_calibration as functional
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.movements.functional_calibration import Carelessness
from handscope.estimators.simulation.scenario import InertialGlove, Simulated, simulate_performances
from tests.estimators.alignment.functional import (
    ANYHOW,
    PERFECT,
    TURNED,
    done,
    errors_of,
    pieces,
    posed,
)
from tests.simulated import DEG

PARAMS = m2.Params(gyr_reading="instant")
# deg: our targets for slow and fast tasks
MAIN = {  # the angles that a task moves: joints and which of their angles
    "rom_fist": ([(f"{f}_{j}", 0) for f in FINGERS[1:] for j in ("mcp", "pip", "dip")], 3.0),
    "rom_spread": ([(f"{f}_mcp", 1) for f in FINGERS[1:]], 3.0),
    "rom_thumb": (
        [("thumb_mcp", 0), ("thumb_ip", 0), ("thumb_cmc", 0), ("thumb_cmc", 1), ("thumb_cmc", 2)],
        3.0,
    ),
    "tapping": (
        [(f"index_{j}", 0) for j in ("mcp", "pip", "dip")] + [("thumb_mcp", 0), ("thumb_ip", 0)],
        5.0,
    ),
}


def _combined(recording: Simulated, *without: str):
    kept = {step: p for step, p in pieces(recording).items() if step not in without}
    return functional_calibration.combine(PARAMS, kept, posed(recording), recording.mounting)


@cache
def _estimated(hand: Hand) -> Trajectory:
    """Of all tasks after the steps."""
    return process(m2, PARAMS, done(hand, after=True)).trajectory


def _without(recording: Simulated, *steps: str) -> Simulated:
    return replace(
        recording, events=tuple(e for e in recording.events if e.trial_type not in steps)
    )


@pytest.mark.parametrize("hand", HANDS)
def test_axes_of_sensors_put_on_anyhow_are_found_within_two_degrees(hand: Hand) -> None:
    recording = done(hand)
    found = _combined(recording)
    errors = errors_of(recording, found)
    assert set(found.q_BS_sd) == set(SEGMENTS)
    # where z points
    assert max(np.linalg.norm(e[:2]) for s, e in errors.items() if s != "forearm") < 3 * DEG
    assert np.sqrt(np.mean([e[:2] ** 2 for s, e in errors.items() if s != "forearm"])) < 1.2 * DEG
    alone = errors_of(recording, posed(recording))
    # what the pose alone leaves
    assert np.sqrt(np.mean([e[:2] ** 2 for e in alone.values()])) > 5 * DEG


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("task", MAIN)
def test_main_angles_meet_their_targets(hand: Hand, task: str) -> None:
    recording = done(hand, after=True)
    moved = _estimated(hand)
    event = next(e for e in recording.events if e.details.get("task_name") == task)
    inside = (moved.t >= event.onset) & (moved.t <= event.end)
    error = moved.angles[inside] - recording.truth.angles[inside]
    angles, target = MAIN[task]
    assert np.sqrt(np.mean([error[:, JOINT[j], a] ** 2 for j, a in angles])) < target * DEG


def test_a_recording_of_the_right_hand_gives_what_its_mirror_image_of_the_left_does() -> None:
    left, right = (_combined(done(hand, errors=TURNED)) for hand in HANDS)
    for segment, q_BS in left.q_BS.items():
        assert quat.angle(quat.relative(q_BS, right.q_BS[segment])) < 0.1 * DEG


@pytest.mark.slow
def test_a_sensor_on_its_head_is_no_different() -> None:
    """Nominal mounting not known at all: turned by 180 and 90 deg, and nobody says so."""
    recording = done("left")
    turned = {
        "index_middle": quat.about(0, np.pi),
        "ring_distal": quat.about(1, np.pi / 2),
        "little_proximal": quat.about(2, 2.0),
    }
    imu = recording.samples["imu"]
    values = imu.values.copy()
    for segment, q in turned.items():
        k = imu.stream.sensors.index(segment)
        for axes in (slice(0, 3), slice(3, 6)):
            values[:, k, axes] = quat.rotate(q, values[:, k, axes])
    upset = replace(recording, samples={"imu": replace(imu, values=values)})
    plain, found = _combined(recording), _combined(upset)
    for segment, q in turned.items():
        there = quat.multiply(found.q_BS[segment], q)
        assert quat.angle(quat.relative(plain.q_BS[segment], there)) < 1 * DEG
    warnings = process(m2, PARAMS, upset)
    assert not [f for f in warnings.findings if f.kind == "turned"]
    assert [
        f for f in process(m2, m2.Params(functional=False), upset).findings if f.kind == "turned"
    ]


def test_steps_in_a_recording_are_used_by_themselves() -> None:
    recording = done("right")
    with_steps, alone = (
        process(m2, PARAMS, recording),
        process(m2, m2.Params(gyr_reading="instant", functional=False), recording),
    )
    assert with_steps.calibrations[0].description == "initial pose and functional calibration"
    assert set(with_steps.calibrations[0].steps) == set(STEPS)
    assert with_steps.warnings == ()
    rms = [
        np.sqrt(np.nanmean((p.trajectory.angles - recording.truth.angles) ** 2))
        for p in (with_steps, alone)
    ]
    assert rms[0] < 0.5 * rms[1]


def test_the_papers_own_alignment_does_not_use_them() -> None:
    done_so = process(m2, m2.Params(alignment="heading"), done("left"))
    assert done_so.calibrations[0].description == "initial pose"


def test_without_the_figure_of_eight_a_hand_that_rested_points_as_mounted_and_this_is_said() -> (
    None
):
    recording = done("left", care=Carelessness(joints=0.0, hand=0.0))
    found = _combined(recording, "figure_eight")
    assert any(w.startswith("hand: which way its sensor points") for w in found.warnings)
    assert any(
        w.startswith("forearm: no functional") and "figure of eight" in w for w in found.warnings
    )
    assert "forearm" not in found.q_BS_sd
    off = abs(errors_of(recording, found)["hand"][0])
    # the knuckles pull the skin under a hand that rests: that is no movement of the hand
    assert off < 2 * found.q_BS_sd["hand"][0]


def test_without_the_figure_of_eight_a_hand_that_swayed_has_told_enough() -> None:
    recording = done("left")
    found = _combined(recording, "figure_eight")
    assert set(found.q_BS_sd) == set(SEGMENTS)
    assert any("steps not done: figure of eight; what the others tell" in w for w in found.warnings)
    for segment, error in errors_of(recording, found).items():
        assert abs(error[0]) < 4 * found.q_BS_sd[segment][0]


def test_a_sensor_that_slips_between_two_steps_is_named() -> None:
    recording = done("left")
    mcp, imu = (
        next(e for e in recording.events if e.trial_type == "flexion_mcp"),
        recording.samples["imu"],
    )
    values, before = imu.values.copy(), imu.t < mcp.end
    k = imu.stream.sensors.index("index_middle")
    for axes in (slice(0, 3), slice(3, 6)):
        values[before, k, axes] = quat.rotate(
            quat.exp(np.array([0.0, 0.5, 0.0])), values[before, k, axes]
        )
    found = _combined(replace(recording, samples={"imu": replace(imu, values=values)}))
    assert any(
        w.startswith("index_middle: the steps") and "contradict each other; repeat them" in w
        for w in found.warnings
    )


def test_without_the_thumbs_steps_its_posture_comes_from_the_initial_pose() -> None:
    recording = done("left")
    found = _combined(recording, "thumb_flat", "flexion_thumb_ip")
    assert any(
        "steps not done: flat thumb, flexion of the thumb's last joint" in w for w in found.warnings
    )
    assert np.linalg.norm(errors_of(recording, found)["thumb_distal"][:2]) < 4 * DEG


def test_a_flat_hand_alone_changes_nothing() -> None:
    recording = done("left")
    pose = posed(recording)
    kept = {"flat_hand": pieces(recording)["flat_hand"]}
    assert functional_calibration.combine(PARAMS, kept, pose, {}) is pose
    assert functional_calibration.combine(PARAMS, {}, pose, {}) is pose


def test_a_step_may_be_repeated_and_the_last_good_one_counts() -> None:
    recording = done("left")
    mcp = next(e for e in recording.events if e.trial_type == "flexion_mcp")
    bad = replace(
        mcp,
        onset=next(
            e for e in recording.events if e.trial_type == "rest" or e.trial_type == "thumb_flat"
        ).onset,
    )
    both = replace(recording, events=(*recording.events, bad))
    assert pieces(both)["flexion_mcp"].onset == mcp.onset
    assert process(m2, PARAMS, both).warnings == ()
    only_bad = replace(
        _without(recording, "flexion_mcp"), events=(*_without(recording, "flexion_mcp").events, bad)
    )
    warnings = process(m2, PARAMS, only_bad).warnings
    assert any("MCP flexion" in w and "repeat it" in w for w in warnings)
    assert any("steps not done: MCP flexion" in w for w in warnings)


def test_without_an_initial_pose_the_flat_hand_serves() -> None:
    recording = _without(done("left"), "initial_pose")
    found = process(m2, PARAMS, recording)
    assert found.calibrations[0].description == "initial pose and functional calibration"
    assert any("its flat hand serves as that" in w for w in found.warnings)


def test_steps_of_another_recording_seat_the_sensors_in_this_one() -> None:
    whole = done("left", after=True)
    bare = _without(whole, *STEPS)
    found = process(m2, PARAMS, bare, done("left", after=True))
    true = whole.truth.angles
    alone = process(m2, PARAMS, bare)
    rms = [np.sqrt(np.nanmean((p.trajectory.angles - true) ** 2)) for p in (found, alone)]
    assert rms[0] < 0.5 * rms[1]


def test_magnetic_north_turns_with_the_headings() -> None:
    """The field in the global frame, as a sensor saw it in the pose, lies where the new heading
    puts it."""
    pose = posed(done("left"))
    field_S = {s: np.array([0.3, 0.7, -0.4]) for s in pose.q_GS}

    def north(c, segment: str) -> float:
        x, y, _ = quat.rotate(c.q_GS[segment], field_S[segment])
        return float(np.arctan2(x, y))

    pose = replace(pose, north={s: north(pose, s) for s in pose.q_GS})
    found = functional_calibration.apply_mounting(pose, _combined(done("left")).q_BS)
    for segment in found.q_GS:
        assert np.isclose(np.cos(found.north[segment] - north(found, segment)), 1.0, atol=1e-9)


def test_a_perfect_calibration_sees_the_pose_as_it_was_held() -> None:
    recording = done("left", errors=TURNED, care=PERFECT)
    found = _combined(recording)
    k = int(np.searchsorted(recording.truth.t, found.t))
    for s, segment in enumerate(SEGMENTS):
        q_GB = quat.multiply(found.q_GS[segment], quat.conjugate(found.q_BS[segment]))
        assert quat.angle(quat.relative(recording.truth.q_GS[k, s], q_GB)) < 0.3 * DEG
    assert initial_pose.pose_of(recording.events[0]).duration > 2.9


def test_a_glove_with_two_strips_and_a_forearm_of_another_rate_is_calibrated() -> None:
    worn = tuple(
        s for s in SEGMENTS if s in ("hand", "forearm") or s.startswith(("index", "thumb"))
    )
    g = sized("right")
    rng = np.random.default_rng(8)
    performances = [task_performance.initial_pose(g), *functional.all_steps(g, rng)]
    recording = simulate_performances(
        performances, "right", g, rng, ANYHOW, glove=InertialGlove(segments=worn, forearm_rate=60.0)
    )
    found = process(m2, PARAMS, recording).calibrations[0]
    assert set(found.q_BS_sd) == set(worn)
    assert (
        max(np.linalg.norm(e[:2]) for s, e in errors_of(recording, found).items() if s != "forearm")
        < 4 * DEG
    )


@pytest.mark.slow
def test_even_the_hands_sensor_may_sit_in_any_way() -> None:
    recording = done("left")
    imu = recording.samples["imu"]
    values = imu.values.copy()
    for segment, turn in {
        "hand": [0.3, 2.8, 0.4],
        "thumb_metacarpal": [2.0, 0.0, 0.0],
        "forearm": [0.0, 0.0, 3.0],
    }.items():
        k = imu.stream.sensors.index(segment)
        for axes in (slice(0, 3), slice(3, 6)):
            values[:, k, axes] = quat.rotate(quat.exp(np.array(turn)), values[:, k, axes])
    anyhow = process(m2, PARAMS, replace(recording, samples={"imu": replace(imu, values=values)}))
    np.testing.assert_allclose(
        anyhow.trajectory.angles, process(m2, PARAMS, recording).trajectory.angles, atol=0.1 * DEG
    )
    assert anyhow.warnings == ()
