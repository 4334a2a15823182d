"""/api/patients/{id}/progress: a patient's figures over the sessions"""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from fastapi import APIRouter, Response

from handscope.app.api.pseudonymisation import for_reader
from handscope.app.api.treatment.routes import event_row, goal_row
from handscope.app.auth.roles import CLINICIAN, SCIENTIST, RequesterDep, requires_role
from handscope.app.documents import make_progress_report
from handscope.app.language import Language
from handscope.app.protocols import offered
from handscope.app.report import Paper
from handscope.app.report.changes import Judge
from handscope.app.report.progress.labels import label
from handscope.app.report.progress.series import Course, Progress, Series, progress
from handscope.app.report.units import BROKEN, places_of
from handscope.app.state import Db, DocumentsDep, LanguageDep, PartsDep
from handscope.estimators.hand.anatomy import HANDS, Hand
from handscope.sessions.clinic import patients, repeatability
from handscope.sessions.db.tables import Goal
from handscope.sessions.treatment import goals

Aims = Mapping[tuple[str, goals.Key], Goal]

router = APIRouter(
    prefix="/patients", tags=["patients"], dependencies=[requires_role(CLINICIAN, SCIENTIST)]
)


@router.get("/{patient_id}/progress")
def read_progress(
    db: Db, parts: PartsDep, language: LanguageDep, requester: RequesterDep, patient_id: int
) -> dict[str, Any]:
    """Sessions by hand, and of every figure its values in their order; what a change must exceed, and whether it does; treatment and goals."""
    patient = patients.get(db, patient_id)
    history = progress(repeatability.history(db, patient_id), offered(parts.store.folder)[0])
    return {
        "affected": patient.affected_hand,
        "treatment_events": [
            for_reader(requester, event_row(e, language)) for e in patient.treatment_events
        ],
        **(
            _progress_payload(history, goals.of_patient(patient), language)
            if history
            else {"method": "", "judges": [], "sessions": {}, "series": []}
        ),
    }


@router.get("/{patient_id}/progress.pdf", dependencies=[requires_role(CLINICIAN, does="exported")])
async def read_progress_report(
    documents: DocumentsDep,
    language: LanguageDep,
    patient_id: int,
    hand: Hand,
    paper: Paper = "a4",
) -> Response:
    """The progress of a hand as pdf: charts with goals and treatment on the first page, then every figure."""
    data = await documents.run(make_progress_report, patient_id, hand, language.code, paper)
    name = f"handscope-progress-{patient_id}-{hand}.pdf"
    headers = {"Content-Disposition": f'inline; filename="{name}"'}
    return Response(data, media_type="application/pdf", headers=headers)


def _progress_payload(history: Progress, aims: Aims, language: Language) -> dict[str, Any]:
    judges = list(dict.fromkeys(c.judge for s in history.series for c in s.hands.values()))
    return {
        "judges": [
            {**asdict(judge), "sources": [language.translate(s) for s in judge.sources]}
            for judge in judges
        ],
        "method": history.method,
        "sessions": {
            hand: [
                {"session": o.session, "result": o.result, "started": o.started} for o in occasions
            ]
            for hand, occasions in history.sessions.items()
        },
        "series": [
            {**_series(s, judges, aims, language), "label": label(s.name, language)}
            for s in history.series
        ],
    }


def _series(s: Series, judges: list[Judge], aims: Aims, language: Language) -> dict[str, Any]:
    reference = (
        {
            "value": s.reference.degrees,
            "source": language.translate(s.reference.source.name),
            "note": language.translate(s.reference.note),
        }
        if s.reference
        else None
    )
    key = (s.measure, s.task, s.name)
    facts = {
        name: getattr(s, name)
        for name in (
            "measure",
            "task",
            "name",
            "unit",
            "finger",
            "important",
            "joint",
            "angle",
            "end",
        )
    }
    return {
        **facts,
        "decimals": places_of(s.name, BROKEN, s.unit),
        "reference": reference,
        "hands": {hand: _course(c, judges) for hand, c in s.hands.items()},
        "goals": {
            hand: goal_row(goal)
            for hand in HANDS
            if (goal := goals.fitting(aims, hand, key, s.unit)) is not None
        },
    }


def _course(c: Course, judges: list[Judge]) -> dict[str, Any]:
    """Points as [session, value, beyond since the first, beyond since the one before]; `judge` is a place in the list of judges."""
    points = [[p.session, round(p.value, 3), p.since_first, p.since_before] for p in c.points]
    return {"points": points, "judge": judges.index(c.judge)}
