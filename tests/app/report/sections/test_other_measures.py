"""Measures without a section of their own: trials side by side, in words, with what others measured."""

from dataclasses import replace
from datetime import UTC, datetime

import pytest

from handscope.app.language import language
from handscope.app.report.content import Task
from handscope.app.report.gradings import grade_content, uninjured
from handscope.app.report.sections.other_measures import norm_words, other_measures
from handscope.app.report.summary import summary
from handscope.estimators.measures import total_active_motion
from handscope.estimators.measures.assessment import TaskResult, assess
from handscope.estimators.measures.figure import Figure, Grade
from handscope.estimators.measures.total_active_motion import GRADINGS, regrade
from handscope.sessions.clinic.references import Course, Visit
from tests.app.report.simulated_sessions import report, session

GERMAN = language("de")


def trial(onset: float, value: float, grade: Grade = "good", reason: str = "") -> Task:
    share = Figure(
        "index_independence", value, "1", "a source", 0.012, grade, reason, "index", "independence"
    )
    hidden = Figure(
        "index_rest", 1.0, "1", "another source", part="index", what="rest", detail=True
    )
    return Task(
        TaskResult("finger_independence", "independence", onset, onset + 10, None, (share, hidden)),
        "Finger by finger",
        "Independence",
        None,
    )


def test_trials_of_a_task_stand_side_by_side_with_the_worst_grade_and_its_reason() -> None:
    told = other_measures(
        [trial(0, 0.9), trial(20, 0.8, "fair", "saturated in 5 % of the samples")], language("en")
    )
    assert [s["title"] for s in told] == ["Independence"]
    assert len(told[0]["trials"]) == 2
    [(name, values, _, grade, reason)] = told[0]["rows"]  # the detail is left to the tables
    assert name.startswith("Index")
    assert values == ["0.900 ± 0.012", "0.800 ± 0.012"]
    assert grade[0] == "fair"
    assert reason == "saturated in 5 % of the samples"


@pytest.mark.parametrize(
    ("value", "sd", "words"),
    [
        (1.21, 4e-5, "1.21"),
        (49.587, 2e-5, "49.6"),
        (0.0, 0.004, "0"),
        (236.2, 4.1, "236 ± 4"),
        (3.0, None, "3.00"),
    ],
)
def test_a_value_has_decimals_that_a_person_can_use_and_a_deviation_below_them_is_left_out(
    value: float, sd: float | None, words: str
) -> None:
    figure = Figure("reach_time", value, "s", "a source", sd, what="reach_time")
    reach = Task(
        TaskResult("reach", "reach", 0.0, 10.0, None, (figure,)), "Reach for a cup", "Reach", None
    )
    [[(_, values, *_)]] = [section["rows"] for section in other_measures([reach], language("en"))]
    assert values == [words]


def test_tapping_and_ranges_have_sections_of_their_own() -> None:
    own = Task(
        TaskResult("tapping", "tapping", 0.0, 15.0, None, ()), "Finger tapping", "Tapping", None
    )
    assert other_measures([own], language("en")) == []


def test_a_reach_says_that_its_path_is_no_way_through_the_room() -> None:
    path = Figure("reach_path", 1.2, "rad", "a source", 0.1, what="reach_path")
    reach = Task(
        TaskResult("reach", "reach", 0.0, 10.0, None, (path,)), "Reach for a cup", "Reach", None
    )
    said = {
        one: [s["limit"] for s in other_measures([reach, trial(20, 0.9)], language(one))]
        for one in ("en", "de")
    }
    assert said["en"][0].startswith("The glove does not know where the hand is in the room")
    assert said["de"][0].startswith("Der Handschuh weiß nicht, wo im Raum die Hand ist")
    assert [limits[1] for limits in said.values()] == ["", ""]


def _reached(*figures: tuple[str, float, str]) -> Task:
    """A trial of a reach with these figures: name, value, reason."""
    made = tuple(
        Figure(f"reach_{name}", value, "1", "a source", what=f"reach_{name}", reason=why)
        for name, value, why in figures
    )
    return Task(
        TaskResult("reach", "reach", 0.0, 10.0, None, made), "Reach for a cup", "Reach", None
    )


@pytest.mark.parametrize(
    ("trunk", "words"),
    [
        ((), "trunk's sensor."),
        ((("trunk_lean", 0.1, ""),), "trunk's sensor. The trunk leans 6° meanwhile."),
        (
            (("volume", 4e-5, ""), ("trunk_lean", 0.1, "")),
            "trunk's sensor. The trunk leans 6° meanwhile.",
        ),  # to and fro on one line
        (
            (("volume", 0.0123, ""), ("trunk_lean", 0.1, ""), ("trunk_forward", 0.04, "")),
            "trunk's sensor. The places reached span 12.3 litres. The trunk leans 6° meanwhile, which carries its sensor 4 cm forward.",
        ),
        (
            (("trunk_lean", 0.05, ""), ("trunk_forward", -0.012, "")),
            "trunk's sensor. The trunk leans 3° meanwhile, which carries its sensor 1 cm back.",
        ),
        (
            (("trunk_lean", 0.05, ""), ("trunk_forward", -0.004, "")),
            "trunk's sensor. The trunk leans 3° meanwhile, which carries its sensor 0 cm forward.",
        ),
    ],
)
def test_a_reach_is_told_in_short_with_what_is_known_of_it(
    trunk: tuple[tuple[str, float, str], ...], words: str
) -> None:
    task = _reached(
        ("distance", 0.28, ""), ("straightness", 1.07, ""), ("farthest", 0.51, ""), *trunk
    )
    said = summary(replace(report(session()), tasks=[task]), language("en"))
    told = "Reach for a cup: the hand reaches 28 cm, on a way 7 % longer than straight, and comes as far as 51 cm from the "
    assert told + words in said


def test_without_a_magnet_a_reach_says_in_short_why_it_has_no_metres_and_the_table_says_it_once() -> (
    None
):
    why = "the hand's place is not known: that takes magnetometers on the trunk and a magnet on the hand (where they are worn, the warnings say what is wrong)"
    unknown = [(name, float("nan"), why) for name in ("distance", "way", "straightness")]
    task = _reached(("time", 0.9, ""), ("peak_speed", 1.0, "another"), *unknown)
    assert f"Reach for a cup: how far the hand reaches is not known ({why})." in summary(
        replace(report(session()), tasks=[task]), language("en")
    )
    (section,) = other_measures([task], language("en"))
    assert section["reason"] == why and section["reasons"]
    assert [row[-1] for row in section["rows"]] == ["", "another", *["see the note"] * 3]


LIFTED = (
    ("count", 2.0, "", "good"),
    ("grip_hold", 3.04, "", "good"),
    ("load_hold", 2.87, "", "good"),
    ("time_to_lift", 0.74, "", "good"),
)
SLIPPED = tuple((name, value, "the object slipped", "poor") for name, value, _, _ in LIFTED)


@pytest.mark.parametrize(
    ("figures", "words"),
    [
        (
            LIFTED,
            "Heavy: lifted 2×, held with a grip of 3.0 N for a load of 2.9 N; from touch to lift-off 0.7 s.",
        ),
        (SLIPPED, "Heavy: no figures to rely on (the object slipped)."),
    ],
)
def test_a_lift_is_told_in_short(
    figures: tuple[tuple[str, float, str, Grade], ...], words: str
) -> None:
    made = tuple(
        Figure(f"lift_{n}", value, "1", "a source", what=f"lift_{n}", grade=grade, reason=why)
        for n, value, why, grade in figures
    )
    task = Task(TaskResult("lift", "lift", 0.0, 10.0, None, made), "Heavy", "Lift", None)
    assert words in summary(replace(report(session()), tasks=[task]), language("en"))


def test_a_norm_is_told_with_its_source_and_what_nobody_measured_has_none() -> None:
    norm, nothing = (
        norm_words(what, "", "tapping", language("en"))
        for what in ("tapping_rate", "nobody_measured_this")
    )
    assert nothing is None
    assert norm is not None and norm["told"].endswith("per s") and norm["reference"]


@pytest.mark.parametrize("code", ["en", "de", "fr"])
def test_a_source_that_several_figures_share_is_said_once(code: str) -> None:
    (motion,) = [
        s
        for s in other_measures(report().tasks, language(code))
        if s["measure"] == "total_active_motion"
    ]
    assert motion["source"].count("HandLab") == 1


@pytest.mark.parametrize("scheme", GRADINGS)
def test_a_grading_chosen_later_gives_the_words_that_it_would_have_given_first(scheme: str) -> None:
    recording, processed, results = session()
    kept = next(r for r in results if r.measure == "total_active_motion")
    options = {"total_active_motion": total_active_motion.Params(grading=scheme)}
    first = next(
        r
        for r in assess(processed.trajectory, recording.events, options=options)
        if r.measure == "total_active_motion"
    )
    words = {f.part: f.category for f in first.figures if f.what == "tam_share"}
    later = {f.part: f for f in regrade(kept.figures, scheme) if f.what == "tam_share"}
    assert len(words) == 5 and {part: f.category for part, f in later.items()} == words
    assert {f.source for f in later.values()} == {GRADINGS[scheme]}
    (section,) = [
        s
        for s in other_measures(grade_content(report(session()), scheme).tasks, GERMAN)
        if s["grading"]
    ]
    assert GERMAN.say(f"grading.{scheme}") in section["task"]


def test_total_active_motion_is_a_share_of_the_other_hand_where_only_this_one_is_affected() -> None:
    kept = next(r for r in session()[2] if r.measure == "total_active_motion")
    tam = next(f.value for f in kept.figures if f.name == "ring_tam")
    past = Course(
        (),
        Visit(
            datetime(2026, 11, 20, tzinfo=UTC),
            {("total_active_motion", "rom_fist", "ring_tam"): (2 * tam, "rad")},
        ),
    )
    for affected, share in (("left", 0.5), ("both", None), ("right", None), (None, None)):
        other = uninjured("left", affected, past)
        found = next(
            f
            for f in regrade(kept.figures, "assh", other.motion if other else {})
            if f.name == "ring_tam_share"
        )
        own = next(f for f in kept.figures if f.name == "ring_tam_share")
        assert found.value == pytest.approx(share or own.value), affected
        assert (found.category == "poor") is (share == 0.5)
