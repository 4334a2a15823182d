"""Figures of progress in words of both languages, never by their keys."""

import pytest

from handscope.app.language import languages
from handscope.app.report.progress.labels import label


@pytest.mark.parametrize(
    ("name", "english", "german"),
    [
        (
            "index_tam",
            "Index: total active motion (TAM)",
            "Zeigefinger: aktiver Gesamtbewegungsumfang (TAM)",
        ),
        ("tapping_rate", "Rate", "Frequenz"),
        (
            "index_dip_extension_deficit",
            "Index DIP: extension deficit",
            "Zeigefinger DIP: Streckdefizit",
        ),
        ("ring_pip_flexion_max", "Ring PIP, flexion", "Ringfinger PIP, Beugung"),
    ],
)
def test_a_figure_is_named_in_words(name: str, english: str, german: str) -> None:
    assert (label(name, languages()["en"]), label(name, languages()["de"])) == (english, german)
