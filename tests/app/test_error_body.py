"""Answers that refuse have the code and the values beside the sentence, in the reader's language."""

import json

from handscope.app.error_body import error_body
from handscope.app.language import ENGLISH, languages
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.db.conflicts import ConflictError

GERMAN = languages()["de"]


def test_a_conflict_has_its_code_in_every_language() -> None:
    conflict = ConflictError(phrase("conflict.patient_by_code", code="H-017"))
    english, german = error_body(conflict, ENGLISH), error_body(conflict, GERMAN)
    assert english["code"] == german["code"] == "conflict.patient_by_code"
    assert english["values"] == {"code": "H-017"}
    assert english["error"].startswith("patient 'H-017' was changed")
    assert german["error"].startswith("Patient 'H-017' wurde")


def test_words_without_a_code_are_the_sentence_alone() -> None:
    assert error_body(InputError("as another program says"), GERMAN) == {
        "error": "as another program says"
    }


def test_a_value_that_is_no_number_does_not_break_the_answer() -> None:
    body = error_body(phrase("gate.request_too_large", limit=float("nan")), ENGLISH)
    assert json.loads(json.dumps(body, allow_nan=False))["values"] == {"limit": "nan"}
