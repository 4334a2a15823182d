"""/api/results/{id}/references: what a result is compared with, in versions"""

from typing import Annotated, Any

from fastapi import APIRouter, Query
from sqlalchemy.orm import Session

from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import CLINICIAN, SCIENTIST, RequesterDep, requires_role
from handscope.app.report.references import newest
from handscope.app.state import Db
from handscope.sessions.clinic import references, results
from handscope.sessions.clinic.references import Compared, References
from handscope.sessions.db.tables import Result
from handscope.sessions.store import records

router = APIRouter(
    prefix="/results", tags=["results"], dependencies=[requires_role(CLINICIAN, SCIENTIST)]
)
ReferencesDep = Annotated[
    int | None, Query(description="version of what it is compared with; without it the newest")
]


class Choice(Incoming):
    """Results that another one is to be compared with; null: nothing."""

    before: int | None = None  # of the same hand
    other: int | None = None  # of the other hand


@router.get("/{result_id}/references")
def list_candidates(db: Db, result_id: int) -> list[dict[str, Any]]:
    """Sessions of the patient that the result can be compared with, in order of time."""
    result = results.require_done(results.get(db, result_id))
    return [_comparison_row(c) for c in references.candidates(db, result)]


@router.post("/{result_id}/references", status_code=201, dependencies=[requires_role(CLINICIAN)])
def choose(db: Db, requester: RequesterDep, result_id: int, choice: Choice) -> dict[str, Any]:
    """Compare the result with other sessions: a new version; the older ones stay."""
    result = results.require_done(results.get(db, result_id))
    made = references.choose(db, result, choice.before, choice.other, requester.name, newest().data)
    return references_payload(db, result, made)


def references_payload(db: Session, result: Result, stored: References) -> dict[str, Any]:
    """For pages: a version, what it names, which versions there are, and the other hand of the same visit where that is not what it names."""
    beside = {s.id for s in records.same_visit(db, result.recording.session)}
    is_taken = not beside or (stored.other and stored.other.session in beside)
    offered = [] if is_taken else references.candidates(db, result)
    same_visit = [_comparison_row(c) for c in offered if c.session in beside]
    return {
        "number": stored.number,
        "made": stored.made,
        "author": stored.author,
        "affected": stored.affected,
        "before": _comparison_row(stored.before) if stored.before else None,
        "other": _comparison_row(stored.other) if stored.other else None,
        "same_visit": same_visit[-1] if same_visit else None,
        "edition": stored.reference_values["version"],
        "versions": [
            {"number": v.number, "made": v.made, "author": v.author}
            for v in references.versions(db, result)
        ],
    }


def _comparison_row(c: Compared) -> dict[str, Any]:
    return {
        "result": c.result,
        "session": c.session,
        "hand": c.hand,
        "started": c.started,
        "figures": len(c.values),
    }
