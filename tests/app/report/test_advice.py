"""What to do about figures that cannot be trusted: beside the reason, on the page and in the report, for every reason that a person can mend."""

import json
from importlib.resources import files

import pytest

from handscope.app.language import language, languages
from handscope.app.report.advice import ADVICE, advice
from handscope.app.report.sections.other_measures import other_measures
from handscope.estimators.data.trajectory import FORCE_WORDS, PLACE_WORDS, PlaceFlag
from handscope.estimators.messages import english_texts
from handscope.estimators.messages.sentence import join, phrase
from handscope.sessions.db.earlier_texts import read_back
from tests.app.report.sections.test_other_measures import trial

ENGLISH = language("en")
SLIPPED_AND_CARRIED = [phrase("force_flag.slip"), phrase("lift.carried")]
OLD = "the object slipped; part of the load does not change with the acceleration: something not measured carries the object"


@pytest.mark.parametrize("stored", [False, True], ids=["codes", "stored text"])
def test_a_reason_that_a_person_can_mend_comes_with_what_to_do(stored: bool) -> None:
    reason = read_back(OLD) if stored else join(SLIPPED_AND_CARRIED)
    [section] = other_measures([trial(0, 0.9, "poor", reason)], ENGLISH)
    assert [words.split(":")[0] for words in section["advice"]] == [
        "Take an object with a rougher surface, or have it gripped more firmly, and repeat the task.",
        "Repeat the task with thumb and index finger alone, on their force sensors",
    ]


@pytest.mark.parametrize(
    ("grade", "reason"),
    [
        ("good", phrase("force_flag.slip")),
        ("fair", phrase("measure.from_fingertip_speed")),
        ("poor", ""),
    ],
)
def test_nothing_is_to_be_done_where_figures_are_good_or_nobody_can_mend_them(
    grade: str, reason: str
) -> None:
    [section] = other_measures([trial(0, 0.9, grade, reason)], ENGLISH)  # type: ignore[arg-type]
    assert section["advice"] == []


def test_advice_goes_by_codes_whatever_the_words_are() -> None:
    reworded = phrase("plain.text", text="the object slipped")
    assert advice([reworded], ENGLISH) == []
    assert len(advice([phrase("force_flag.slip")], ENGLISH)) == 1


@pytest.mark.parametrize("stored", [False, True])
def test_another_magnet_is_put_away_and_no_cup_moved_for_it(stored: bool) -> None:
    doubtful = phrase("measure.share_of_samples", what=PLACE_WORDS[PlaceFlag.DOUBTFUL], share=77.0)
    reason = join([doubtful, PLACE_WORDS[PlaceFlag.OUT_OF_REACH]])
    told = advice([read_back("".join(reason)) if stored else reason], ENGLISH)
    assert len(told) == 1
    assert told[0].startswith("Keep phones, watches, tools and other magnets half a metre")
    assert "nearer to the trunk" in advice([PLACE_WORDS[PlaceFlag.OUT_OF_REACH]], ENGLISH)[0]


def test_advice_is_for_codes_that_there_are_and_has_words_in_every_language() -> None:
    assert ADVICE.keys() <= english_texts().keys()
    for code in languages():
        own = json.loads(
            files("handscope.app.language").joinpath(f"{code}.json").read_text("utf-8")
        )["words"]
        assert {f"advice.{what}" for what in ADVICE.values()} <= own.keys()


@pytest.mark.parametrize("words", [*FORCE_WORDS.values(), *PLACE_WORDS.values()])
def test_every_flag_of_a_force_or_place_has_advice(words: str) -> None:
    assert advice([words], ENGLISH)
