"""The live tracker: the same numbers as in batch, never in the way of what feeds it, alive after a method fails."""

import math
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from handscope.app.live.readouts.hand_trail import AT_ONCE, REACH
from handscope.app.live.readouts.hand_trail import PARAMS as LOOKS
from handscope.app.live.tracking import QUEUE, Tracking, segment_flags
from handscope.app.workers.turns import Turns
from handscope.estimators.alignment import initial_pose
from handscope.estimators.alignment.functional_movements import STEPS
from handscope.estimators.data import trajectory
from handscope.estimators.data.findings import Finding
from handscope.estimators.data.held_contact import held_contacts
from handscope.estimators.data.samples import Block, Event, join_consecutive
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, SEGMENT, SEGMENTS
from handscope.estimators.methods import ekf, m2
from handscope.estimators.orientation import zupt_navigation
from handscope.estimators.pipeline import process as pipeline_process
from handscope.estimators.pipeline.method import Method
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.simulation import experiments
from handscope.estimators.simulation.experiments import Experiment, PersonErrors
from handscope.estimators.simulation.movements import (
    functional_calibration,
    task_performance,
    touched_fingertips,
)
from handscope.estimators.simulation.person import draw_person
from handscope.estimators.simulation.scenario import simulate_performances
from handscope.estimators.simulation.sensors import SensorErrors
from tests.app.devices.virtual import wait_for
from tests.estimators.alignment.functional import ANYHOW
from tests.oriented import oriented_strips
from tests.simulated import INSTANT, in_strips, strips_of, tracked

PARAMS = INSTANT


def pieces(samples: dict[str, Block], length: float = 0.02) -> list[list[Block]]:
    """What arrives one after the other: all strips' samples of 20 ms."""
    end = max(b.t[-1] for b in samples.values())
    edges = np.arange(0.0, end + 2 * length, length)
    cut = [[b.between(start, stop) for b in samples.values()] for start, stop in pairwise(edges)]
    return [full for blocks in cut if (full := [b for b in blocks if len(b.t)])]


def live(method: Method[Any, Any] = m2) -> tuple[Tracking, list[Trajectory]]:
    recording = in_strips("left")
    rows: list[Trajectory] = []
    return Tracking(method, PARAMS, "left", recording.geometry, rows.append), rows


def play(tracking: Tracking, samples: dict[str, Block], pose: initial_pose.Pose) -> None:
    """Feed everything in order, no faster than it is taken; calibrate as soon as the pose is over."""
    for k, blocks in enumerate(pieces(samples)):
        tracking.feed(blocks)
        newest = max(float(b.t[-1]) for b in blocks)
        if k % 20 == 0:
            wait_for(lambda newest=newest: tracking.newest_sample() >= newest)
        if tracking.calibration is None and newest > pose.end + 0.5:
            wait_for(lambda newest=newest: tracking.newest_sample() >= newest)
            tracking.calibrate(pose)
    wait_for(lambda: tracking.newest_sample() >= max(float(b.t[-1]) for b in samples.values()))


def test_what_was_shown_live_is_bit_for_bit_what_a_batch_run_gives() -> None:
    recording = in_strips("left")
    tracking, _ = live()
    with tracking:
        play(tracking, dict(recording.samples), initial_pose.pose_of(recording.events[0]))
        tracking.drain()
        shown = tracking.past(0.0)
    assert tracking.skipped == 0
    batch = tracked(recording).between(float(shown.t[0]), np.inf)
    assert len(shown) > 900
    for name in ("t", "angles", "q_GS", "tips", "flags"):
        np.testing.assert_array_equal(getattr(shown, name), getattr(batch, name), err_msg=name)


def test_samples_are_kept_whole_from_the_instant_asked_for_in_few_blocks() -> None:
    samples = dict(in_strips("left").samples)
    tracking, _ = live()
    with tracking:
        for blocks in pieces(samples, length=0.01):
            tracking._process(blocks)  # as if each had been waited for
    kept = {b.stream.name: b for b in tracking.samples(2.005)}
    assert {*kept} == {*samples}
    for name, block in samples.items():
        np.testing.assert_array_equal(kept[name].values, block.between(2.005, np.inf).values)
    assert max(len(blocks) for blocks in tracking._samples.values()) < 0.15 * len(samples["hand"].t)
    assert tracking.motion().keys() == {s for b in samples.values() for s in b.stream.sensors}


def test_the_trail_is_the_path_of_the_last_seconds_however_late_somebody_asks_for_it() -> None:
    recording, shown = in_strips("left"), []
    watched = Tracking(
        m2, PARAMS, "left", recording.geometry, lambda _: shown.append(watched.trail(1.0))
    )
    late, _ = live()
    pose = initial_pose.pose_of(recording.events[0])
    with watched:
        assert len(watched.trail(1.0)) == 0
        play(watched, dict(recording.samples), pose)
        trail = watched.trail(1.0)
    late._process(list(recording.samples.values()))
    late.calibrate(pose)
    pieces = [late.trail(1.0) for _ in range(math.ceil(REACH / AT_ONCE) + 1)]
    asked_at_last = pieces[-1]
    assert len(pieces[1]) == 0  # a second of it at a time: other stations wait for it
    late.restore_previous()
    assert len(late.trail(1.0)) == 0
    assert (
        watched.calibration is not None
        and recording.samples["hand"].t[-1] - watched.calibration.t > REACH
    )
    assert len(shown) > 20 and len(trail) == pytest.approx(100, abs=2)
    np.testing.assert_array_equal(trail[-1], 0.0)
    start = zupt_navigation.start(LOOKS, watched.calibration)
    _, path = zupt_navigation.step(
        LOOKS, start, recording.samples["hand"].between(watched.calibration.t, np.inf)
    )
    np.testing.assert_allclose(trail, path.p[-len(trail) :] - path.p[-1], atol=1e-9)
    assert 0 < np.ptp(trail, axis=0).max() < 0.05  # fingers wiggle, the hand stays
    np.testing.assert_allclose(asked_at_last, trail, atol=2e-3)


def test_what_comes_while_a_calibration_computes_for_long_is_followed_afterwards() -> None:
    recording = in_strips("left")
    tracking, _ = live()
    waited = [b for blocks in pieces(dict(recording.samples), 0.005) for b in blocks]
    assert len(waited) > 7 * 5.0 / 0.01  # more than seven streams send in 5 s
    tracking.feed(waited)  # before its thread takes anything
    with tracking:
        newest = max(float(b.t[-1]) for b in recording.samples.values())
        wait_for(lambda: tracking.newest_sample() >= newest)
    assert tracking.skipped == 0


def test_a_full_queue_skips_the_oldest_and_counts_it() -> None:
    tracking, _ = live()  # not entered: nothing takes the blocks out
    block = next(iter(in_strips("left").samples.values())).between(0.0, 0.02)
    tracking.feed([block] * (QUEUE + 7))
    assert tracking.skipped == 7


@pytest.mark.parametrize("times", [1, 7])
def test_a_method_that_fails_goes_on_from_its_last_state_and_at_last_from_its_calibration(
    times: int,
) -> None:
    failing, started, taken, lost = {"left": times}, [], Counter[str](), Counter[str]()

    def step(params: Any, state: Any, *blocks: Block) -> Any:
        bad = [b for b in blocks if b.stream.name == "hand" and b.t[0] > 8.0]
        if failing["left"] and bad:
            if len(blocks) == 1:
                failing["left"] -= 1
                lost["hand"] += len(bad[0].t)
            raise RuntimeError("singular")
        taken.update({b.stream.name: len(b.t) for b in blocks})
        return m2.step(params, state, *blocks)

    def start(*arguments: Any) -> Any:
        started.append(arguments)
        return m2.start(*arguments)

    broken = cast(
        Method[Any, Any],
        SimpleNamespace(
            CAPABILITIES=m2.CAPABILITIES,
            start=start,
            step=step,
            release=m2.release,
            finish=m2.finish,
        ),
    )
    recording = in_strips("left")
    tracking, rows = live(broken)
    pose = initial_pose.pose_of(recording.events[0])
    with tracking:
        play(tracking, dict(recording.samples), pose)
        wait_for(lambda: rows and rows[-1].t[-1] > 12.0)
    assert tracking.failures == times
    assert len(started) == 1 + times // 4  # once for the calibration
    assert tracking.calibration is not None
    whole = {
        name: int((block.t >= tracking.calibration.t).sum())
        for name, block in recording.samples.items()
    }
    assert taken + lost == whole, (
        "what did not fail lost nothing, neither of this stream nor of another"
    )
    assert np.isfinite(trajectory.join(rows[-5:], "left").tips).all()
    if times == 1:  # some 20 ms were left out: nothing of the heading is lost
        k = int(np.searchsorted(tracked(recording).t, rows[-1].t[-1]))
        assert np.nanmax(np.abs(tracked(recording).angles[k] - rows[-1].angles[-1])) < np.radians(
            1.0
        )


def test_what_shows_poses_may_fail_and_the_method_goes_on() -> None:
    recording, shown = in_strips("left"), []

    def show(rows: Trajectory) -> None:
        shown.append(rows)
        raise RuntimeError("the scene is gone")

    tracking = Tracking(m2, PARAMS, "left", recording.geometry, show)
    with tracking:
        play(
            tracking,
            {name: b.between(0.0, 8.0) for name, b in recording.samples.items()},
            initial_pose.pose_of(recording.events[0]),
        )
        wait_for(lambda: shown and shown[-1].t[-1] > 7.5)
    assert tracking.failures == 0


def test_a_pose_that_moved_is_refused_and_changes_nothing() -> None:
    recording = in_strips("left")
    tracking, _ = live()
    with tracking:
        tracking.feed([b.between(7.0, 13.0) for b in recording.samples.values()])
        wait_for(lambda: tracking.newest_sample() >= 12.9)
        with pytest.raises(InputError, match="was not still"):
            tracking.calibrate(initial_pose.Pose(8.0, 3.5))
    assert tracking.calibration is None


def test_a_sensor_mounted_wrong_is_among_the_warnings_of_the_calibration() -> None:
    recording = in_strips("left")
    samples, pose = dict(recording.samples), initial_pose.pose_of(recording.events[0])
    ring = samples["ring"]
    values = ring.values.copy()
    values[:, 1] = values[:, 1][:, [1, 0, 2, 4, 3, 5]] * [
        1,
        -1,
        1,
        1,
        -1,
        1,
    ]  # turned by 90 deg about z
    tracking, _ = live()
    with tracking:
        play(tracking, samples | {"ring": Block(ring.stream, ring.t, values)}, pose)
        assert tracking.calibration is not None
        (warning,) = tracking.calibration.warnings
    assert warning.startswith("ring_middle: it sits turned by about 90 deg")


@pytest.mark.slow
def test_a_functional_calibration_in_force_from_the_next_pose_on_is_what_a_batch_run_of_the_recording_finds() -> (
    None
):
    rng = np.random.default_rng(3)
    person = draw_person("left", rng)
    pose, steps = (
        task_performance.initial_pose(person.true),
        functional_calibration.all_steps(person.true, rng),
    )
    recording = strips_of(
        simulate_performances(
            [pose, *steps, pose, task_performance.tapping(person.true, 3.0)],
            "left",
            person.true,
            rng,
            ANYHOW,
            known=person.declared,
        )
    )
    tracking = Tracking(m2, m2.Params(), "left", recording.geometry, lambda rows: None)
    fed, found = 0, {}
    cut = pieces(dict(recording.samples))
    ends = [max(float(b.t[-1]) for b in blocks) for blocks in cut]
    with tracking:
        for event in (e for e in recording.events if e.trial_type in ("initial_pose", *STEPS)):
            while ends[fed] < event.end + 0.3:
                tracking.feed(cut[fed])
                fed += 1
                if fed % 20 == 0:
                    wait_for(lambda newest=ends[fed - 1]: tracking.newest_sample() >= newest)
            wait_for(lambda newest=ends[fed - 1]: tracking.newest_sample() >= newest)
            if event.trial_type == "initial_pose":
                tracking.movements = dict(found)
                calibration = tracking.calibrate(initial_pose.pose_of(event))
            else:
                found[event.trial_type] = tracking.measure(event.trial_type, event.onset, event.end)
        for blocks in cut[fed:]:
            tracking.feed(blocks)
            wait_for(
                lambda blocks=blocks: (
                    tracking.newest_sample() >= max(float(b.t[-1]) for b in blocks)
                )
            )
        tracking.drain()
        shown = tracking.past(calibration.t)
    batch = pipeline_process.process(m2, m2.Params(), recording)
    assert set(calibration.steps) == set(STEPS) == set(batch.calibrations[-1].steps)
    assert not any(piece.problems for piece in found.values())
    for segment, q_BS in batch.calibrations[-1].q_BS.items():
        np.testing.assert_allclose(calibration.q_BS[segment], q_BS, atol=1e-9, err_msg=segment)
    same = batch.trajectory.between(float(shown.t[0]), np.inf)
    assert tracking.skipped == 0 and len(shown) > 400
    np.testing.assert_allclose(shown.angles, same.angles, atol=1e-6)


def test_a_calibration_that_is_taken_back_leaves_what_was_shown_before_and_goes_on_with_the_one_before() -> (
    None
):
    recording = in_strips("left")
    first = initial_pose.pose_of(recording.events[0])
    tracking, _ = live()
    whole, _ = live()
    with tracking, whole:
        for t in (tracking, whole):
            play(t, {name: b.between(0.0, 9.0) for name, b in recording.samples.items()}, first)
        shown, before = tracking.past(0.0, 8.0), tracking.calibration
        tracking.calibrate(replace(first, onset=first.onset + 0.2, thumb_cmc=(0.0, 0.0, 0.0)))
        assert tracking.calibration is not before
        assert tracking.restore_previous() is before
        for t in (tracking, whole):
            for blocks in pieces(
                {name: b.between(9.0, 13.0) for name, b in recording.samples.items()}
            ):
                t.feed(blocks)
            wait_for(lambda t=t: t.newest_sample() >= 12.9)
            t.drain()
        later, same = tracking.past(9.5, 12.9), whole.past(9.5, 12.9)
    assert len(shown) > 300 and len(later) > 300
    np.testing.assert_allclose(later.angles, same.angles, atol=1e-9)


def test_without_any_calibration_every_row_is_flagged_live_and_in_batch_and_they_are_the_same() -> (
    None
):
    recording = in_strips("left")
    tracking, _ = live()
    with tracking:
        for blocks in pieces({name: b.between(0.0, 12.0) for name, b in recording.samples.items()}):
            tracking.feed(blocks)
            if tracking.calibration is None and blocks[0].t[0] > 5.0:
                wait_for(lambda: tracking.newest_sample() >= 5.0)
                guess = tracking.guess()
            elif int(blocks[0].t[0] * 100) % 50 == 0:
                wait_for(lambda newest=blocks[0].t[0]: tracking.newest_sample() >= newest)
        wait_for(lambda: tracking.newest_sample() >= 11.9)
        tracking.drain()
        shown = tracking.past(guess.t)
    event = Event(guess.t, guess.end - guess.t + 1e-6, "annotation", {"calibration": "none"})
    batch = pipeline_process.process(m2, PARAMS, replace(recording, events=(event,)))
    assert batch.calibrations[0].source == guess.source == "none"
    assert any("nothing was calibrated" in w for w in batch.warnings)
    same = batch.trajectory.between(float(shown.t[0]), float(shown.t[-1]) + 1e-6)
    np.testing.assert_allclose(shown.angles, same.angles, atol=1e-9)
    for rows in (shown, batch.trajectory):
        assert ((rows.flags & Flag.UNCALIBRATED) != 0).all()


def test_a_sensor_found_at_fault_flags_its_rows_live_from_the_calibration_on() -> None:
    recording = in_strips("left")
    samples, pose = dict(recording.samples), initial_pose.pose_of(recording.events[0])
    ring = samples["ring"]
    values = ring.values.copy()
    values[:, 1] = values[:, 1][:, [1, 0, 2, 4, 3, 5]] * [
        1,
        -1,
        1,
        1,
        -1,
        1,
    ]  # turned by 90 deg about z
    tracking, _ = live()
    with tracking:
        play(tracking, samples | {"ring": Block(ring.stream, ring.t, values)}, pose)
        tracking.drain()
        shown = tracking.past(pose.end + 1.0)
    faulty = (shown.flags & Flag.FAULTY) != 0
    assert faulty[:, SEGMENT["ring_middle"]].all() and faulty.sum() == len(shown)


def test_live_a_faulty_sensors_finger_is_doubtful_where_the_filter_couples_its_sensors() -> None:
    calibration = calibrate(PARAMS, in_strips("left"))[0][0]
    finding = Finding("ring_middle", "turned", "", "", "fault")
    for method, coupled in ((m2, set()), (ekf, {*CHAINS["ring"]})):
        flags = segment_flags(calibration, [finding], method.CAPABILITIES)
        assert {s for s in SEGMENTS if flags[SEGMENT[s]] & Flag.DOUBTFUL} == coupled
        assert [s for s in SEGMENTS if flags[SEGMENT[s]] & Flag.FAULTY] == ["ring_middle"]


def test_what_was_recorded_before_a_second_pose_is_still_processed_with_the_first() -> None:
    person = draw_person("left", np.random.default_rng(4)).true
    rng = np.random.default_rng(4)
    pose, again, moved = (
        task_performance.initial_pose(person),
        task_performance.initial_pose(person),
        task_performance.fist_and_stretch(person, 1),
    )
    slipped = functional_calibration.miss_posture(
        task_performance.flat(), 6.0, rng
    )  # the second pose is another one
    again = task_performance.initial_pose(person, taken=slipped)
    made = strips_of(
        simulate_performances([pose, moved, again, moved], "left", person, rng, ANYHOW)
    )
    _, second = (e for e in made.events if e.trial_type == "initial_pose")
    one = pipeline_process.process(
        m2, PARAMS, replace(made, events=tuple(e for e in made.events if e is not second))
    )
    both = pipeline_process.process(m2, PARAMS, made)
    assert [c.source for c in both.calibrations] == ["initial pose"] * 2
    t = both.calibrations[1].t
    np.testing.assert_array_equal(
        both.trajectory.between(0.0, t).angles, one.trajectory.between(0.0, t).angles
    )
    after = (
        both.trajectory.between(t + 1.0, np.inf).angles
        - one.trajectory.between(t + 1.0, np.inf).angles
    )
    assert np.nanmax(np.abs(after)) > np.radians(2.0)


def test_a_dead_sensor_is_named_without_a_pose() -> None:
    rng = np.random.default_rng(6)
    samples = {}
    for name, b in in_strips("left").samples.items():
        values = b.values + 2e-3 * rng.normal(size=b.values.shape)  # a living sensor's noise
        values[:, 2:3] = values[:1, 2:3] if name == "ring" else values[:, 2:3]
        samples[name] = Block(b.stream, b.t, values)
    tracking, _ = live()
    with tracking:
        tracking.feed(list(samples.values()))
        wait_for(lambda: tracking.newest_sample() > 12.0)
        assert {f.sensor for f in tracking.faults()} == {"ring_distal"}


def test_blocks_of_a_stream_that_was_described_anew_are_not_laid_together() -> None:
    before = in_strips("left").samples["index"]
    parts = [before.between(k, k + 1.0) for k in range(4)]
    anew = replace(before.stream, sensors=before.stream.sensors[:2])
    parts[2:] = [Block(anew, b.t, b.values[:, :2]) for b in parts[2:]]
    first, second = join_consecutive(parts)
    assert (first.stream, second.stream) == (before.stream, anew)
    np.testing.assert_array_equal(np.concatenate([first.t, second.t]), before.between(0.0, 4.0).t)


def test_a_calibration_that_computes_for_long_holds_no_other_stations_turn() -> None:
    turns, (tracking, _) = Turns(), live()
    tracking._share = turns.share()
    with tracking:
        with tracking._lock:  # as a calibration does
            tracking.feed(list(in_strips("left").samples.values()))
            wait_for(lambda: not tracking._queue)
            assert turns.take(first=False)  # at once
            turns.pass_on()
        wait_for(lambda: tracking.newest_sample() > 0)


def test_a_device_that_fuses_itself_is_tracked_as_in_batch() -> None:
    recording = oriented_strips("left")
    tracking, _ = live()
    with tracking:
        play(tracking, dict(recording.samples), initial_pose.pose_of(recording.events[0]))
        tracking.drain()
        shown = tracking.past(0.0)
        assert tracking.calibration is not None
        assert any("own fusion" in w for w in tracking.calibration.warnings)
    done = pipeline_process.process(m2, PARAMS, recording).trajectory
    batch = done.between(float(shown.t[0]), np.inf)
    assert len(shown) > 900
    np.testing.assert_array_equal(shown.angles, batch.angles)


def test_a_method_that_needs_rates_refuses_orientations_live() -> None:
    recording = oriented_strips("left")
    rows: list[Trajectory] = []
    tracking = Tracking(ekf, ekf.Params(), "left", recording.geometry, rows.append)
    pose = initial_pose.pose_of(recording.events[0])
    with tracking, pytest.raises(InputError, match="orientations alone; use m2"):
        play(tracking, {n: b.between(0.0, 6.0) for n, b in recording.samples.items()}, pose)


def test_a_sensor_that_turns_while_the_hand_moves_is_told_live_until_the_next_pose() -> None:
    recording = experiments.record_experiment(
        experiments.EXPERIMENTS["tapping"],
        np.random.default_rng([1, 3]),
        SensorErrors(slip=17.0, slipping=1),
        None,
        "left",
    )
    tracking = Tracking(ekf, ekf.Params(), "left", recording.geometry, lambda rows: None)
    pose, told = initial_pose.pose_of(recording.events[0]), []
    with tracking:
        for blocks in pieces(dict(recording.samples), length=0.2):
            tracking._process(blocks)  # as if each had been waited for
            newest = float(blocks[0].t[-1])
            if tracking.calibration is None and newest > pose.end + 0.5:
                tracking.calibrate(pose)
            told.append((newest, tracking.turned()))
        turned = 0.5 * float(recording.truth.t[-1])
        assert not any(found for t, found in told if t < turned)
        first = next(t for t, found in told if found)
        assert first < turned + 10.0
        (found,) = tracking.turned()
        assert (found.message.code, found.sensors) == ("sensor.turned", ("thumb_distal",))
        tracking.guess()
        assert tracking.turned() == ()


def test_contacts_are_used_live_once_they_are_known_as_in_batch() -> None:
    recording = experiments.record_experiment(
        Experiment(
            "touched",
            ("thumb",),
            lambda geometry, rng: (
                task_performance.initial_pose(geometry),
                touched_fingertips.touch_fingertips(geometry, rng),
            ),
        ),
        np.random.default_rng([1, 3]),
        SensorErrors(),
        None,
        "left",
        person=PersonErrors(pose_deg=2.5),
    )
    held = held_contacts(recording.events)
    tracking = Tracking(ekf, ekf.Params(), "left", recording.geometry, lambda rows: None)
    pose = initial_pose.pose_of(recording.events[0])
    assert not tracking.use_contacts(held)
    with tracking:
        for blocks in pieces(dict(recording.samples), length=0.2):
            tracking._process(blocks)  # as if each had been waited for
            if tracking.calibration is None and float(blocks[0].t[-1]) > pose.end + 0.5:
                tracking.calibrate(pose)
        assert tracking.contacts() == ()
        assert tracking.use_contacts(held)
        tracking.drain()
        shown = tracking.past(0.0)
        (used,) = tracking.contacts()
    assert (used.message.code, used.message.severity) == ("contacts.used", "info")
    batch = pipeline_process.process(ekf, ekf.Params(), recording).trajectory
    rows = (batch.t >= shown.t[0]) & (batch.t <= shown.t[-1])
    np.testing.assert_array_equal(shown.tips, batch.tips[rows])
