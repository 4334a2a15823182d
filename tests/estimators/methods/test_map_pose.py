"""The initial pose tells `map` how the sensors of hand, forearm and last phalanges sit, which no movement shows."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handscope.estimators.alignment import initial_pose
from handscope.estimators.alignment.initial_pose import Pose
from handscope.estimators.data.calibration import Calibration, CalibrationSource
from handscope.estimators.data.events import Event
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, IS_DOF, JOINT, SEGMENT, SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import BATCH, map_contacts, map_pose
from handscope.estimators.methods.map_pose import PoseSeen
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import process
from handscope.estimators.self_calibration.result import Finger
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.scenario import Simulated, simulate_performances
from handscope.estimators.simulation.sensors import IDEAL
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator.free_movement import DEG, Setup
from tests.estimators.methods.solved_hands import PARAMS, SD, calibrated, solved, turned

GEOMETRY = sized("left")
POSE = Pose(0.0, 3.0)
MISSED = np.radians(2.5)
FIRST = {"thumb": "thumb_cmc", "forearm": "wrist"} | {f: f"{f}_mcp" for f in FINGERS[1:]}


def held(missed: Array) -> Trajectory:
    """A hand that is held still, palm down, its joints away from the pose by `missed` (joints, 3) rad."""
    t = np.arange(0.0, 4.0, 0.05)
    q_pc = joint_angles.compose(np.where(IS_DOF, missed, 0.0))
    q_GS = forward_kinematics.segments_on(initial_pose.palm_down("left"), q_pc)
    every = np.tile(q_GS, (len(t), 1, 1))
    angles, tips = np.zeros((len(t), *IS_DOF.shape)), np.zeros((len(t), len(FINGERS), 3))
    return Trajectory("left", t, angles, every, tips, np.zeros(every.shape[:2], np.uint8))


def asked(pose: Pose = POSE) -> Calibration:
    """What the pose was to be."""
    on_hand = initial_pose.segments_in_pose(pose)
    return replace(
        calibrated(GEOMETRY),
        t=pose.onset,
        end=pose.end,
        q_GS=on_hand,
        q_BS=dict.fromkeys(on_hand, quat.IDENTITY),
        source=CalibrationSource.POSE,
        pose_sd=pose.sd,
    )


def seen(moved: Trajectory, pose: Pose = POSE, drift: float = 0.0) -> PoseSeen:
    """As the movement shows it."""
    return PoseSeen(asked(pose), moved.q_GS[0], drift)


def told(moved: Trajectory, pose: PoseSeen | None = None) -> dict[str, Finger]:
    found = map_contacts.apply(
        PARAMS, moved, calibrated(GEOMETRY), solved(moved), [], pose or seen(moved)
    )
    return {f.name: f for f in found.fingers}


def left(found: dict[str, Finger], hand: Array, forearm: Array) -> tuple[Array, Array]:
    """Errors of the mountings of hand and forearm (6,), and what is told of them."""
    of = found["forearm"]
    off = [
        quat.log(quat.multiply(of.segments.q_BS[s], quat.exp(-turn)))
        for s, turn in (("hand", hand), ("forearm", forearm))
    ]
    return np.concatenate(off), np.concatenate([of.sure.q_BS[s] for s in ("hand", "forearm")])


def test_a_pose_tells_how_the_sensors_of_hand_and_forearm_sit() -> None:
    """Missed by 2.5 deg in every freedom: four fingers tell the hand's sensor, and the wrist hangs on it."""
    rng, errors, sds, last = np.random.default_rng(30), [], [], []
    for _ in range(24):
        hand, forearm = SD * rng.normal(size=(2, 3))
        tips = dict(zip(FINGERS, SD * rng.normal(size=len(FINGERS))))
        truth = held(MISSED * rng.normal(size=(len(JOINT), 3)))
        found = told(turned(truth, hand, tips, forearm))
        off, sd = left(found, hand, forearm)
        errors.append(off)
        sds.append(sd)
        last.append([found[f].segments.q_BS[CHAINS[f][-1]][3] * 2 - a for f, a in tips.items()])
    rms = np.degrees(np.sqrt(np.mean(np.square(errors), axis=0)))
    assert rms[:3].max() < 2.0 and rms[3:].max() < 3.5
    assert np.degrees(np.sqrt(np.mean(np.square(last)))) < 3.3
    missed = [0, 2, 3, 5]  # flexion and deviation; no joint of this hand is twisted
    assert 0.5 < np.mean(np.square(np.divide(errors, sds)[:, missed])) < 1.5


def test_angles_are_as_much_surer_as_the_pose_makes_the_mounting() -> None:
    moved = turned(held(np.zeros((len(JOINT), 3))), SD * np.ones(3), {})
    for before in solved(moved):
        after, j = told(moved)[before.name], JOINT[FIRST[before.name]]
        assert (after.sure.angles[:, j, 0] < 0.7 * before.sure.angles[:, j, 0]).all()


def test_who_bends_the_joints_that_movement_shows_is_not_believed_of_the_others() -> None:
    """PIP joints are seen: how far they miss the pose tells how exactly it was taken."""
    exact, bent = (np.zeros((len(JOINT), 3)) for _ in range(2))
    bent[[JOINT[f"{f}_pip"] for f in FINGERS[1:]], 0] = np.radians([6.0, -5.0, 7.0, -6.0])
    believed, doubted = (told(held(m))["forearm"].sure.q_BS["forearm"][2] for m in (exact, bent))
    assert doubted > 1.5 * believed


def test_an_angle_that_was_measured_in_the_pose_counts_as_exactly() -> None:
    spread = {"index_mcp": (0.0, 0.15, 0.0), "ring_mcp": (0.0, -0.1, 0.0)}
    sd = dict.fromkeys(spread, (np.nan, np.radians(0.7), np.nan))
    missed = np.zeros((len(JOINT), 3))
    for joint, angles in spread.items():
        missed[JOINT[joint]] = angles
    hand = np.radians([4.0, 0.0, 0.0])
    moved = turned(held(missed), hand, {})
    found = told(moved, seen(moved, replace(POSE, measured=spread, sd=sd)))
    off, sds = left(found, hand, np.zeros(3))
    assert np.degrees(abs(off[0])) < 0.5 and np.degrees(sds[0]) < 0.7


@pytest.mark.parametrize("axis", [0, 2])
def test_headings_walk_between_the_stretch_and_the_pose(axis: int) -> None:
    """Palm down, the hand's x points up: what fingers deviate by is less sure."""
    moved = held(np.zeros((len(JOINT), 3)))
    within, outside = (
        told(moved, seen(moved, drift=d))["index"].sure.q_BS["hand"] for d in (0.0, 0.05)
    )
    assert (outside[axis] > 1.1 * within[axis]) == (axis == 0)


def test_of_a_last_sensor_that_was_silent_in_the_pose_nothing_is_told() -> None:
    moved = held(np.zeros((len(JOINT), 3)))
    moved.q_GS[:, SEGMENT["ring_distal"]] = np.nan
    before, after = {f.name: f for f in solved(moved)}["ring"], told(moved)["ring"]
    kept, told_of = (f.sure.q_BS["ring_distal"][2] for f in (before, after))
    assert told_of == pytest.approx(kept)
    assert (after.sure.q_BS["hand"] < 0.5 * before.sure.q_BS["hand"]).all()


@cache
def posed_twice() -> Simulated:
    """A hand that taps between two poses."""
    pose = task_performance.initial_pose(GEOMETRY)
    performances = (pose, task_performance.tapping(GEOMETRY), pose)
    rng = np.random.default_rng(4)
    return simulate_performances(performances, "left", GEOMETRY, rng, IDEAL)


def poses() -> list[Event]:
    """Their events."""
    return [e for e in posed_twice().events if e.trial_type == "initial_pose"]


def found_pose(
    events: Sequence[Event],
    start: float = 20.0,
    length: float = 2.0,
    sway: float = 0.0,
    hand: Array = quat.IDENTITY,
) -> tuple[PoseSeen | None, list[str]]:
    """Of that recording with these events, with a stretch of some seconds from `start` that was found exactly, all sensors swaying by so much (rad/s), the hand's believed to sit so."""
    recording, truth = posed_twice(), posed_twice().truth
    block = recording.samples["imu"]
    values = block.values.copy()
    values[:, :, 0] += sway * np.sin(2 * block.t)[:, None]
    samples = {**recording.samples, "imu": replace(block, values=values)}
    recording = replace(recording, events=tuple(events), samples=samples)
    rows = truth.between(start, start + length)
    calibration = replace(
        calibrated(GEOMETRY),
        stretch=(float(rows.t[0]), float(rows.t[-1])),
        q_BS={**dict.fromkeys(SEGMENTS, quat.IDENTITY), "hand": hand},
        gyr_bias=dict.fromkeys(SEGMENTS, np.zeros(3)),
    )
    chains = {**CHAINS, "forearm": ("forearm",)}
    fingers = [
        replace(f, t=rows.t, solution=exactly(rows, ("hand", *chains[f.name])))
        for f in solved(truth)
    ]
    return map_pose.find_pose(PARAMS, recording, truth, calibration, fingers)


def exactly(rows: Trajectory, sensors: tuple[str, ...]) -> Any:
    """A solution of which only the sensors' orientations are looked at."""
    q_GS = rows.q_GS[:, [SEGMENT[s] for s in sensors]]
    chain = SimpleNamespace(sensors=sensors)
    return SimpleNamespace(at=SimpleNamespace(q_GS=q_GS), problem=SimpleNamespace(chain=chain))


@pytest.mark.parametrize("which", [0, 1])
def test_the_pose_nearest_to_the_movement_is_tracked_from_it(which: int) -> None:
    """Backwards to the pose before it, forwards to the one behind it; headings walk by 0.35 deg a root of a second."""
    at = poses()[which]
    pose, refused = found_pose(poses(), at.end + 2.0 if which == 0 else at.onset - 6.0)
    assert pose is not None and not refused
    assert at.onset - 0.1 <= pose.asked.t < pose.asked.end <= at.end + 0.1
    truth = posed_twice().truth.between(pose.asked.t, pose.asked.end)
    off = quat.log(quat.relative(pose.q_GS, truth.q_GS[0]))
    assert np.degrees(np.abs(off - off[SEGMENT["hand"]])).max() < 1.0
    assert 0.35 < np.degrees(pose.drift) < 1.5


def test_tracking_does_not_hide_that_the_hands_sensor_sits_askew() -> None:
    """A hand that is believed turned about the fingers twists their first joints, which cannot be: so it is seen."""
    at, turn = poses()[0], np.array([0.0, 0.14, 0.0])
    pose, _ = found_pose(poses(), at.end + 4.0, hand=quat.exp(turn))
    assert pose is not None
    twisted = joint_angles.of_segments(pose.q_GS)[[JOINT[f"{f}_mcp"] for f in FINGERS[1:]], 2]
    np.testing.assert_allclose(twisted, turn[1], atol=0.02)


def test_a_pose_within_the_stretch_is_looked_at_where_it_was_found() -> None:
    at = poses()[0]
    pose, _ = found_pose([at], at.onset - 0.2, at.duration + 1.0)
    assert pose is not None and pose.drift == 0.0


def test_a_pose_that_was_not_held_is_refused_in_words() -> None:
    pose, refused = found_pose(poses()[:1], sway=0.5)
    assert pose is None
    assert "still" in refused[0]


@pytest.mark.parametrize("given", [(), (Event(0.0, 0.0, "annotation", {"calibration": "none"}),)])
def test_without_a_pose_none_is_believed_to_have_been_taken(given: tuple[Event, ...]) -> None:
    assert found_pose(given) == (None, [])


@pytest.mark.slow
def test_a_recording_that_begins_in_the_pose_is_calibrated_with_it() -> None:
    """The other simulator's person, an index finger: its base and its last sensor hang on the pose."""
    recording, true = write_and_load(Setup(41, pace=1.0, duration=20.0, missed=2.5 * DEG))
    without = replace(recording, events=())
    errors = []
    for each in (recording, without):
        (found,) = process(BATCH["map"], PARAMS, each).calibrations
        errors.append(
            [
                quat.angle(
                    quat.relative(true.body.mountings[s].as_quat(scalar_first=True), found.q_BS[s])
                )
                for s in ("hand", "index_distal")
            ]
        )
    assert np.degrees(errors[0]).max() < 5.0 < np.degrees(errors[1]).max()
