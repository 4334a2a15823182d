"""Which measures a recording's tasks get, and how far a figure can be trusted."""

import numpy as np
import pytest

from handscope.estimators.data.options import describe
from handscope.estimators.data.samples import Event
from handscope.estimators.data.trajectory import Flag, empty
from handscope.estimators.hand.geometry import sized
from handscope.estimators.measures import MEASURES
from handscope.estimators.measures.assessment import assess, requested_measures
from handscope.estimators.measures.figure import grade_of
from handscope.estimators.measures.task_request import TaskRequest
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import IDEAL
from tests.simulated import pose_and_wiggle


def _recording() -> Simulated:
    return simulate(["tapping", "wiggle"], "left", sized("left"), np.random.default_rng(1), IDEAL)


def test_each_task_gets_the_measures_that_apply_to_it() -> None:
    recording = _recording()
    results = assess(recording.truth, recording.events)
    assert [(r.task, r.measure) for r in results] == [
        ("tapping", "tapping"),
        ("wiggle", "range_of_motion"),
    ]
    assert all(r.figures for r in results)
    assert [r.onset for r in results] == [e.onset for e in recording.events]


def test_an_excluded_task_is_left_out() -> None:
    recording = _recording()
    events = [
        Event(e.onset, e.duration, e.trial_type, {**e.details, "excluded": True})
        for e in recording.events[:1]
    ] + list(recording.events[1:])
    assert [r.task for r in assess(recording.truth, events)] == ["wiggle"]


def test_a_task_whose_every_trial_is_excluded_is_not_replaced_by_the_whole_recording() -> None:
    assert (
        assess(
            pose_and_wiggle("left").truth,
            [Event(6.0, 8.0, "task", {"task_name": "wiggle", "excluded": "pain"})],
        )
        == []
    )


def test_a_stretch_left_out_counts_for_no_figure() -> None:
    truth = pose_and_wiggle("left").truth
    (whole,) = assess(truth, [Event(6.0, 8.0, "task", {"task_name": "wiggle"})])
    pip = next(r for r in whole.details if (r.joint, r.angle) == ("index_pip", "flexion"))
    away = (pip.t_largest - 2.0, pip.t_largest + 2.0)
    pause = Event(
        away[0], away[1] - away[0], "annotation", {"task_name": "wiggle", "phase": "pause"}
    )
    (cut,) = assess(truth, [Event(6.0, 8.0, "task", {"task_name": "wiggle", "left_out": [away]})])
    (paused,) = assess(truth, [Event(6.0, 8.0, "task", {"task_name": "wiggle"}), pause])
    assert paused.figures == cut.figures
    found = next(r for r in cut.details if (r.joint, r.angle) == ("index_pip", "flexion"))
    assert found.largest < pip.largest - np.radians(10)
    assert not away[0] <= found.t_largest <= away[1]
    assert (cut.onset, cut.end) == (whole.onset, whole.end)


def test_without_a_task_the_whole_recording_is_assessed() -> None:
    truth = pose_and_wiggle("left").truth
    (result,) = assess(truth, [])
    assert (result.task, result.onset, result.end) == ("whole recording", truth.t[0], truth.t[-1])


def test_a_recording_without_samples_has_no_results() -> None:
    assert assess(empty("left"), []) == []


@pytest.mark.parametrize(
    ("bad", "grade"),
    [(0, "good"), (2, "good"), (3, "fair"), (20, "fair"), (21, "poor"), (100, "poor")],
)
def test_the_grade_falls_with_the_share_of_flagged_samples(bad: int, grade: str) -> None:
    flags = np.zeros((100, 2), np.uint8)
    flags[:bad, 1] = Flag.SATURATED
    found, reason = grade_of(flags)
    assert found == grade
    assert reason == (f"sensor at its limit in {bad} % of the samples" if bad else "")


def test_the_worst_flag_is_the_reason() -> None:
    flags = np.zeros((100, 1), np.uint8)
    flags[:30] = Flag.MISSING
    flags[:50] |= np.uint8(Flag.HEADING_LOST)
    assert grade_of(flags) == ("poor", "heading lost after a gap in 50 % of the samples")
    assert grade_of(np.zeros((0, 3), np.uint8)) == ("poor", "no samples")
    once = np.zeros((1000, 1), np.uint8)
    once[0] = Flag.MISSING
    assert grade_of(once)[1].endswith(" in less than 1 % of the samples")


@pytest.mark.parametrize("name", MEASURES)
def test_every_measure_has_a_title_documented_options_and_a_source(name: str) -> None:
    module = MEASURES[name]
    assert module.TITLE
    assert all(o.meaning and o.source for o in describe(module.Params))
    figures = module.figures(
        module.measure(module.Params(), pose_and_wiggle("left").truth, 6.0, 14.0)
    )
    assert figures
    assert all(f.source and f.unit and f.meaning for f in figures)
    assert all(
        f.what in module.KINDS and f.name == "_".join(filter(None, [f.part, f.what]))
        for f in figures
    )
    assert len({f.name for f in figures}) == len(figures)


def test_the_events_detail_measures_overrules_the_tasks_name() -> None:
    recording = _recording()
    for named in ("tapping", ["tapping"], "tapping, tremor"):
        events = [
            Event(e.onset, e.duration, e.trial_type, {**e.details, "measures": named})
            for e in recording.events
        ]
        found = {(r.task, r.measure) for r in assess(recording.truth, events)}
        assert {("tapping", "tapping"), ("wiggle", "tapping")} <= found
        assert not any(m == "range_of_motion" for _, m in found)


@pytest.mark.parametrize(
    ("task", "measures"),
    [
        ("rom_fist", {"range_of_motion", "total_active_motion"}),
        ("prom_thumb_palmar", {"range_of_motion", "thumb_abduction"}),
        ("rom_spread", {"range_of_motion", "finger_spread"}),
        ("rom_forearm", {"range_of_motion", "forearm_rotation"}),
        ("kapandji", {"range_of_motion", "kapandji"}),
        ("tapping_30", {"tapping"}),
        ("powerglove_11_tapping", {"tapping"}),
        ("powerglove_13_open_close", {"range_of_motion", "open_close"}),
        ("pronation_supination", {"range_of_motion", "pronation_supination"}),
        ("circular_pointing", {"range_of_motion", "circles"}),
        ("finger_independence", {"range_of_motion", "independence"}),
        ("pinches", {"pinch"}),
        ("selfcheck_p3", {"self_check"}),
        ("tremor_posture", {"tremor"}),
        ("reach", {"reach"}),
        ("repeatability_flat", {"range_of_motion"}),
    ],
)
def test_tasks_are_given_their_measures_by_name(task: str, measures: set[str]) -> None:
    assert set(requested_measures(TaskRequest(task))) == measures


@pytest.mark.parametrize(
    "task",
    ["rom_fist", "tapping", "finger_independence", "tremor_rest", "reach", "pronation_supination"],
)
def test_every_figure_that_has_a_value_has_a_standard_deviation_and_a_reason_where_it_is_not_good(
    task: str,
) -> None:
    recording = simulate([task], "left", sized("left"), np.random.default_rng(1), IDEAL)
    figures = [
        f for r in assess(recording.truth, recording.events, recording.geometry) for f in r.figures
    ]
    assert [f.name for f in figures if np.isfinite(f.value) and f.sd is None] == []
    assert [f.name for f in figures if f.grade != "good" and not f.reason] == []
    assert [
        f.name for f in figures if np.isnan(f.value) and (f.grade != "poor" or f.sd is not None)
    ] == []
