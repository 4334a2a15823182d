"""The report among the patient's sessions: the other hand, the course, the standard deviation; and the same as HTML."""

import hashlib
import re
from dataclasses import replace
from datetime import timedelta
from functools import cache

from handscope.app.language import ENGLISH, languages
from handscope.app.report import FORMS, Style
from handscope.app.report.changes import Change, Changes
from handscope.app.report.content import Content, LeftOut
from handscope.app.report.page import Page, words_of
from handscope.app.report.pdf import pdf
from handscope.app.report.units import DEG
from handscope.app.results.headlines import headlines
from handscope.app.results.make import figure_rows
from handscope.sessions.clinic.references import Course
from handscope.sessions.clinic.references import Visit as Past
from handscope.sessions.clinic.repeatability import Values, values
from tests.app.report.simulated_sessions import VISIT, report, session
from tests.app.report.test_pdf import MORNING, NASTY, pages, printed

GERMAN = languages()["de"]
PIP = ("range_of_motion", "rom_fist", "ring_pip_flexion_max")


def more(now: Values, degrees: float) -> Values:
    """The same figures with the ring finger's PIP joint bent further."""
    value, unit = now[PIP]
    return now | {PIP: (value + degrees / DEG, unit)}


@cache
def among(sessions: int) -> Content:
    """A session that is the last of so many, each a degree better than the one before; the other hand bends the ring finger 20° more."""
    assert VISIT.date is not None
    now = values([f for t in session()[2] for f in figure_rows(t)])
    past = [
        Past(VISIT.date - timedelta(days=7 * k), more(now, -float(k)))
        for k in reversed(range(1, sessions))
    ]
    course = Course(
        (*past, Past(VISIT.date, now)), Past(VISIT.date - timedelta(days=1), more(now, 20.0))
    )
    return replace(report(), course=course)


def row(page: Page, finger: str, joint: str) -> dict[str, str]:
    """Cells of a joint by group and kind of column."""
    table, at = page["ranges"][0]["table"], ""
    for told in table["rows"]:
        at = told["finger"] or at
        if (at, told["joint"]) == (finger, joint):
            return {
                f"{c['group']} {c['kind']}": cell[0]
                for c, cell in zip(table["columns"], told["cells"])
            }
    raise AssertionError(f"no {finger} {joint}")


def test_the_other_hand_and_the_reference_stand_beside_the_value() -> None:
    page = words_of(among(2), ENGLISH)
    cells = row(page, "Ring", "PIP")
    own = int(cells["flexion value"].partition("°")[0])
    assert cells["flexion other"] == f"{own + 20}°"
    assert cells["flexion reference"] == "100–110°"
    assert (
        "Less than the right hand of 20 November 2026, 10:32 UTC, by more than 12°: Ring PIP flexion by 20°."
        in page["summary"]
    )


def test_without_the_other_hand_there_is_no_column_for_it() -> None:
    table = words_of(report(), ENGLISH)["ranges"][0]["table"]
    assert {c["kind"] for c in table["columns"]} == {"value", "reference"}


def test_a_standard_deviation_stands_with_its_value() -> None:
    tasks = tuple(
        replace(
            t,
            result=replace(
                t.result, figures=tuple(replace(f, sd=2.14 / DEG) for f in t.result.figures)
            ),
        )
        for t in report().tasks
    )
    assert re.fullmatch(
        r"\d+° ± 2\.1°",
        row(words_of(replace(report(), tasks=tasks), ENGLISH), "Ring", "PIP")["flexion value"],
    )
    assert re.fullmatch(
        r"\d+° ± 2,1°",
        row(words_of(replace(report(), tasks=tasks), GERMAN), "Ringfinger", "PIP")["flexion value"],
    )


def test_the_course_begins_with_the_third_session() -> None:
    assert words_of(among(2), ENGLISH)["trends"] == []
    (trends,) = words_of(among(3), ENGLISH)["trends"]
    assert trends["task"] == "3 sessions, 7 November 2026 to 21 November 2026"
    assert {"Rate", "Amplitude, mean"} <= {c["title"] for c in trends["charts"]}


def test_a_charts_title_names_the_finger_in_the_readers_language() -> None:
    among_three = among(3)
    assert among_three.course is not None
    tam = "total_active_motion", "rom_fist", "index_tam"
    assert all(tam in visit.values for visit in among_three.course.visits)
    judged = Change(*tam, 5.0, "deg", 4.0, "own", ())
    changed = replace(among_three, changes=Changes(MORNING, (judged,)))
    (trends,) = words_of(changed, GERMAN)["trends"]
    assert "Zeigefinger: aktiver Gesamtbewegungsumfang (TAM)" in {
        c["title"] for c in trends["charts"]
    }


def test_what_changed_most_is_read_first_and_named_in_short() -> None:
    tam = "total_active_motion", "rom_fist", "ring_tam"
    turn = Change(*PIP, 9.0, "deg", 12.0, "published", ())
    changes = Changes(MORNING, (turn, Change(*tam, -5.0, "deg", 4.0, "own", ())))
    page = words_of(replace(among(3), changes=changes), ENGLISH)
    first, *others = page["key_figures"]
    assert first["label"] == "Ring: total active motion (TAM)" and first["beyond"]
    assert first["change"] == "5° lower since 12 May 2026"
    assert "Rate" in {figure["label"] for figure in others}  # each measure in turn
    sentence = "1 of 2 figures changed by more than measurement error: Ring: total active motion (TAM) 5° lower."
    assert any(sentence in said for said in page["summary"])


def test_the_figures_read_first_have_the_deviation_that_the_page_shows() -> None:
    content = report()
    page = words_of(content, ENGLISH)
    rows = [(t.result.task, t.result.measure, f) for t in content.tasks for f in t.result.figures]
    titles = {t.result.task: t.title for t in content.tasks}
    tiles = {
        (task["title"], tile["label"]): tile["sd"]
        for task in headlines(rows, titles, ENGLISH, None, None, None)
        for tile in task["tiles"]
    }
    shown = {(f["task"], f["label"]): f["sd"] for f in page["key_figures"]}
    both = shown.keys() & tiles.keys()  # a range leads on the page where its task has no other
    assert both and {key: tiles[key] for key in both} == {key: shown[key] for key in both}
    known = [sd for sd in shown.values() if sd]
    text, html = printed(pdf(content, ENGLISH)), FORMS["html"](content, Style()).decode()
    assert known and all(sd in text and sd in html for sd in known)


def test_twenty_sessions_are_a_report_of_few_pages() -> None:
    assert pages(pdf(among(20), ENGLISH)) <= 4


def test_what_was_taken_out_by_hand_is_told_with_its_reason() -> None:
    left_out = LeftOut("Finger tapping", "exclude", 12.0, 27.5, "talked meanwhile")
    text = printed(pdf(replace(report(), left_out=(left_out,)), ENGLISH))
    assert "Finger tapping trial left out 12.0 to 27.5 s talked meanwhile" in text


def test_the_examiners_own_score_stands_in_the_report_and_in_its_json() -> None:
    recording, processed, results = session()
    scored = tuple(
        replace(e, details={**e.details, "score": 2, "score_title": "MDS-UPDRS 3.4"})
        if e.details.get("task_name") == "tapping"
        else e
        for e in recording.events
    )
    made = report((replace(recording, events=scored), processed, results))
    assert "The examiner’s own scores Finger tapping MDS-UPDRS 3.4 2" in printed(
        pdf(made, ENGLISH)
    ).replace("'", "’")
    assert b'"score": 2' in FORMS["json"](made, Style())


def test_the_report_names_the_checksum_of_its_json() -> None:
    sums = dict(words_of(report(), GERMAN)["checksums"])
    assert sums["Größen (JSON)"] == hashlib.sha256(FORMS["json"](report(), Style())).hexdigest()


def test_html_says_what_the_pdf_says_and_loads_nothing() -> None:
    made = FORMS["html"](among(3), Style(GERMAN)).decode()
    assert made == FORMS["html"](among(3), Style(GERMAN)).decode()
    for words in (
        *words_of(among(3), GERMAN)["summary"],
        "Bewegungsumfang",
        "Verlauf",
        "Unterschrift",
    ):
        assert words in made
    assert re.findall(r"<script|<link|<iframe|<img|@import|(?:src|href)=\"(?!#)", made) == []
    assert set(re.findall(r"url\(([^)]*)\)", made)) <= {
        f"#{name}" for name in re.findall(r'id="([^"]+)"', made)
    }
    names = re.findall(r'id="([^"]+)"', made)
    assert len(names) == len(set(names))


def test_html_prints_text_literally() -> None:
    made = FORMS["html"](
        report(visit=replace(VISIT, patient="<i>P</i>", notes=NASTY)), Style()
    ).decode()
    assert "&lt;i&gt;P&lt;/i&gt;" in made
    assert "<i>P" not in made
    assert "<b>x</b>" not in made


def test_the_report_is_german_throughout() -> None:
    text = printed(pdf(replace(among(3), visit=replace(VISIT, notes="")), GERMAN))
    english = "Flexion|Extension|Range|Joint|Signature|Provenance|Finger tapping|Rate|Trial|unchanged|within|session|good|full"
    assert re.findall(rf"\b({english})\b", text.replace("Salchow-Hoemmen", "")) == []
    assert re.search(r"Frequenz 2,\d\d pro s", text)
