"""How far figures come out alike when measured again, of every patient and every glove; and what a result is compared with.

Repeated     sessions of the same hand of one patient, by the same method with the same options, within REPEATED of the first of them: what changes in between
             counts as error. Sessions further apart are follow-up, and what changes between them is what is looked for
A figure     of a task in a session: the largest (smallest) over its trials where it is a maximum (minimum), else their mean; without trials of poor signal
Kept         derived data: whoever stores or removes a result, it is computed anew in the same transaction (`keep`), so it is never half-written
Limits       a recording uploaded twice counts once; an upload counts from the day that it names, else from the upload; software versions are not distinguished
Source       Bland & Altman 1996, BMJ 312:1654 (SD within people); interval between repeated tests: Terwee 2007, J Clin Epidemiol 60:34 (one or two weeks)
"""

import json
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
from sqlalchemy import Connection, delete, event, inspect, select
from sqlalchemy.orm import Mapper, Session, object_session, sessionmaker

from handscope.sessions.clinic import corrections, self_calibrations
from handscope.sessions.clinic.self_calibrations import glove_of
from handscope.sessions.db.tables import (
    Correction,
    PatientSession,
    RecordingFile,
    Repeatability,
    Result,
    Reuse,
)
from handscope.sessions.db.visible_rows import unrestricted

if TYPE_CHECKING:
    from handscope.estimators.measures.figure import Figure
    from handscope.estimators.measures.repeatability import Interval

REPEATED = timedelta(days=7)
ENOUGH = 4  # degrees of freedom (five sessions in a week): the SEM's upper limit is 2.9 SEM; with one it is 32 SEM, and 30 of 100 changes of nothing exceed 1.96 sqrt(2) SEM
CHANGED = "changed_results"  # in a database session's info: ids of results stored or removed since its last commit
CORRECTED = "corrected_recordings"  # and of recordings whose corrections changed: other results of theirs count from now on

PEOPLE = 2  # of a glove's figures: one person says what that person repeats

Key = tuple[str, str, str]  # measure, task, figure
Values = dict[Key, tuple[float, str]]  # SI value and unit


@dataclass(frozen=True)
class Occasion:
    """A session's newest result by a method with its options."""

    result: int
    session: int
    patient: int
    hand: str
    started: datetime
    checksum: str  # of the recording
    device: str  # "" where the recording does not tell
    method: str
    parameters: Mapping[str, Any]

    @property
    def processing(self) -> tuple[str, str, str]:
        """What must agree before figures are compared."""
        return (
            self.hand,
            self.method,
            json.dumps(dict(self.parameters), sort_keys=True, default=str),
        )


@dataclass(frozen=True)
class Comparison:
    """A result's figures beside those of the patient's session before, and what repeated measurement gives; SI units."""

    since: datetime
    now: Values
    before: Values
    own: Mapping[Key, Repeatability]
    glove: Mapping[Key, Repeatability]


@dataclass(frozen=True)
class ProcessedSession:
    """A session processed in one way; SI units."""

    occasion: Occasion
    values: Values
    own: Mapping[Key, Repeatability]
    glove: Mapping[Key, Repeatability]


def enable(database: sessionmaker[Session]) -> None:
    """From now on every commit of this database that stores or removes a result brings the table up to date."""
    event.listen(database, "before_commit", _before_commit)
    event.listen(database, "after_rollback", _discard)


def fill(database: sessionmaker[Session]) -> None:
    """Compute the table where it is empty: of a database from before it existed."""
    with database() as db:
        if db.scalar(select(Repeatability.id).limit(1)) is None:
            _store(db, _occasions(db))
            db.commit()


def refresh(db: Session, changed: Iterable[int]) -> None:
    """Compute anew what results that were stored or removed bear on; the caller commits."""
    ids = set(changed)
    everything = _occasions(db)
    touched = {(o.patient, o.device) for o in everything if o.result in ids}
    patients, devices = {p for p, _ in touched}, {d for _, d in touched if d}
    if ids - {o.result for o in everything}:  # removed, or replaced by a newer one
        rows = db.execute(
            select(Repeatability.patient_id, Repeatability.device, Repeatability.results)
        )
        bearing = [(patient, device) for patient, device, results in rows if ids & set(results)]
        patients |= {p for p, _ in bearing if p is not None}
        devices |= {d for _, d in bearing if d}
    db.execute(delete(Repeatability).where(Repeatability.patient_id.in_(patients)))
    db.execute(
        delete(Repeatability).where(
            Repeatability.patient_id.is_(None), Repeatability.device.in_(devices)
        )
    )
    _store(db, [o for o in everything if o.patient in patients], of_gloves=False)
    _store(db, [o for o in everything if o.device in devices], of_patients=False)


def history(db: Session, patient: int) -> list[ProcessedSession]:
    """A patient's sessions in order of time, with every way in which each was processed, and what repeated measurement gives them."""
    occasions = _occasions(db, patient)
    figures = _figures(db, [o.result for o in occasions])
    own = list(db.scalars(select(Repeatability).where(Repeatability.patient_id == patient)))
    devices = {o.device for o in occasions if o.device}
    gloves = list(
        db.scalars(
            select(Repeatability).where(
                Repeatability.patient_id.is_(None), Repeatability.device.in_(devices)
            )
        )
    )
    return [
        ProcessedSession(
            o,
            figures[o.result],
            _select_rows(own, o),
            _select_rows([g for g in gloves if g.device == o.device], o),
        )
        for o in occasions
    ]


def is_sufficient(row: Repeatability) -> bool:
    """Whether there are sessions enough to judge a change by; none that came out alike to the last digit."""
    return (
        row.freedom >= ENOUGH
        and row.mdc95 > 0
        and (row.patient_id is not None or row.people >= PEOPLE)
    )


def occasion_of(result: Result) -> Occasion:
    """Where a result stands among the patient's sessions."""
    file, visit = result.recording, result.recording.session
    facts = visit.patient_id, visit.hand, visit.started, file.sha256 or "", glove_of(file.summary)
    return Occasion(result.id, visit.id, *facts, result.method, result.parameters)


def values(figures: Sequence[Mapping[str, Any]]) -> Values:
    """A session's value of every figure from its kept rows, one a trial."""
    trials: dict[Key, list[float]] = defaultdict(list)
    units: dict[Key, str] = {}
    for row in figures:
        if row["value"] is not None and row["grade"] != "poor":
            key = (row["measure"], row["task"], row["name"])
            trials[key].append(row["value"])
            units[key] = row["unit"]
    return {key: (_over_trials(key[2], found), units[key]) for key, found in trials.items()}


def measured_values(figures: Iterable[tuple[str, str, "Figure"]]) -> Values:
    """The same of figures as they were measured, each behind its task and measure."""
    return values(
        [
            {
                "measure": measure,
                "task": task,
                "name": f.name,
                "unit": f.unit,
                "grade": f.grade,
                "value": f.value,
            }
            for task, measure, f in figures
            if f.value == f.value
        ]
    )


def _over_trials(name: str, found: list[float]) -> float:
    if name.endswith("_max"):
        return max(found)
    return min(found) if name.endswith("_min") else float(np.mean(found))


def _before_commit(db: Session) -> None:
    with unrestricted(db):  # a glove's figures come from patients of every ward
        db.flush()
        changed, corrected = db.info.pop(CHANGED, set()), db.info.pop(CORRECTED, None)
        if corrected:
            changed |= set(db.scalars(select(Result.id).where(Result.recording_id.in_(corrected))))
        if changed:
            refresh(db, changed)


def _discard(db: Session) -> None:
    for name in (CHANGED, CORRECTED):
        db.info.pop(name, None)


def _mark_changed(result: Result) -> None:
    db = object_session(result)
    if db is not None:
        db.info.setdefault(CHANGED, set()).add(result.id)


@event.listens_for(Result, "after_insert")
@event.listens_for(Result, "after_update")
def _on_result_stored(mapper: Mapper[Result], connection: object, result: Result) -> None:
    if result.state == "done" and inspect(result).attrs.state.history.has_changes():
        _mark_changed(result)


@event.listens_for(Correction, "after_insert")
@event.listens_for(Correction, "after_update")
def _on_correction(mapper: Mapper[Correction], connection: object, correction: Correction) -> None:
    db = object_session(correction)
    if db is not None:
        db.info.setdefault(CORRECTED, set()).add(correction.recording_id)


@event.listens_for(Reuse, "after_insert")
def _on_reuse_decision(mapper: Mapper[Reuse], connection: Connection, reuse: Reuse) -> None:
    db = object_session(reuse)
    if db is not None:
        files = connection.scalars(
            select(RecordingFile.id).where(RecordingFile.session_id == reuse.session_id)
        )
        db.info.setdefault(CORRECTED, set()).update(files)


@event.listens_for(PatientSession, "after_update")
def _on_session_change(
    mapper: Mapper[PatientSession], connection: object, visit: PatientSession
) -> None:
    """What was measured again within a day, and what came before, goes by the date; with another height of the trunk's sensor other results count."""
    db, attributes = object_session(visit), inspect(visit).attrs
    if db is not None and (
        attributes.started.history.has_changes() or attributes.trunk_corrected.history.has_changes()
    ):
        db.info.setdefault(CORRECTED, set()).update(f.id for f in visit.recordings)


@event.listens_for(Result, "after_delete")
def _on_result_removed(mapper: Mapper[Result], connection: object, result: Result) -> None:
    _mark_changed(result)


def _occasions(db: Session, patient: int | None = None) -> list[Occasion]:
    """Of every session the newest finished result of each way by the corrections that count, in order of time; of a recording kept twice the first
    session only."""
    file, visit = RecordingFile, PatientSession
    query = (
        select(
            Result.id,
            visit.id,
            visit.patient_id,
            visit.hand,
            visit.started,
            file.sha256,
            file.summary,
            Result.method,
            Result.parameters,
            file.id,
            Result.corrections,
            Result.reused,
            Result.trunk_height,
            visit.trunk_corrected,
        )
        .join(file, Result.recording_id == file.id)
        .join(visit, file.session_id == visit.id)
        .where(Result.state == "done")
        .order_by(visit.started, visit.id, Result.id)
    )
    if patient is not None:
        query = query.where(visit.patient_id == patient)
    standing, decisions = _active_corrections(db), self_calibrations.decisions(db)
    newest: dict[Any, Occasion] = {}
    for (
        id_,
        session,
        person,
        hand,
        started,
        checksum,
        summary,
        method,
        parameters,
        recording,
        applied,
        reused,
        trunk_used,
        trunk_now,
    ) in db.execute(query):
        if (
            applied != standing.get(recording, [])
            or trunk_used != trunk_now
            or reused != self_calibrations.as_data(decisions.get(session), method)
        ):
            continue
        o = Occasion(
            id_,
            session,
            person,
            hand,
            started,
            checksum or "",
            glove_of(summary),
            method,
            parameters,
        )
        newest[o.session, o.processing] = o
    first: dict[Any, Occasion] = {}
    for o in newest.values():
        first.setdefault((o.patient, o.processing, o.checksum), o)
    return list(first.values())


def _active_corrections(db: Session) -> dict[int, list[dict[str, Any]]]:
    """The corrections that count, by recording."""
    rows: dict[int, list[Correction]] = defaultdict(list)
    for correction in db.scalars(select(Correction).where(Correction.undone.is_(None))):
        rows[correction.recording_id].append(correction)
    return {recording: corrections.as_data(found) for recording, found in rows.items()}


def _store(
    db: Session, occasions: Sequence[Occasion], of_patients: bool = True, of_gloves: bool = True
) -> None:
    """Add the rows of the patients and of the gloves of these occasions."""
    sets: dict[tuple[int | None, str, tuple[str, str, str]], list[Occasion]] = defaultdict(list)
    for o in occasions:
        if of_patients:
            sets[o.patient, "", o.processing].append(o)
        if of_gloves and o.device:
            sets[None, o.device, o.processing].append(o)
    for (patient, device, _), found in sets.items():
        if groups := _group_repetitions(found):
            figures = _figures(db, [o.result for group in groups for o in group])
            db.add_all(_rows(patient, device, groups, figures))


def _group_repetitions(occasions: Sequence[Occasion]) -> list[list[Occasion]]:
    """Groups of two sessions and more of one patient within REPEATED of the group's first."""
    groups: dict[int, list[list[Occasion]]] = defaultdict(list)
    for o in occasions:
        of = groups[o.patient]
        if of and o.started - of[-1][0].started <= REPEATED:
            of[-1].append(o)
        else:
            of.append([o])
    return [group for of in groups.values() for group in of if len(group) > 1]


def _rows(
    patient: int | None,
    device: str,
    groups: Sequence[Sequence[Occasion]],
    figures: Mapping[int, Values],
) -> Iterable[Repeatability]:
    """A row for every figure that some group has twice."""
    from handscope.estimators.measures.repeatability import within_groups  # only here: numerics

    any_one = groups[0][0]
    units = {key: unit for found in figures.values() for key, (_, unit) in found.items()}
    for key, unit in units.items():
        used = [
            having
            for group in groups
            if len(having := [o for o in group if key in figures[o.result]]) > 1
        ]
        numbers = [[figures[o.result][key][0] for o in having] for having in used]
        pooled = within_groups(numbers)
        if pooled is None:
            continue
        icc, people = _icc(used, numbers), len({having[0].patient for having in used})
        yield Repeatability(
            patient_id=patient,
            device=device,
            hand=any_one.hand,
            method=any_one.method,
            parameters=dict(any_one.parameters),
            measure=key[0],
            task=key[1],
            name=key[2],
            unit=unit,
            sem=pooled.sem.value,
            mdc95=pooled.mdc95.value,
            mdc95_low=pooled.mdc95.low,
            mdc95_high=pooled.mdc95.high,
            icc=_known(icc.value),
            icc_low=_known(icc.low),
            icc_high=_known(icc.high),
            people=people,
            sessions=pooled.measurements,
            freedom=pooled.freedom,
            results=[o.result for having in used for o in having],
        )


def _icc(used: Sequence[Sequence[Occasion]], numbers: Sequence[Sequence[float]]) -> "Interval":
    """ICC(2,1) from the first two sessions of every patient; of one patient there is none."""
    from handscope.estimators.measures.repeatability import reliability

    first: dict[int, Sequence[float]] = {}
    for having, found in zip(used, numbers):
        first.setdefault(having[0].patient, found[:2])
    return reliability(np.array(list(first.values()))).icc_agreement


def _figures(db: Session, results: Sequence[int]) -> dict[int, Values]:
    return {
        id_: values(rows)
        for id_, rows in db.execute(select(Result.id, Result.figures).where(Result.id.in_(results)))
    }


def _select_rows(rows: Iterable[Repeatability], o: Occasion) -> dict[Key, Repeatability]:
    """Rows of the occasion's hand, method and options."""
    return {
        (r.measure, r.task, r.name): r
        for r in rows
        if (r.hand, r.method, r.parameters) == (o.hand, o.method, dict(o.parameters))
    }


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
