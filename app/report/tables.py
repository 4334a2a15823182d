"""The report's figures as tables for programs and spreadsheets: CSV and JSON, a row a figure, signs and units stated.

Values stand twice: in SI, exactly as measured, and in the unit a person reads. A value that was not measured is empty (CSV) or null (JSON).
"""

import hashlib
import math
from typing import Any

import orjson

from handscope.app.language import ENGLISH
from handscope.app.report.content import Content
from handscope.app.report.units import reading
from handscope.estimators.messages.sentence import add_codes, codes_of, phrase
from handscope.sessions.tables_io.spreadsheet import write_table

SIGNS = (
    phrase("table_note.signs"),
    phrase("table_note.abduction"),
    phrase("table_note.thumb"),
    phrase("table_note.units"),
)
COLUMNS = (
    "task", "onset_s", "end_s", "measure", "name", "value", "unit", "value_si", "sd_si", "unit_si", "grade", "reason", "source", "reason_codes", "source_codes"
)  # fmt: skip
TAG, NOTICE = ENGLISH.say("notice.short"), ENGLISH.say("notice")


def csv(content: Content) -> bytes:
    """UTF-8, comment lines (#) before the header; nothing in it is a formula (sessions/tables_io/spreadsheet.py)."""
    figures = ([row[column] for column in COLUMNS] for row in rows(content))
    return write_table(COLUMNS, figures, _preamble(content))


def json(content: Content) -> bytes:
    """The same rows with the session, the calibration and the provenance; keys in a fixed order, codes beside texts of ours."""
    return orjson.dumps(
        add_codes(
            {
                "notice": f"{TAG} {NOTICE}",
                "signs": SIGNS,
                "session": _session(content),
                "recording": content.recording,
                "method": content.method,
                "calibrations": content.calibrations,
                "measured_segments": content.measured,
                "flagged": content.flagged,
                "warnings": content.warnings,
                "changes": content.changes,
                "compared_with": _comparison_table(content),
                "scores": content.scores,
                "not_done": content.not_done,
                "left_out": content.left_out,
                "self_calibration": content.self_calibration,
                "figures": rows(content),
            }
        ),
        default=str,
        option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_INDENT_2,
    )


def data_checksum(content: Content) -> str:
    """SHA-256 of the JSON file: the same figures, whoever prints them."""
    return hashlib.sha256(json(content)).hexdigest()


def rows(content: Content) -> list[dict[str, Any]]:
    """All figures of all tasks, a dictionary of COLUMNS each; None where not measured."""
    return [
        {
            "task": task.result.task,
            "onset_s": task.result.onset,
            "end_s": task.result.end,
            "measure": task.result.measure,
            "name": f.name,
            "value": _known(reading(f).value),
            "unit": reading(f).unit,
            "value_si": _known(f.value),
            "sd_si": _known(f.sd),
            "unit_si": f.unit,
            "grade": f.grade,
            "reason": f.reason,
            "source": f.source,
            "reason_codes": " ".join(sorted(codes_of(f.reason))),
            "source_codes": " ".join(sorted(codes_of(f.source))),
        }
        for task in content.tasks
        for f in task.result.figures
    ]


def _session(content: Content) -> dict[str, Any]:
    visit = content.visit
    return {
        "patient": visit.patient,
        "hand": content.hand,
        "dominant": visit.dominant,
        "affected": visit.affected,
        "date": content.date.isoformat() if content.date else None,
        "examiner": visit.examiner,
        "recorded_as": visit.recorded_as.isoformat() if visit.recorded_as else None,
        "date_reason": visit.date_reason,
        "notes": visit.notes,
        "conclusion": visit.conclusion,
        "pain_rest": visit.pain.get("rest"),
        "pain_movement": visit.pain.get("movement"),
        "software": content.software,
    }


def _comparison_table(content: Content) -> dict[str, Any] | None:
    found = content.compared
    if found is None:
        return None
    return {
        "version": found.number,
        "made": found.made,
        "chosen_by": found.author,
        "affected_hand": found.affected,
        "session_before": found.before,
        "session_of_other_hand": found.other,
        "edition_of_reference_values": found.edition.number,
    }


def _preamble(content: Content) -> list[str]:
    session = _session(content)
    changed = ", ".join(f"{c.option.name}={c.value}" for c in content.method.changed)
    return [
        TAG,
        *(
            f"{name}: {value}"
            for name, value in session.items()
            if value not in (None, "") and name not in ("notes", "conclusion")
        ),
        f"recording sha256: {content.recording.checksum or 'not known'}",
        f"method: {content.method.name} ({content.method.title}); options: {changed or 'defaults'}",
        *SIGNS,
    ]


def _known(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
