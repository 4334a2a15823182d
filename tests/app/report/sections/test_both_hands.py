"""Both hands of one visit side by side, in the words that a report has elsewhere."""

from datetime import UTC, datetime
from types import SimpleNamespace

import pytest

from handscope.app.language import languages
from handscope.app.report.sections.both_hands import both_hands_section

DEG = 3.141592653589793 / 180
MOMENT = datetime(2026, 11, 24, 10, 12, tzinfo=UTC)


@pytest.mark.parametrize(
    ("own", "other", "cells"),
    [
        (-42.0, -46.0, ["42°", "46°", "91 %"]),
        (-42.0, 8.0, ["42°", "8° extension deficit", "–"]),
    ],
)
def test_extension_has_its_size_in_both_hands_and_no_bare_sign(
    own: float, other: float, cells: list[str]
) -> None:
    key = ("range_of_motion", "rom_wrist", "wrist_flexion_min")
    values = [{key: (value * DEG, "rad")} for value in (own, other)]
    course = SimpleNamespace(
        visits=[SimpleNamespace(values=values[0])],
        other=SimpleNamespace(values=values[1], started=MOMENT),
    )
    content = SimpleNamespace(
        course=course, later_hand=None, same_visit=True, tasks=[], hand="left"
    )
    found = both_hands_section(content, languages()["en"])  # type: ignore[arg-type]
    assert found is not None
    ((_, *row),) = found["parts"][0]["rows"]
    assert row == cells
