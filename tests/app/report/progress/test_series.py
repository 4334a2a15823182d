"""Progress over sessions: what is beyond the minimal detectable change since the first and since the one before, on which hand, by which way."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from handscope.app.protocols import load_all
from handscope.app.report.progress.series import Progress, Series, progress
from handscope.app.report.units import DEG
from handscope.sessions.clinic.repeatability import Key, Occasion, ProcessedSession
from handscope.sessions.db.tables import Repeatability

MAY = datetime(2026, 5, 12, 9, tzinfo=UTC)
PIP: Key = ("range_of_motion", "rom_fist", "index_pip_flexion_max")
AMPLITUDE: Key = ("tapping", "tapping", "tapping_amplitude_mean")


def visit(
    day: int, degrees: float, hand: str = "left", method: str = "m2", key: Key = PIP, **more: Any
) -> ProcessedSession:
    o = Occasion(day, day, 1, hand, MAY + timedelta(days=day), str(day), "00a7", method, {})
    value = (degrees / DEG, "rad") if key[0] == "range_of_motion" else (degrees / 1e3, "m")
    return ProcessedSession(o, {key: value}, more.get("own", {}), more.get("glove", {}))


def told(*visits: ProcessedSession) -> Progress:
    found = progress(visits, load_all())
    assert found is not None
    return found


def only(found: Progress) -> Series:
    (series,) = found.series
    return series


def test_a_value_is_judged_against_the_first_and_against_the_one_before() -> None:
    series = only(told(visit(0, 60), visit(10, 70), visit(20, 80), visit(30, 81)))
    points = series.hands["left"].points
    assert [round(p.value) for p in points] == [60, 70, 80, 81]
    assert [p.since_first for p in points] == [None, False, True, True]  # 12 deg are published
    assert [p.since_before for p in points] == [None, False, False, False]
    assert (series.joint, series.angle, series.end, series.unit) == (
        "index_pip",
        "flexion",
        "largest",
        "deg",
    )
    assert series.reference is not None and series.reference.degrees == 100


def test_the_patients_own_repeatability_narrows_the_band() -> None:
    own = {PIP: Repeatability(mdc95=5 / DEG, freedom=4, patient_id=1, people=1, sessions=5)}
    course = only(told(visit(0, 60), visit(10, 66, own=own))).hands["left"]
    assert (course.judge.basis, course.judge.mdc95, course.points[-1].since_first) == (
        "own",
        pytest.approx(5),
        True,
    )


def test_where_no_measurement_error_is_known_nothing_is_judged() -> None:
    series = only(told(visit(0, 40, key=AMPLITUDE), visit(9, 90, key=AMPLITUDE)))
    course = series.hands["left"]
    assert (course.judge.mdc95, course.points[-1].since_first, series.unit, series.joint) == (
        None,
        None,
        "mm",
        "",
    )
    assert "no MDC is published" in course.judge.sources[0]


def test_the_other_hand_has_a_course_of_its_own() -> None:
    found = told(visit(0, 60), visit(1, 95, "right"), visit(20, 64), visit(21, 96, "right"))
    assert {
        hand: [p.session for p in course.points] for hand, course in only(found).hands.items()
    } == {"left": [0, 20], "right": [1, 21]}
    assert {hand: len(sessions) for hand, sessions in found.sessions.items()} == {
        "left": 2,
        "right": 2,
    }


def test_sessions_processed_in_another_way_are_not_mixed_in() -> None:
    found = told(
        visit(0, 60),
        visit(0, 80, method="ekf"),
        visit(10, 61),
        visit(20, 85, method="ekf"),
        visit(30, 62),
    )
    assert found.method == "m2"
    assert [p.session for p in only(found).hands["left"].points] == [0, 10, 30]


def test_what_a_task_did_not_ask_for_is_not_followed() -> None:
    wrist: Key = ("range_of_motion", "rom_fist", "wrist_deviation_max")
    extent: Key = ("range_of_motion", "rom_fist", "index_pip_flexion_range")
    assert told(visit(0, 5, key=wrist), visit(9, 9, key=extent)).series == ()
    assert progress([], load_all()) is None


def test_what_a_clinician_decides_by_comes_first_and_a_finger_keeps_its_figures() -> None:
    tam: Key = ("total_active_motion", "rom_fist", "ring_tam")
    share: Key = ("total_active_motion", "rom_fist", "ring_tam_share")
    first, other = (
        replace(v, values=dict.fromkeys((PIP, share, AMPLITUDE, tam), (1.0, "rad")))
        for v in (visit(0, 60), visit(9, 70))
    )
    found = told(first, other).series
    assert [s.name for s in found] == [tam[2], AMPLITUDE[2], PIP[2], share[2]]
    assert [s.important for s in found] == [True, True, False, False]
    assert [s.finger for s in found] == ["ring", "", "index", "ring"]
