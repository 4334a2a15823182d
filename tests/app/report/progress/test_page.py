"""The progress report: important figures on the first page with goals and treatment, every figure after; a PDF in every language."""

from dataclasses import replace
from datetime import date

import pytest

from handscope.app.language import languages
from handscope.app.protocols import load_all
from handscope.app.report.pdf import pdf_of
from handscope.app.report.progress.page import Patient, Treated, progress_page
from handscope.app.report.progress.series import Progress, progress
from handscope.app.report.progress.stored import LAYOUT
from handscope.sessions.clinic.repeatability import Key
from tests.app.report.progress.test_series import PIP, visit

TAM: Key = ("total_active_motion", "rom_fist", "index_tam")
TREATMENT = [
    Treated("operation", "left", date(2026, 5, 14), "zone II"),
    Treated("splint", "right", date(2026, 5, 20), ""),
]
PATIENT = Patient("H-017", TREATMENT, {("left", PIP): (85.0, 100.0)}, load_all())


def _history() -> Progress:
    found = progress([visit(0, 60), visit(10, 70), visit(20, 82)], load_all())
    assert found is not None
    return found


@pytest.mark.parametrize("code", languages())
def test_the_first_page_shows_what_moved_with_goal_and_treatment(code: str) -> None:
    page = progress_page(_history(), "left", PATIENT, languages()[code])
    assert page is not None
    (chart,) = page["charts"]
    assert chart["value"].startswith("82°") and "82°" in chart["alt"]
    assert (
        ">1<" in chart["chart"] and ">2<" not in chart["chart"]
    )  # the splint was on the other hand
    ((title, (row,)),) = page["tasks"]
    assert title and page["has_goals"]
    assert row[1].startswith("60°") and row[4] == "12°" and "85°" in row[5]
    assert "22°" in row[3] and "22°" in chart["verdict"]
    assert [line[0] for line in page["treatment"]] == ["1", "2"]
    made = pdf_of(page, LAYOUT, "a4", 0)
    assert made.startswith(b"%PDF")


def test_a_hand_that_was_measured_once_has_no_report() -> None:
    assert progress_page(_history(), "right", PATIENT, languages()["en"]) is None


def test_figures_of_unknown_measurement_error_are_counted_apart_and_changes_have_their_size() -> (
    None
):
    found = _history()
    (one,) = found.series
    course = one.hands["left"]
    points = [replace(point, since_first=None) for point in course.points]
    unknown = {"left": replace(course, points=points, judge=replace(course.judge, mdc95=None))}
    both = replace(found, series=(one, replace(one, hands=unknown)))
    page = progress_page(both, "left", PATIENT, languages()["en"])
    assert page is not None
    assert page["verdict"] == (
        "1 of 1 figures changed by more than measurement error since the first session. "
        "1 figure cannot be judged: its measurement error is not known."
    )
    ((_, (row, other)),) = page["tasks"]
    assert row[3] == "22° more, beyond measurement error"
    assert other[3] == "22° more, measurement error not known"
