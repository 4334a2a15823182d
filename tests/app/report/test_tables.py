"""CSV and JSON hold exactly what was measured, with units and signs stated."""

import csv as csv_format
import io
import json as json_format
import math
from dataclasses import replace
from typing import Any

import pytest

from handscope.app.report.tables import COLUMNS, csv, json
from handscope.app.report.units import reading
from handscope.estimators.measures.figure import Figure
from tests.app.report.simulated_sessions import CHECKSUM, VISIT, report, session


def parsed(made: bytes) -> tuple[list[str], list[dict[str, str]]]:
    """Comment lines and rows."""
    lines = made.decode().splitlines(keepends=True)
    comments = [line[2:].rstrip("\n") for line in lines if line.startswith("# ")]
    return comments, list(
        csv_format.DictReader(
            io.StringIO("".join(line for line in lines if not line.startswith("# ")))
        )
    )


def with_figure(figure: Figure, task: str = "rom") -> Any:
    recording, processed, results = session()
    return report((recording, processed, (replace(results[0], task=task, figures=(figure,)),)))


def test_a_row_a_figure_with_the_value_exactly_as_measured() -> None:
    _, rows = parsed(csv(report()))
    figures = [(r, f) for r in session()[2] for f in r.figures]
    assert len(rows) == len(figures) > 100
    for row, (result, f) in zip(rows, figures):
        assert (row["task"], row["measure"], row["name"], row["unit_si"]) == (
            result.task,
            result.measure,
            f.name,
            f.unit,
        )
        assert float(row["value_si"]) == f.value
        assert float(row["value"]) == reading(f).value
        assert (float(row["onset_s"]), float(row["end_s"])) == (result.onset, result.end)
        assert (row["grade"], row["reason"], row["source"]) == (f.grade, f.reason, f.source)


@pytest.mark.parametrize(
    ("name", "unit", "value", "read", "read_unit"),
    [
        ("index_pip_flexion_max", "rad", math.pi / 2, 90.0, "deg"),
        ("tapping_amplitude_mean", "m", 0.05, 50.0, "mm"),
        ("tapping_opening_speed_mean", "m/s", 0.5, 500.0, "mm/s"),
        ("tapping_interval_cv", "1", 0.12, 12.0, "%"),
        ("tapping_decrement_ratio", "1", -0.3, -30.0, "%"),
        ("tapping_count", "1", 37.0, 37.0, ""),
        ("tapping_rate", "Hz", 2.5, 2.5, "Hz"),
    ],
)
def test_values_are_read_in_degrees_and_millimetres(
    name: str, unit: str, value: float, read: float, read_unit: str
) -> None:
    _, (row,) = parsed(csv(with_figure(Figure(name, value, unit, "here"))))
    assert float(row["value"]) == pytest.approx(read, rel=1e-12)
    assert row["unit"] == read_unit


def test_what_was_not_measured_is_empty_and_says_why() -> None:
    c = with_figure(
        Figure("tapping_decrement_slope", math.nan, "m", "here", None, "poor", "too few taps")
    )
    _, (row,) = parsed(csv(c))
    assert (row["value"], row["value_si"], row["reason"]) == ("", "", "too few taps")
    (figure,) = json_format.loads(json(c))["figures"]
    assert figure["value"] is None
    assert figure["value_si"] is None


def test_a_standard_deviation_is_written_where_it_is_known() -> None:
    _, (row,) = parsed(csv(with_figure(Figure("a", 1.0, "rad", "here", 0.02))))
    assert float(row["sd_si"]) == 0.02


def test_the_header_states_signs_session_and_recording() -> None:
    comments, _ = parsed(csv(report()))
    said = "\n".join(comments)
    for words in (
        "flexion, ulnar deviation and pronation are positive",
        "Research use; not a medical device.",
        f"recording sha256: {CHECKSUM}",
        "patient: P-0042",
        "hand: left",
        "options: defaults",
    ):
        assert words in said


def test_text_cannot_break_a_line_or_run_as_a_formula() -> None:
    c = with_figure(Figure("a", -1.0, "s", 'com,ma "quoted"\nline'), task="=1+1")
    c = replace(c, visit=replace(VISIT, patient="P\n1,2,3"))
    comments, (row,) = parsed(csv(c))
    assert "patient: P 1,2,3" in comments
    assert row["task"] == "'=1+1"
    assert row["source"] == 'com,ma "quoted"\nline'
    assert row["value"] == "-1.0"  # a number stays a number


def test_json_holds_the_same_rows_and_the_provenance() -> None:
    value = json_format.loads(json(report()))
    _, rows = parsed(csv(report()))
    assert [list(f) for f in value["figures"]] == [list(COLUMNS)] * len(rows)
    assert [f["value_si"] for f in value["figures"]] == [float(r["value_si"]) for r in rows]
    assert value["recording"]["checksum"] == CHECKSUM
    assert value["method"]["name"] == "m2"
    assert set(value["calibrations"][0]["sensors"]) == set(session()[1].calibrations[0].quality)
    assert value["session"]["notes"] == VISIT.notes
    assert value["notice"].startswith("Research use; not a medical device.")


def test_tables_are_the_same_bytes_for_the_same_content() -> None:
    assert csv(report()) == csv(report())
    assert json(report()) == json(report())
