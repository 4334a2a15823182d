"""Why a self-calibration found nothing is said in the reader's language."""

from types import SimpleNamespace
from typing import Any

import pytest

from handscope.app.language import languages
from handscope.app.workers.self_calibration import _outcome
from handscope.estimators.messages.sentence import codes_of, phrase
from handscope.estimators.pipeline import process
from tests.simulated import in_strips


def test_several_reasons_keep_their_codes(monkeypatch: pytest.MonkeyPatch) -> None:
    reasons = (phrase("flag.lost"), phrase("flag.missing"))
    processed = SimpleNamespace(calibrations=(None,), method_messages=reasons)

    def found(*_: Any, **__: Any) -> Any:
        return processed

    monkeypatch.setattr(process, "process", found)
    monkeypatch.setattr(
        "handscope.app.report.sections.self_calibration.found_calibration", lambda *_: None
    )
    kind, refusal = _outcome(in_strips("left"), None)  # type: ignore[arg-type]
    assert (kind, codes_of(refusal)) == ("refusal", {"flag.lost", "flag.missing"})
    german = languages()["de"]
    assert german.translate(refusal) == "; ".join(german.translate(r) for r in reasons)
