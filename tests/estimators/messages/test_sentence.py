"""English words that keep their messages through files, processes and errors."""

import copy
import json
import pickle
from dataclasses import asdict

import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.measures.figure import Figure
from handscope.estimators.messages import Message
from handscope.estimators.messages.sentence import (
    Sentence,
    codes_of,
    from_plain,
    join,
    messages_of,
    phrase,
    to_plain,
)

GAPS = phrase("measure.share_of_samples", what=phrase("flag.missing"), share=12.5)


def test_a_sentence_is_its_english_text_and_knows_its_codes() -> None:
    assert GAPS == "samples missing and bridged in 12 % of the samples"
    assert codes_of(GAPS) == {"measure.share_of_samples", "flag.missing"}


def test_sentences_told_together_keep_each_ones_codes_and_words_without_a_code_stay_words() -> None:
    together = join([GAPS, "", "as a person wrote it", GAPS])
    assert together == f"{GAPS}; as a person wrote it"
    assert codes_of(together) == codes_of(GAPS)
    assert join([]) == join([""]) == ""


@pytest.mark.parametrize(
    "again",
    [
        lambda s: pickle.loads(pickle.dumps(s)),
        copy.deepcopy,
        lambda s: asdict(Figure("index", 1.0, "rad", "ours", reason=s))["reason"],
        lambda s: from_plain(json.loads(json.dumps(to_plain({"rows": [{"reason": s}]}))))["rows"][
            0
        ]["reason"],
        lambda s: str(InputError(s)),
        lambda s: str(ValueError(s)),
    ],
)
def test_messages_survive_processes_copies_storage_and_errors(again) -> None:  # type: ignore[no-untyped-def]
    assert again(GAPS) == GAPS
    assert codes_of(again(GAPS)) == codes_of(GAPS)


@pytest.mark.parametrize(
    "change", [{"code": "measure.of_a_later_version"}, {"values": {"share": 12.5}}]
)
def test_a_stored_sentence_whose_code_or_values_changed_is_read_as_its_text(
    change: dict[str, object],
) -> None:
    stored = to_plain(GAPS)
    stored["messages"][0] |= change
    read = from_plain(stored)
    assert (read, isinstance(read, Sentence)) == (GAPS, False)


def test_an_error_made_of_a_sentence_has_its_code() -> None:
    assert InputError(GAPS).message == Message(
        "measure.share_of_samples", messages_of(GAPS)[0].values, "fault"
    )


def test_numbers_of_arrays_and_what_is_not_finite_are_stored_as_json_takes_them() -> None:
    np = pytest.importorskip("numpy")
    text = phrase("measure.fewer_than", count=np.int64(3))
    assert json.dumps(to_plain(text), allow_nan=False)
    unknown = phrase("measure.share_of_samples", what="x", share=float("nan"))
    assert from_plain(json.loads(json.dumps(to_plain(unknown), allow_nan=False))) == unknown
