"""The dictionary keeps REDCap's own rules of columns, and the records fit the dictionary."""

import csv
import io
import re
from collections.abc import Callable

from handscope.sessions.exports import export
from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.exports.redcap import HEADINGS

TYPES = {"text", "notes", "calc", "dropdown", "radio", "checkbox", "yesno", "truefalse"}
VALIDATIONS = {"", "number", "integer", "date_ymd", "datetime_ymd"}


def _rows(data: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(data.decode())))


def test_the_dictionary_keeps_the_rules_of_its_columns(exported: Callable[[str], Exported]) -> None:
    data = exported("redcap").files["dictionary.csv"]
    assert tuple(next(csv.reader(io.StringIO(data.decode())))) == HEADINGS
    assert len(HEADINGS) == 18
    rows = _rows(data)
    names = [row["Variable / Field Name"] for row in rows]
    assert names[0] == "record_id"
    assert len(set(names)) == len(names)
    for row in rows:
        assert re.fullmatch(r"[a-z][a-z0-9_]{0,25}", row["Variable / Field Name"])
        assert re.fullmatch(r"[a-z][a-z0-9_]*", row["Form Name"])
        assert row["Field Type"] in TYPES
        assert row["Field Label"]
        validation = row["Text Validation Type OR Show Slider Number"]
        assert validation in VALIDATIONS
        assert not validation or row["Field Type"] == "text"
        choices = row["Choices, Calculations, OR Slider Labels"]
        assert bool(choices) == (row["Field Type"] in ("dropdown", "radio", "checkbox"))
        assert all(re.fullmatch(r"\d+, .+", c) for c in choices.split(" | ") if c)


def test_records_fit_the_dictionary(
    exported: Callable[[str], Exported], measured: Measured
) -> None:
    files = exported("redcap").files
    fields = {row["Variable / Field Name"]: row for row in _rows(files["dictionary.csv"])}
    records = _rows(files["records.csv"])
    assert len(records) == sum(len(t.figures) for t in measured.tasks)
    special = {"redcap_repeat_instrument", "redcap_repeat_instance"}
    for record in records:
        assert set(record) == set(fields) | special
        for name, value in record.items():
            if value and name in fields:
                row = fields[name]
                if row["Text Validation Type OR Show Slider Number"] == "number":
                    float(value)
                if choices := row["Choices, Calculations, OR Slider Labels"]:
                    assert value in [c.split(",")[0] for c in choices.split(" | ")]
    figures = {f.name: f for t in measured.tasks for f in t.figures}
    row = next(r for r in records if r["hs_figure"] == "index_mcp_flexion_max")
    assert abs(float(row["hs_value"]) - figures["index_mcp_flexion_max"].value) < 1e-8
    assert row["hs_sd"]
    assert row["hs_sha256"] == measured.origin.checksum
    assert row["hs_simulated"] == "1"


def test_without_tasks_there_are_no_records_and_a_sentence_says_so(measured: Measured) -> None:
    from dataclasses import replace

    made = export(replace(measured, tasks=()), "redcap")
    assert _rows(made.files["records.csv"]) == []
    assert made.notices
