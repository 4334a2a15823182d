"""Texts that the first edition stored as finished English sentences get their codes and values back when a row is read."""

import re

import pytest
from sqlalchemy import Column, Integer, MetaData, Table, create_engine, select, text

from handscope.app.language import languages
from handscope.estimators.messages import GAP, Text, english_texts
from handscope.estimators.messages.sentence import Sentence, codes_of, messages_of, phrase
from handscope.sessions.clinic.corrections import REDACTED, without_reasons
from handscope.sessions.db.earlier_texts import TextsWithCodes, TextWithCodes, read_back

GERMAN = languages()["de"]
BRIDGED = "samples missing and bridged in 12 % of the samples"
SLIPPED = "the object slipped"
CARRIED = "part of the load does not change with the acceleration: something not measured carries the object"


def finished(text: str, count: str) -> str:
    """With a word or a number in each gap, as it was stored."""

    def value(gap: re.Match[str]) -> str:
        if gap[3]:
            return format(3 if gap[3] == "x" else 3.0, gap[3])
        return count if gap[1] == "count" else "'q'" if gap[2] else "q"

    return GAP.sub(value, text)


def forms(words: Text) -> list[str]:
    """Finished sentences of a code: for one and for several where it counts."""
    if isinstance(words, str):
        return [finished(words, "3")]
    return [finished(text, "1" if form == "one" else "3") for form, text in words.items()]


def test_nearly_every_text_is_known_again_to_the_letter() -> None:
    """A number without a form is a word here; several codes have the same words, and what stands between two is no text."""
    texts = [text for words in english_texts().values() for text in forms(words)]
    assert [t for t in texts if read_back(t) != t] == []
    known = [t for t in texts if isinstance(read_back(t), Sentence)]
    assert len(known) > 0.95 * len(texts), [t for t in texts if t not in known]
    assert [t for t in known if not codes_of(read_back(t))] == []


def test_values_are_read_back_as_they_were() -> None:
    (bridged,) = messages_of(read_back(BRIDGED))
    assert (bridged.code, bridged.values["share"]) == ("measure.share_of_samples", 12.0)
    assert codes_of(bridged.values["what"]) == {"flag.missing"}  # type: ignore[arg-type]


def test_several_texts_in_one_are_told_apart_though_one_has_a_colon() -> None:
    together = read_back(f"{CARRIED}; said by a person; {SLIPPED}")
    assert codes_of(together) == {"lift.carried", "force_flag.slip"}
    assert GERMAN.translate(together).split("; ")[1:] == [
        "said by a person",
        GERMAN.translate(phrase("force_flag.slip")),
    ]


@pytest.mark.parametrize("words", ["", "Calm, a little tired.", "12", "a: b", "x" * 5000])
def test_words_of_others_stay_words(words: str) -> None:
    assert not isinstance(read_back(words), Sentence)


def test_a_persons_reason_is_still_found_in_an_earlier_sentence() -> None:
    reason = "12"
    sentence = read_back(str.__str__(phrase("correction.excluded", trial="tapping", reason=reason)))
    assert isinstance(sentence, Sentence)
    assert REDACTED in without_reasons(sentence, [{"reason": reason}])


def test_a_stored_row_has_codes_in_either_edition() -> None:
    table = Table(
        "rows",
        MetaData(),
        Column("id", Integer, primary_key=True),
        Column("d", TextsWithCodes),
        Column("error", TextWithCodes),
    )
    engine = create_engine("sqlite://")
    table.create(engine)
    reason = phrase("force_flag.slip")
    rows = [{"name": SLIPPED, "reason": reason, "more": {"warnings": [reason, "else"]}}]
    with engine.begin() as connection:
        connection.execute(table.insert(), [{"d": rows, "error": reason}])
        first_edition = text("insert into rows (d, error) values (:d, :error)")
        plain = f'[{{"name": "{SLIPPED}", "reason": "{SLIPPED}", "more": {{"warnings": ["{SLIPPED}", "else"]}}}}]'
        connection.execute(first_edition, {"d": plain, "error": SLIPPED})
        connection.execute(first_edition, {"d": f'["{SLIPPED}"]', "error": "{ other words"})
        new, old, warnings = connection.execute(select(table.c.d, table.c.error)).all()
    for (row,), error in (new, old):
        assert codes_of(row["reason"]) == codes_of(error) == {"force_flag.slip"}
        assert codes_of(row["more"]["warnings"][0]) == {"force_flag.slip"}
        assert not isinstance(row["name"], Sentence)  # not a text of ours by its key
    assert codes_of(warnings[0][0]) == {"force_flag.slip"} and warnings[1] == "{ other words"
