"""The report's content holds what the session gave."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np

from handscope.app.protocols import load_all
from handscope.app.report.content import CURVE_POINTS, drifts_of
from handscope.estimators.hand.anatomy import FLEXION, JOINT, SEGMENTS
from handscope.estimators.methods import m2
from tests.app.report.simulated_sessions import (
    CHECKSUM,
    ROM,
    VISIT,
    gap_in_the_little_finger,
    report,
    session,
)
from tests.estimators.measures.trajectories import resting_now_and_then


def test_a_session_is_gathered_whole() -> None:
    recording, processed, results = session()
    c = report()
    assert c.visit is VISIT
    assert (c.hand, c.software, c.method.name, c.method.title) == (
        "left",
        "handscope 1.2.3",
        "m2",
        m2.TITLE,
    )
    assert (c.recording.checksum, c.recording.start_utc) == (CHECKSUM, recording.start_utc)
    assert c.recording.duration == recording.duration
    assert c.recording.source["firmware"] == "1.2.0"
    (stream,) = c.recording.streams
    assert (stream.name, stream.sensors, stream.rate, stream.lost) == ("imu", SEGMENTS, 60.0, 12)
    assert stream.samples == len(recording.samples["imu"].t)
    assert c.calibrations[0].sensors == processed.calibrations[0].quality
    assert [t.result for t in c.tasks] == list(results)
    assert list(dict.fromkeys(t.result.task for t in c.tasks)) == [*ROM, "tapping"]


def test_what_drifts_at_rest_between_two_calibrations_is_in_it() -> None:
    _, processed, _ = session()
    drifting = replace(processed, trajectory=resting_now_and_then(8, 1e-3))
    (drift,) = drifts_of(drifting)
    assert drift.finger == "index" and drift.after - drift.before > 5e-3
    assert report().drifts == drifts_of(processed) == ()


def test_only_options_that_differ_from_their_default_are_listed() -> None:
    assert report().method.changed == ()
    (changed,) = report(params=m2.Params(max_gap=0.1)).method.changed
    assert (changed.option.name, changed.value, changed.option.default, changed.option.unit) == (
        "max_gap",
        0.1,
        0.25,
        "s",
    )


def test_the_date_is_the_visits_else_the_recordings_else_unknown() -> None:
    undated = replace(VISIT, date=None)
    assert report().date == VISIT.date
    assert report(visit=undated).date == datetime(2026, 11, 21, 10, 30, tzinfo=UTC)
    assert report(visit=undated, start_utc="2026-11-21T10:30:00").date == datetime(
        2026, 11, 21, 10, 30, tzinfo=UTC
    )
    assert report(visit=undated, start_utc=None).date is None


def test_a_task_with_a_protocol_carries_its_title_and_what_it_asks_for() -> None:
    thumb = next(t for t in report().tasks if t.result.task == "rom_thumb")
    assert thumb.title == load_all()["rom_thumb"].title
    assert thumb.asks("thumb_ip", "flexion")
    assert not thumb.asks("index_pip", "flexion")


def test_a_task_without_a_protocol_may_have_asked_for_anything() -> None:
    (task,) = report(session(("initial_pose", "rom"))).tasks
    assert task.asked is None
    assert task.asks("wrist", "deviation")


def test_curves_are_the_trajectorys_flexion_during_the_task() -> None:
    _, processed, results = session()
    fist = report().tasks[0]
    curve = next(c for c in fist.curves if c.joint == "ring_pip")
    assert 0.5 * CURVE_POINTS < len(curve.t) <= CURVE_POINTS
    assert curve.t[0] >= 0.0
    assert curve.t[-1] <= results[0].end - results[0].onset
    truth = np.interp(
        curve.t + results[0].onset,
        processed.trajectory.t,
        processed.trajectory.angles[:, JOINT["ring_pip"], FLEXION],
    )
    np.testing.assert_allclose(curve.angle, truth, atol=1e-9)  # rad


def test_flags_are_counted_within_the_tasks_with_the_worst_sensor_named() -> None:
    assert report().flagged == ()
    (missing,) = report(session(change=gap_in_the_little_finger)).flagged
    assert missing.worst == "little_proximal"
    assert 0.28 < missing.worst_share < 0.38  # a third
    np.testing.assert_allclose(missing.share, missing.worst_share / len(SEGMENTS), rtol=1e-9)
