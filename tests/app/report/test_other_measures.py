"""Measures without a section of their own: trials side by side, in words, with what others measured."""

from app.language import language
from app.report.content import Task
from app.report.other_measures import norms_told, other_measures
from estimators.measures.assessment import TaskResult
from estimators.measures.figure import Figure, Grade


def trial(onset: float, value: float, grade: Grade = "good", reason: str = "") -> Task:
    share = Figure("index_independence", value, "1", "a source", 0.012, grade, reason, "index", "independence")
    hidden = Figure("index_rest", 1.0, "1", "another source", part="index", what="rest", detail=True)
    return Task(
        TaskResult("finger_independence", "independence", onset, onset + 10, None, (share, hidden)),
        "Finger by finger",
        "Independence",
        None,
    )


def test_trials_of_a_task_stand_side_by_side_with_the_worst_grade_and_its_reason() -> None:
    told = other_measures([trial(0, 0.9), trial(20, 0.8, "fair", "saturated in 5 % of the samples")], language("en"))
    assert [s["title"] for s in told] == ["Independence"]
    assert len(told[0]["trials"]) == 2
    [(name, values, _, grade, reason)] = told[0]["rows"]  # the detail is left to the tables
    assert name.startswith("Index")
    assert values == ["0.900 ± 0.012", "0.800 ± 0.012"]
    assert grade[0] == "fair"
    assert reason == "saturated in 5 % of the samples"


def test_tapping_and_ranges_have_sections_of_their_own() -> None:
    own = Task(TaskResult("tapping", "tapping", 0.0, 15.0, None, ()), "Finger tapping", "Tapping", None)
    assert other_measures([own], language("en")) == []


def test_a_norm_is_told_with_its_source_and_what_nobody_measured_has_none() -> None:
    section = {"name": "tapping", "about": [("tapping_rate", ""), ("nobody_measured_this", "")]}
    norm, nothing = norms_told(section, language("en"))
    assert nothing is None
    assert norm is not None and norm["told"].endswith("per s") and norm["reference"]
