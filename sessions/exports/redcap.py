"""Figures for REDCap: a data dictionary (dictionary.csv) and the records, one repeat of the instrument a figure (records.csv)."""

from collections.abc import Iterable, Sequence

from handscope.estimators.measures.figure import GRADES
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.tables_io.spreadsheet import write_table

FORM = "handscope_figures"
HEADINGS = (
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
_GRADES = " | ".join(f"{k}, {grade}" for k, grade in enumerate(GRADES, 1))
FIELDS = {  # name: type, label, choices, note, validation
    "record_id": ("text", "Record", "", "pseudonym where one was given", ""),
    "hs_hand": ("dropdown", "Hand measured", "1, left | 2, right", "", ""),
    "hs_task": ("text", "Task", "", "", ""),
    "hs_measure": ("text", "Measure", "", "", ""),
    "hs_onset": ("text", "Begin of the task", "", "s of the recording", "number"),
    "hs_end": ("text", "End of the task", "", "s of the recording", "number"),
    "hs_figure": ("text", "Figure", "", "docs/measures.md of Handscope", ""),
    "hs_value": ("text", "Value", "", "SI; empty where not measured", "number"),
    "hs_sd": ("text", "Standard deviation", "", "in the unit of the value", "number"),
    "hs_unit": ("text", "Unit", "", "", ""),
    "hs_grade": ("dropdown", "Grade", _GRADES, "", ""),
    "hs_reason": ("notes", "Why the grade", "", "", ""),
    "hs_method": ("text", "Method", "", "", ""),
    "hs_options": ("notes", "Options of the method", "", "", ""),
    "hs_software": ("text", "Software", "", "", ""),
    "hs_sha256": ("text", "sha256 of the recording", "", "", ""),
    "hs_start_utc": ("text", "Start of the recording, UTC", "", "ISO 8601", ""),
    "hs_simulated": ("yesno", "Simulated", "", "nobody was measured", ""),
}


def write(measured: Measured) -> Exported:
    """Both files of a folder."""
    notices = () if measured.tasks else (phrase("export.no_task"),)
    return Exported(
        {
            "dictionary.csv": write_table(HEADINGS, _dictionary()),
            "records.csv": write_table(_heading(), _records(measured)),
        },
        notices,
    )


def _dictionary() -> Iterable[Sequence[str]]:
    for name, (kind, label, choices, note, validation) in FIELDS.items():
        yield (name, FORM, "", kind, label, choices, note, validation, *[""] * 10)


def _heading() -> list[str]:
    first, *others = FIELDS
    return [first, "redcap_repeat_instrument", "redcap_repeat_instance", *others]


def _records(measured: Measured) -> Iterable[Sequence[object]]:
    origin = measured.origin
    record = origin.pseudonym or f"hs-{origin.checksum[:12] or 'recording'}"
    side = 1 if measured.recording.hand == "left" else 2
    rests = [origin.method, _options(origin.options), f"handscope {origin.software}"]
    rests += [origin.checksum, origin.start_utc, str(int(origin.simulated))]
    figures = [(task, f) for task in measured.tasks for f in task.figures]
    for k, (task, figure) in enumerate(figures, 1):
        yield (
            *(record, FORM, k, side, task.task, task.measure, f"{task.onset:.3f}"),
            *(f"{task.end:.3f}", figure.name, figure.value, figure.sd, figure.unit),
            *(GRADES.index(figure.grade) + 1, figure.reason, *rests),
        )


def _options(options: object) -> str:
    assert isinstance(options, dict)
    return "; ".join(f"{name}={value}" for name, value in options.items())
