"""REDCap: the figures as a repeating instrument in long form, and the data dictionary that makes its fields.

Source  REDCap's data dictionary template (18 columns) and data import template with repeating instruments
"""

import csv
import io
import math
from collections.abc import Mapping, Sequence

from handscope.app.results.export_content import Content

FORM = "handscope_figure"
COLUMNS = (
    "Variable / Field Name",
    "Form Name",
    "Section Header",
    "Field Type",
    "Field Label",
    "Choices, Calculations, OR Slider Labels",
    "Field Note",
    "Text Validation Type OR Show Slider Number",
    "Text Validation Min",
    "Text Validation Max",
    "Identifier?",
    "Branching Logic (Show field only if...)",
    "Required Field?",
    "Custom Alignment",
    "Question Number (surveys only)",
    "Matrix Group Name",
    "Matrix Ranking?",
    "Field Annotation",
)
GRADES = "good, good | fair, fair | poor, poor"
HANDS = "left, left | right, right"
YES_NO = "no, no | yes, yes"
FIELDS = {  # name: type, label, choices, validation
    "hs_task": ("text", "Task", "", ""),
    "hs_measure": ("text", "Measure", "", ""),
    "hs_onset_s": ("text", "Begin of the task, s", "", "number"),
    "hs_figure": ("text", "Figure", "", ""),
    "hs_part": ("text", "Finger or joint", "", ""),
    "hs_value": ("text", "Value, SI", "", "number"),
    "hs_unit": ("text", "Unit", "", ""),
    "hs_sd": ("text", "Standard deviation, SI", "", "number"),
    "hs_grade": ("radio", "Grade", GRADES, ""),
    "hs_reason": ("notes", "Reason of the grade", "", ""),
    "hs_hand": ("radio", "Hand", HANDS, ""),
    "hs_method": ("text", "Method", "", ""),
    "hs_options": ("text", "Options that were changed", "", ""),
    "hs_software": ("text", "Software", "", ""),
    "hs_recording_sha256": ("text", "SHA-256 of the recording", "", ""),
    "hs_simulated": ("radio", "Simulated", YES_NO, ""),
}


def write(content: Content, subject: str = "1") -> Mapping[str, bytes]:
    """`data_dictionary.csv`, and `data.csv` of one record: a repeated instance a figure."""
    dictionary = [
        {**dict.fromkeys(COLUMNS, ""), **row}
        for row in (
            _row("record_id", ("text", "Record", "", "")),
            *(_row(n, f) for n, f in FIELDS.items()),
        )
    ]
    return {
        "data_dictionary.csv": _csv(COLUMNS, dictionary),
        "data.csv": _csv(
            ("record_id", "redcap_repeat_instrument", "redcap_repeat_instance", *FIELDS),
            _records(content, subject),
        ),
    }


def _row(name: str, field: tuple[str, str, str, str]) -> dict[str, str]:
    kind, label, choices, validation = field
    return {
        "Variable / Field Name": name,
        "Form Name": FORM if name != "record_id" else "record",
        "Field Type": kind,
        "Field Label": label,
        "Choices, Calculations, OR Slider Labels": choices,
        "Text Validation Type OR Show Slider Number": validation,
    }


def _records(content: Content, subject: str) -> list[dict[str, object]]:
    about = {f"hs_{name}": value for name, value in content.provenance.items()}
    return [
        {
            "record_id": subject,
            "redcap_repeat_instrument": FORM,
            "redcap_repeat_instance": k,
            "hs_task": task.task,
            "hs_measure": task.measure,
            "hs_onset_s": f"{task.onset:.3f}",
            "hs_figure": figure.name,
            "hs_part": figure.part,
            "hs_value": f"{figure.value:.9g}" if math.isfinite(figure.value) else "",
            "hs_unit": figure.unit,
            "hs_sd": f"{figure.sd:.6g}"
            if figure.sd is not None and math.isfinite(figure.sd)
            else "",
            "hs_grade": figure.grade,
            "hs_reason": figure.reason,
            **about,
        }
        for k, (task, figure) in enumerate(
            ((task, figure) for task in content.tasks for figure in task.figures), start=1
        )
    ]


def _csv(columns: Sequence[str], rows: Sequence[Mapping[str, object]]) -> bytes:
    file = io.StringIO()
    writer = csv.DictWriter(file, columns, lineterminator="\r\n")
    writer.writeheader()
    writer.writerows(rows)
    return file.getvalue().encode()
