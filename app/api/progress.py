"""/api/patients/{id}/progress: a patient's figures over the sessions"""

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter

from handscope.app.auth.roles import CLINICIAN, SCIENTIST, requires_role
from handscope.app.language import Language
from handscope.app.protocols import offered
from handscope.app.report.changes import Judge
from handscope.app.report.progress import Course, Progress, Series, progress
from handscope.app.state import Db, LanguageDep, PartsDep
from handscope.sessions.clinic import patients, repeatability

router = APIRouter(
    prefix="/patients", tags=["patients"], dependencies=[requires_role(CLINICIAN, SCIENTIST)]
)


@router.get("/{patient_id}/progress")
def read_progress(
    db: Db, parts: PartsDep, language: LanguageDep, patient_id: int
) -> dict[str, Any]:
    """Sessions by hand, and of every figure its values in their order; what a change must exceed, and whether it does."""
    patient = patients.get(db, patient_id)
    history = progress(repeatability.history(db, patient_id), offered(parts.store.folder)[0])
    return {
        "affected": patient.affected_hand,
        **(
            _progress_payload(history, language)
            if history
            else {"method": "", "judges": [], "sessions": {}, "series": []}
        ),
    }


def _progress_payload(history: Progress, language: Language) -> dict[str, Any]:
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
            {**_series(s, judges), "label": language.known(f"figure.{s.name}", "")}
            for s in history.series
        ],
    }


def _series(s: Series, judges: list[Judge]) -> dict[str, Any]:
    reference = (
        {"value": s.reference.degrees, "source": s.reference.source.name, "note": s.reference.note}
        if s.reference
        else None
    )
    facts = {
        name: getattr(s, name)
        for name in ("measure", "task", "name", "unit", "joint", "angle", "end")
    }
    return {
        **facts,
        "reference": reference,
        "hands": {hand: _course(c, judges) for hand, c in s.hands.items()},
    }


def _course(c: Course, judges: list[Judge]) -> dict[str, Any]:
    """Points as [session, value, beyond since the first, beyond since the one before]; `judge` is a place in the list of judges."""
    points = [[p.session, round(p.value, 3), p.since_first, p.since_before] for p in c.points]
    return {"points": points, "judge": judges.index(c.judge)}
