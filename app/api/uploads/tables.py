"""/api/patients/{id}/tables: tables of other loggers are uploaded, mapped column by column, and become a session's recording"""

import json
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal

from anyio import to_thread
from fastapi import APIRouter, Depends, Query, UploadFile
from pydantic import Field

from handscope.app.api.answers import TableAnswer, TableFindings, answers
from handscope.app.api.sessions import queue_session, receive
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import CLINICIAN, RequesterDep, requires_role
from handscope.app.language import Language
from handscope.app.state import Db, LanguageDep, PartsDep
from handscope.app.version import software_version
from handscope.app.workers.pending_tables import PendingTable
from handscope.estimators.data.samples import TRACKED_POINTS, Event
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.messages import Message
from handscope.sessions.clinic import patients
from handscope.sessions.db.plain_text import replaced, require_plain
from handscope.sessions.files import native
from handscope.sessions.motion_bids.events_reader import parse_events
from handscope.sessions.store import records
from handscope.sessions.table_import import stored_maps
from handscope.sessions.table_import.column_map import (
    FACTORS,
    SECONDS,
    ColumnMap,
    TableLayout,
    as_json,
    parse_layout,
    parse_map,
)
from handscope.sessions.table_import.examine import Findings
from handscope.sessions.table_import.importing import check_table, import_table
from handscope.sessions.table_import.preview import Preview, preview

router = APIRouter(
    prefix="/patients/{patient_id}/tables",
    tags=["tables"],
    dependencies=[requires_role(CLINICIAN)],
)
MOST_EVENTS = 500
SHOWN_OTHERWISE = {"import.guess_which_segment", "import.guess_no_sensors"}  # by the triads


class TableMapping(Incoming):
    """A map of the columns, as MAP.json has it (docs/devices.md)."""

    map: dict[str, Any]


class NewEvent(Incoming):
    """A pose or a task of the recording, s from the first row."""

    trial_type: Literal["initial_pose", "flat_hand", "task"]
    onset: float = Field(allow_inf_nan=False, ge=0)
    duration: float = Field(allow_inf_nan=False, ge=0)
    task: str = Field("", max_length=100, description="which task; of a task alone")


class NewTableRecording(TableMapping):
    """A map, and what the patient did when."""

    events: list[NewEvent] = Field(default_factory=list, max_length=MOST_EVENTS)
    events_tsv: str = Field(
        "", max_length=500_000, description="content of an events.tsv as in Motion-BIDS"
    )
    started: datetime | None = Field(None, description="instant of the first row, where known")
    method: str | None = Field(None, description="without it what suits the recording's sensors")


def pending(
    db: Db, parts: PartsDep, requester: RequesterDep, patient_id: int, table: str
) -> PendingTable:
    """The table of this address."""
    patients.get(db, patient_id)
    return parts.pending_tables.get(table, patient_id, requester.login)


PendingDep = Annotated[PendingTable, Depends(pending)]


@router.post("", status_code=201)
async def upload_table(
    db: Db, parts: PartsDep, requester: RequesterDep, patient_id: int, file: UploadFile
) -> dict[str, str]:
    """Receive a table; nothing is stored with the patient before it is mapped."""
    patients.get(db, patient_id)
    name = file.filename or "table"
    require_plain(name, "the form", one_line=True)
    table = parts.pending_tables.add(parts.store.incoming, patient_id, requester.login, name)
    try:
        with table.path.open("wb") as target:
            await receive(file, parts, target)
        await parts.upload_reader.call(preview, table.path)
    except BaseException:
        parts.pending_tables.remove(table)
        raise
    return {"table": table.number}


@router.get("/{table}", responses=answers(TableAnswer))
async def read_table(
    db: Db,
    parts: PartsDep,
    language: LanguageDep,
    pending: PendingDep,
    delimiter: Annotated[str | None, Query(max_length=1)] = None,
    decimal: Annotated[str, Query(max_length=1)] = ".",
    header: bool = True,
    skip: Annotated[int, Query(ge=0, le=10_000)] = 0,
) -> TableAnswer:
    """Its first rows and a guess of its columns; the text laid out as asked, or as it probably is."""
    layout = (
        None
        if delimiter is None
        else parse_layout(asdict(TableLayout(delimiter, decimal, header, skip)), pending.path.name)
    )
    seen = await parts.upload_reader.call(preview, pending.path, layout)
    stored = stored_maps.find(db, seen.key) if seen.key else None
    kept = None if stored is None else {"map": stored.data, "changed": stored.changed}
    return _answer(pending.path, seen, kept, language)


@router.post("/{table}/check", responses=answers(TableFindings))
async def check(
    parts: PartsDep, language: LanguageDep, pending: PendingDep, mapping: TableMapping
) -> TableFindings:
    """What the numbers say of a map; 422 where they contradict it."""
    columns = parse_map(mapping.map, pending.path.name)
    return _findings(await parts.upload_reader.call(check_table, pending.path, columns), language)


@router.post("/{table}/recording", status_code=201)
async def import_mapped(
    db: Db, parts: PartsDep, patient_id: int, pending: PendingDep, new: NewTableRecording
) -> dict[str, int]:
    """Store the mapped table as a session's recording and process it; the map is kept for the next table with this header."""
    patient = patients.get(db, patient_id)
    given = parse_map(new.map, pending.path.name)
    geometry = given.geometry or patient.hand_measures.get(given.hand, {})
    value = {**new.map, "geometry": dict(geometry)}
    out = pending.path.parent / f"recording{native.SUFFIX}"
    columns = parse_map(value, pending.path.name)
    parts.store.require_room()
    key = await parts.upload_reader.call(
        _convert, pending.path, columns, _events(new), out, new.started
    )
    try:
        found = await parts.upload_reader.read(out, pending.path.name, columns.hand)
        stored_maps.store(db, key, new.map)
        session = await to_thread.run_sync(
            records.store_upload, db, parts.store, patient, out, pending.path.name, found
        )
    finally:
        out.unlink(missing_ok=True)
    parts.pending_tables.remove(pending)
    result = queue_session(db, parts, session, new.method, {})
    return {"session": session.id, "result": result.id}


@router.delete("/{table}", status_code=204)
def give_up(parts: PartsDep, pending: PendingDep) -> None:
    """Remove a table that is not to be imported."""
    parts.pending_tables.remove(pending)


def _convert(
    path: Path, columns: ColumnMap, events: list[Event], out: Path, started: datetime | None
) -> str:
    """In the working process: the recording at `out`; gives the header's key."""
    out.unlink(missing_ok=True)
    about = {"software": software_version(), "imported_from": path.name}
    import_table(path, columns, events, out, about, started)
    return preview(path, columns.table).key


def _events(new: NewTableRecording) -> list[Event]:
    """In the order of their onsets."""
    typed = []
    for e in new.events:
        if (e.trial_type == "task") != bool(e.task):
            raise InputError("import.task_without_name")
        typed.append(
            Event(e.onset, e.duration, e.trial_type, {"task_name": e.task} if e.task else {})
        )
    read = parse_events(new.events_tsv.encode(), "events.tsv") if new.events_tsv.strip() else ()
    return sorted((*typed, *read), key=lambda e: e.onset)


def _answer(
    path: Path, seen: Preview, kept: dict[str, Any] | None, language: Language
) -> TableAnswer:
    guess = seen.guess
    return {
        "name": path.name,
        "is_text": seen.is_text,
        "layout": asdict(seen.layout),
        "names": replaced(list(seen.names)),
        "columns": seen.columns,
        "count": seen.count,
        "rows": replaced([list(row) for row in seen.rows]),
        "map": _plain_map(guess.columns) if guess else None,
        "triads": [
            {"quantity": t.quantity, "columns": list(t.columns), "unit": t.unit, "point": t.point}
            for t in guess.triads
        ]
        if guess
        else [],
        "questions": [language.render(q) for q in guess.questions if q.code not in SHOWN_OTHERWISE]
        if guess
        else [],
        "problem": _words(seen.problem, language),
        "stored": kept,
        "choices": {
            "units": {q: list(units) for q, units in FACTORS.items()},
            "seconds": list(SECONDS),
            "points": [
                {"name": p, "title": language.segment(p) if p in SEGMENTS else p.replace("_", " ")}
                for p in TRACKED_POINTS
                if p in SEGMENTS or p == "trunk"
            ],
        },
    }


def _plain_map(columns: ColumnMap) -> dict[str, Any]:
    value: dict[str, Any] = json.loads(as_json(columns))
    return value


def _words(problem: Message | str | None, language: Language) -> str | None:
    if problem is None:
        return None
    return language.render(problem) if isinstance(problem, Message) else language.translate(problem)


def _findings(found: Findings, language: Language) -> TableFindings:
    return {
        "duration": found.duration,
        "rate": found.rate,
        "rests": [list(rest) for rest in found.rests[:20]],
        "findings": [{"severity": m.severity, "text": language.render(m)} for m in found.messages],
    }
