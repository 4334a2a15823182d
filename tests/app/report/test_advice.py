"""What to do about figures that cannot be trusted: beside the reason, on the page and in the report, for every reason that a person can mend."""

import json
from importlib.resources import files

import pytest

from handscope.app.language import language, languages
from handscope.app.report.advice import ADVICE, advice
from handscope.app.report.sections.other_measures import other_measures
from handscope.estimators.data.trajectory import FORCE_WORDS, PLACE_WORDS, PlaceFlag
from tests.app.report.sections.test_other_measures import trial

ENGLISH = language("en")
CARRIED = "part of the load does not change with the acceleration: something not measured carries the object"
SAID = language("de").sentences  # tests/app/language holds them against the source


def test_a_reason_that_a_person_can_mend_comes_with_what_to_do() -> None:
    [section] = other_measures([trial(0, 0.9, "poor", f"the object slipped; {CARRIED}")], ENGLISH)
    assert [words.split(":")[0] for words in section["advice"]] == [
        "Take an object with a rougher surface, or have it gripped more firmly, and repeat the task.",
        "Repeat the task with thumb and index finger alone, on their force sensors",
    ]


@pytest.mark.parametrize(
    ("grade", "reason"),
    [("good", "the object slipped"), ("fair", "found in the fingertips' speed"), ("poor", "")],
)
def test_nothing_is_to_be_done_where_figures_are_good_or_nobody_can_mend_them(
    grade: str, reason: str
) -> None:
    [section] = other_measures([trial(0, 0.9, grade, reason)], ENGLISH)  # type: ignore[arg-type]
    assert section["advice"] == []


def test_another_magnet_is_put_away_and_no_cup_moved_for_it() -> None:
    told = advice(
        [
            f"{PLACE_WORDS[PlaceFlag.DOUBTFUL]} in 77 % of the samples; {PLACE_WORDS[PlaceFlag.OUT_OF_REACH]}"
        ],
        ENGLISH,
    )
    assert len(told) == 1
    assert told[0].startswith("Keep phones, watches, tools and other magnets half a metre")
    assert "nearer to the trunk" in advice([PLACE_WORDS[PlaceFlag.OUT_OF_REACH]], ENGLISH)[0]


@pytest.mark.parametrize("piece", [piece for piece, _ in ADVICE])
def test_what_advice_goes_by_is_said_somewhere(piece: str) -> None:
    assert any(piece in text for text in SAID)


@pytest.mark.parametrize("words", [*FORCE_WORDS.values(), *PLACE_WORDS.values()])
def test_every_flag_of_a_force_or_place_has_advice_in_every_language(words: str) -> None:
    english = advice([words], ENGLISH)
    assert english
    for code in languages():
        own = json.loads(
            files("handscope.app.language").joinpath(f"{code}.json").read_text("utf-8")
        )["words"]
        assert {f"advice.{what}" for _, what in ADVICE} <= own.keys()
