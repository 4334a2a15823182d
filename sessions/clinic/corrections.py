"""What a person takes out of a recording's figures, or moves, with a reason; the recording itself never changes.

Kept        a row each, never removed: undone is a moment in it, so that everybody sees what was decided, why, and what was taken back
Applied     to the events of an opened recording (`corrected`): a result names the corrections that hold for it and is a function of them too
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, get_args

from sqlalchemy.orm import Session

from handscope.estimators.data.events import Event
from handscope.estimators.errors import InputError
from handscope.estimators.messages import Value
from handscope.estimators.messages.sentence import Sentence, phrase
from handscope.sessions.db.tables import Correction, RecordingFile, now

if TYPE_CHECKING:
    from handscope.sessions.files.recording import LoadedRecording

REDACTED = phrase("correction.reason_redacted")
OFFERED: Mapping[str, str] = {  # reasons that pages offer, by the names that they send
    "helped": phrase("correction.reason_helped"),
    "wrong": phrase("correction.reason_wrong"),
    "interrupted": phrase("correction.reason_interrupted"),
    "slipped": phrase("correction.reason_slipped"),
    "pain": phrase("correction.reason_pain"),
}
WORDED = {words: words for words in OFFERED.values()}  # by the same words without their codes
# a whole trial; its ends; a stretch within it, such as one repetition
Kind = Literal["exclude", "move", "leave_out"]
SHORTEST = 0.5  # s that a trial must keep


def add(
    db: Session,
    file: RecordingFile,
    event: int,
    kind: str,
    reason: str,
    onset: float = 0.0,
    end: float = 0.0,
) -> Correction:
    """Keep a correction of the recording's event number `event` (from 0, in its order); `onset` to `end`, s, are the new ends or the stretch.

    The reason is one of OFFERED's sentences, or what a person typed.
    """
    task = _task_of(file, event)
    if kind not in get_args(Kind):
        raise InputError("clinic.unknown_correction", name=kind, kinds=", ".join(get_args(Kind)))
    if not reason.strip():
        raise InputError("clinic.correction_without_reason")
    if kind == "exclude":
        onset, end = task["onset"], task["onset"] + task["duration"]
    else:
        _require_stretch(file, task, kind, onset, end)
    standing = [c for c in file.corrections if c.undone is None and c.event == event]
    for before in standing:
        if before.kind == kind == "exclude":
            raise InputError("clinic.trial_already_left_out")
        if before.kind == kind == "move":
            before.undone = now()  # its ends are moved anew
    typed = reason.strip()[:1000]
    kept = WORDED.get(typed, typed)
    made = Correction(recording=file, event=event, kind=kind, onset=onset, end=end, reason=kept)
    db.add(made)
    db.commit()
    return made


def get(db: Session, correction_id: int) -> Correction:
    """The correction; InputError where there is none."""
    found = db.get(Correction, correction_id)
    if found is None:
        raise InputError("clinic.correction_unknown", number=correction_id)
    return found


def undo(db: Session, correction_id: int) -> Correction:
    """It counts no longer; the row stays."""
    found = get(db, correction_id)
    found.undone = found.undone or now()
    db.commit()
    return found


def active(file: RecordingFile) -> list[dict[str, Any]]:
    """The corrections that count, as plain data in a fixed order: what a result is a function of."""
    return as_data(c for c in file.corrections if c.undone is None)


def reason_of(row: Correction) -> str:
    """Why; of an offered reason its sentence, also where it was stored as English words alone."""
    return WORDED.get(row.reason, row.reason)


def reason_code(row: Correction) -> str:
    """The name of an offered reason; "" of a typed one."""
    return next((name for name, words in OFFERED.items() if words == row.reason), "")


def as_data(rows: Iterable[Correction]) -> list[dict[str, Any]]:
    """Corrections as a result keeps them."""
    ordered = sorted(rows, key=lambda c: (c.event, c.kind, c.onset, c.end, c.id))
    return [
        {"event": c.event, "kind": c.kind, "onset": c.onset, "end": c.end, "reason": reason_of(c)}
        for c in ordered
    ]


def apply(
    recording: "LoadedRecording", corrections: Sequence[Mapping[str, Any]]
) -> "LoadedRecording":
    """The recording with its events corrected and a sentence for each correction among its warnings."""
    if not corrections:
        return recording
    events = list(recording.events)
    names = trial_names(events)
    for c in corrections:
        events[c["event"]] = _correct_event(events[c["event"]], c)
    sentences = tuple(
        _sentence(names[c["event"]], c, recording.events[c["event"]]) for c in corrections
    )
    return replace(recording, events=tuple(events), warnings=(*recording.warnings, *sentences))


def redact_reasons(corrections: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The same without the reasons that people typed."""
    return [{**c, "reason": REDACTED} for c in corrections]


def without_reasons(sentence: str, corrections: Iterable[Mapping[str, Any]]) -> str:
    """A sentence about a recording without the reasons that people typed."""
    for c in corrections:
        sentence = _without(sentence, c["reason"])
    return sentence


def _without(sentence: str, reason: str) -> str:
    if not isinstance(sentence, Sentence):  # words that have no code
        return sentence.replace(f"({reason})", f"({REDACTED})")
    return Sentence(*(replace(m, values=_redact(m.values, reason)) for m in sentence.messages))


def _redact(values: Mapping[str, Value], reason: str) -> Mapping[str, Value]:
    return {
        name: REDACTED
        if name == "reason" and value == reason
        else _without(value, reason)
        if isinstance(value, str)
        else value
        for name, value in values.items()
    }


def trial_names(events: Iterable[Event]) -> list[str]:
    """ "tapping, trial 2" for every event, counted within its task; without a number where there is one trial only."""
    names = [str(e.details.get("task_name", e.trial_type)).replace("_", " ") for e in events]
    return [
        phrase("correction.trial", task=name, number=names[: k + 1].count(name))
        if names.count(name) > 1
        else name
        for k, name in enumerate(names)
    ]


def _correct_event(event: Event, c: Mapping[str, Any]) -> Event:
    if c["kind"] == "exclude":
        return replace(event, details={**event.details, "excluded": c["reason"]})
    if c["kind"] == "move":
        return replace(event, onset=c["onset"], duration=c["end"] - c["onset"])
    return replace(
        event,
        details={
            **event.details,
            "left_out": [*event.details.get("left_out", ()), (c["onset"], c["end"])],
        },
    )


def _sentence(name: str, c: Mapping[str, Any], event: Event) -> str:
    values = {"trial": name, "reason": c["reason"]}
    if c["kind"] == "exclude":
        return phrase("correction.excluded", **values)
    stretch = {"start": c["onset"] - event.onset, "stop": c["end"] - event.onset}
    return (
        phrase("correction.moved", **values, **stretch)
        if c["kind"] == "move"
        else phrase("correction.stretch_left_out", **values, **stretch)
    )


def _task_of(file: RecordingFile, event: int) -> Mapping[str, Any]:
    events = file.summary.get("events", [])
    if not 0 <= event < len(events) or events[event]["trial_type"] != "task":
        raise InputError("clinic.task_unknown", number=event, recording=file.id)
    task: Mapping[str, Any] = events[event]
    return task


def _require_stretch(
    file: RecordingFile, task: Mapping[str, Any], kind: str, onset: float, end: float
) -> None:
    first, last = task["onset"], task["onset"] + task["duration"]
    if not end > onset:
        raise InputError("clinic.stretch_reversed")
    if kind == "move" and (
        end - onset < SHORTEST or onset < 0 or end > file.summary.get("duration", end) + 1.0
    ):
        raise InputError("clinic.trial_outside_recording", least=SHORTEST)
    if kind == "leave_out" and (
        onset < first - 0.01 or end > last + 0.01 or (last - first) - (end - onset) < SHORTEST
    ):
        raise InputError("clinic.stretch_outside_trial", least=SHORTEST)
    if kind == "leave_out" and "tap" in str(task.get("task", "")).lower():
        raise InputError("clinic.tapping_cannot_be_cut")
