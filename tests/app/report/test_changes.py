"""Changes since the session before: judged by the patient's own repeatability, else the glove's, else what is published; words on page and print."""

import re
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import orjson
import pytest

from handscope.app.language import ENGLISH
from handscope.app.protocols import load_all
from handscope.app.report import FORMS, Style
from handscope.app.report.changes import Changes, changes
from handscope.app.report.content import Content
from handscope.app.report.units import DEG
from handscope.app.results.make import _task, figure_rows
from handscope.app.results.result_view import readings
from handscope.sessions.clinic.repeatability import Comparison, Key, Values, values
from handscope.sessions.db.tables import Repeatability
from tests.app.report.simulated_sessions import NORMAL, report, session
from tests.app.report.test_pdf import pages, text_of

PIP: Key = ("range_of_motion", "rom_fist", "index_pip_flexion_max")
EXTENSION: Key = ("range_of_motion", "rom_fist", "index_pip_flexion_min")
RATE: Key = ("tapping", "tapping", "tapping_rate")
AMPLITUDE: Key = ("tapping", "tapping", "tapping_amplitude_mean")
MAY = datetime(2026, 5, 12, 9, tzinfo=UTC)


def row(mdc95: float, freedom: int = 4, patient: int | None = 1, people: int = 1) -> Repeatability:
    return Repeatability(
        mdc95=mdc95, freedom=freedom, patient_id=patient, people=people, sessions=freedom + people
    )


def judged(difference: float, key: Key = PIP, unit: str = "rad", **kept: Any) -> Any:
    found = changes(
        Comparison(
            MAY,
            {key: (1.0 + difference, unit)},
            {key: (1.0, unit)},
            kept.get("own", {}),
            kept.get("glove", {}),
        )
    )
    assert found is not None
    return found.each[0]


def test_the_patients_own_goes_before_the_gloves_and_that_before_what_is_published() -> None:
    own, glove = {PIP: row(5 / DEG)}, {PIP: row(7 / DEG, 6, None, 3)}
    assert (
        judged(6 / DEG, own=own, glove=glove).basis,
        judged(6 / DEG, own=own, glove=glove).beyond,
    ) == ("own", True)
    assert (judged(6 / DEG, glove=glove).basis, judged(6 / DEG, glove=glove).beyond) == (
        "glove",
        False,
    )
    published = judged(6 / DEG)
    assert (published.basis, published.mdc95, published.beyond) == ("published", 12, False)
    assert "Reissner 2019" in published.sources[0]
    assert "until 5 sessions within a week" in published.sources[1]
    assert judged(-12.1 / DEG).beyond


@pytest.mark.parametrize("kept", [row(5 / DEG, 3), row(0.0), row(5 / DEG, 8, None, 1)])
def test_too_few_sessions_one_person_and_no_spread_are_not_judged_by(kept: Repeatability) -> None:
    assert judged(6 / DEG, own={PIP: kept}).basis == "published"


def test_tapping_has_a_published_value_for_its_rate_only() -> None:
    assert (judged(1.3, RATE, "Hz").mdc95, judged(1.3, RATE, "Hz").beyond) == (1.26, True)
    assert (judged(0.01, AMPLITUDE, "m").basis, judged(0.01, AMPLITUDE, "m").beyond) == (
        "none",
        False,
    )
    assert judged(0.01, AMPLITUDE, "m", own={AMPLITUDE: row(0.004)}).mdc95 == pytest.approx(4)  # mm


def test_what_only_one_session_has_is_not_compared() -> None:
    assert changes(Comparison(MAY, {PIP: (1.0, "rad")}, {RATE: (3.0, "Hz")}, {}, {})) is None


def before(now: Values) -> Changes:
    """The same session a while ago: the index finger's PIP joint bent 15 deg less and extended 3 deg more, tapping slower by 0.4 per s."""
    then = now | {
        PIP: (now[PIP][0] - 15 / DEG, "rad"),
        EXTENSION: (now[EXTENSION][0] - 3.0 / DEG, "rad"),
        RATE: (now[RATE][0] - 0.4, "Hz"),
    }
    found = changes(Comparison(MAY, now, then, {EXTENSION: row(2.0 / DEG)}, {}))
    assert found is not None
    return found


def compared(tasks: tuple[str, ...] = NORMAL) -> tuple[Content, dict[str, Any]]:
    """The report, and what the page reads."""
    made = session(tasks)
    figures = [figure for t in made[2] for figure in figure_rows(t)]
    found = before(values(figures))
    return replace(report(made), changes=found), readings(
        {"tasks": [_task(t) for t in made[2]]}, figures, load_all(), ENGLISH, found
    )


def test_the_page_says_it_beside_every_figure() -> None:
    told = compared()[1]
    (pip,) = [r for r in told["ranges"][0]["rows"] if (r["group"], r["joint"]) == ("Index", "PIP")]
    assert pip["changes"] == {
        "flexion": "15° more, beyond MDC 12°",
        "extension": "3° less, beyond the patient's own MDC 2°",
        "sideways": "",
    }
    (mcp,) = [r for r in told["ranges"][0]["rows"] if (r["group"], r["joint"]) == ("Little", "MCP")]
    assert mcp["changes"]["sideways"] == "add. unchanged; abd. unchanged"
    assert told["changes"]["since"] == MAY
    (tapping,) = told["changes"]["tapping"]
    words = {f["name"]: f["words"] for f in tapping["figures"]}
    assert words["tapping_rate"] == "0.40 per s higher, within MDC"
    assert words["tapping_amplitude_mean"] == "unchanged"
    judged = [f["judged"] for f in tapping["figures"]]
    assert judged == sorted(judged, reverse=True) and len(set(judged)) == 2
    assert any("no MDC is published" in s for s in told["changes"]["sources"]["tapping"])
    assert not any(
        "no MDC is published" in s for s in told["changes"]["sources"]["range_of_motion"]
    )


def test_the_pdf_says_it_what_is_beyond_first() -> None:
    content = compared()[0]
    text = text_of(content).replace("’", "'")
    beyond = "Index PIP extension 3° less (the patient's own MDC 2°), flexion 15° more."
    assert (
        f"Since the session of 12 May 2026, 09:00 UTC, beyond what repeated measurement gives (MDC95): {beyond} Within it: all 42 others."
        in text
    )
    assert (
        "MDC of a joint's angle: 12° (Reissner 2019). Published MDCs stand in until 5 sessions within a week"
        in text
    )
    assert text.count("Published MDCs stand in") == 1
    assert (
        "gives (MDC95): nothing. Within it: Rate 0.40 per s higher. All others unchanged." in text
    )
    assert "from sessions repeated within a week (5)" in text
    assert pages(FORMS["pdf"](content, Style())) == 3


def test_changes_of_every_figure_of_three_trials_are_printed() -> None:
    made = session((*NORMAL, "tapping", "tapping"))
    now = values([f for t in made[2] for f in figure_rows(t)])
    rng = np.random.default_rng(1)
    then: Values = {
        key: (value + rng.normal(0, 5 / DEG if unit == "rad" else 0.1 * abs(value)), unit)
        for key, (value, unit) in now.items()
    }
    content = replace(report(made), changes=changes(Comparison(MAY, now, then, {}, {})))
    assert pages(FORMS["pdf"](content, Style())) == 3
    text = text_of(content)
    assert re.search(r"Within it: all \d\d", text)
    assert re.search(r"Not judged: \d\d figures\.", text)  # each stands in the tables


def test_the_tables_for_programs_say_it_in_numbers() -> None:
    content = compared()[0]
    told = orjson.loads(FORMS["json"](content, Style()))["changes"]
    (pip,) = [c for c in told["each"] if c["name"] == PIP[2] and c["task"] == PIP[1]]
    assert (round(pip["value"], 6), pip["unit"], pip["mdc95"], pip["basis"]) == (
        15.0,
        "deg",
        12.0,
        "published",
    )
    assert told["since"].startswith("2026-05-12")


def test_with_nothing_to_compare_with_nothing_is_said() -> None:
    assert "Since " not in text_of(report())
    made = session()
    told = readings(
        {"tasks": [_task(t) for t in made[2]]},
        [f for t in made[2] for f in figure_rows(t)],
        load_all(),
        ENGLISH,
    )
    assert told["changes"] is None
    assert all(r["changes"] == {} for table in told["ranges"] for r in table["rows"])
