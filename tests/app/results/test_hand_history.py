"""Both hands' histories of a patient: a result that is no longer this hand's but the other's is asked about."""

from dataclasses import asdict
from datetime import UTC, datetime

import numpy as np
import pytest

from handscope.app.language import languages
from handscope.app.report.changes import Change, Changes
from handscope.app.report.trust.judgement import judge_trust, trust_payload
from handscope.app.results.hand_history import resembles_other_hand
from handscope.app.results.result_view import CALIBRATION, readings
from handscope.estimators.measures.figure import Figure
from handscope.sessions.clinic.references import Compared

DAY = datetime(2026, 11, 2, tzinfo=UTC)
JOINTS = [f"{f}_{j}" for f in ("index", "middle", "ring", "little") for j in ("mcp", "pip")]
MDC = 8.0  # deg
HEALTHY = np.array([88.0, 102.0, 90.0, 104.0, 89.0, 103.0, 87.0, 98.0])  # deg
AFFECTED = HEALTHY - [25.0, 32.0, 18.0, 40.0, 22.0, 30.0, 15.0, 28.0]
EXAMINED_AGAIN = np.array([1.5, -2.0, 0.5, 3.0, -1.0, 2.5, -3.0, 1.0])


def measured(
    now: np.ndarray, before: np.ndarray, other: np.ndarray, count: int = 8
) -> tuple[list[Figure], Changes, Compared]:
    """Ranges now, what they have changed by since the same hand's session before, and the other hand's; arguments in deg."""
    figures = [
        Figure(f"{j}_flexion_max", np.radians(v), "rad", "x")
        for j, v in list(zip(JOINTS, now))[:count]
    ]
    each = tuple(
        Change("range_of_motion", "rom_fist", f.name, n - b, "deg", MDC, "published", ())
        for f, n, b in zip(figures, now, before)
    )
    values = {
        ("range_of_motion", "rom_fist", f.name): (np.radians(o), "rad")
        for f, o in zip(figures, other)
    }
    return figures, Changes(DAY, each), Compared(1, 1, "left", DAY, "0.2.0", values)


def asked(now: np.ndarray, before: np.ndarray, other: np.ndarray, count: int = 8) -> bool:
    figures, changes, compared = measured(now, before, other, count)
    rows = [("rom_fist", "range_of_motion", f) for f in figures]
    return resembles_other_hand(rows, changes, compared)


def test_the_healthy_hand_that_reads_as_the_affected_one_is_asked_about() -> None:
    assert asked(AFFECTED + EXAMINED_AGAIN, HEALTHY, AFFECTED)


def test_a_hand_measured_again_is_not_asked_about() -> None:
    assert not asked(HEALTHY + EXAMINED_AGAIN, HEALTHY, AFFECTED)
    assert not asked(AFFECTED + EXAMINED_AGAIN, AFFECTED, HEALTHY)


def test_a_hand_that_recovers_is_not_asked_about() -> None:
    assert not asked(HEALTHY + EXAMINED_AGAIN, AFFECTED, HEALTHY)


def test_a_hand_that_became_worse_in_its_own_way_is_not_asked_about() -> None:
    assert not asked(HEALTHY - [40, 5, 50, 10, 45, 12, 38, 8], HEALTHY, AFFECTED)


@pytest.mark.parametrize("count", [0, 5])
def test_few_joints_tell_no_hand(count: int) -> None:
    assert not asked(AFFECTED, HEALTHY, AFFECTED, count)


def test_the_question_stands_among_the_reasons_and_changes_no_answer() -> None:
    rows = [("rom_fist", Figure("x", 1.0, "1", "x"))] * 3
    plain, question = judge_trust(rows, True), judge_trust(rows, True, asks_hand=True)
    assert plain.answer == question.answer == "yes"
    said = trust_payload(question, {}, languages()["en"])
    assert said["reasons"][0].endswith("was the other hand measured?")
    assert "correct the hand" in said["todo"][0]


def test_the_page_of_a_result_asks() -> None:
    figures, changes, compared = measured(AFFECTED + EXAMINED_AGAIN, HEALTHY, AFFECTED)
    stored = [asdict(f) | {"task": "rom_fist", "measure": "range_of_motion"} for f in figures]
    of_sensor = dict.fromkeys(CALIBRATION, 0.1)
    calibration = {"quality": {"hand": of_sensor}, "source": "pose", "onset": 0.0, "end": 3.0}
    content = {"calibration": calibration}
    found = readings(content, stored, {}, languages()["en"], changes, lean=True, compared=compared)
    assert found["trust"]["reasons"][0].endswith("was the other hand measured?")
    alone = readings(content, stored, {}, languages()["en"], lean=True)
    assert alone["trust"]["reasons"] == []
