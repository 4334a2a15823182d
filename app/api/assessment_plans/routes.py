"""/api/assessment-plans: which tasks a diagnosis asks for, in versions; exported and imported as files."""

import json
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from pydantic import Field
from sqlalchemy.orm import Session

from handscope.app.api.answers import PlanRow, answers
from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import CLINICIAN, RequesterDep, requires_role
from handscope.app.language import Language
from handscope.app.protocols import Protocol, offered
from handscope.app.protocols.plans import Plan, built_in, content_of, plan_of
from handscope.app.state import Db, LanguageDep, PartsDep
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.assessment_plans import stored
from handscope.sessions.db.conflicts import require_seen
from handscope.sessions.db.tables import AssessmentPlan

router = APIRouter(tags=["assessment plans"], dependencies=[requires_role(CLINICIAN)])
Version = Annotated[int | None, Query(ge=1, description="without it the newest")]


class NewPlan(Incoming):
    """A plan's content as its file holds it; what it says of its version is not looked at."""

    content: dict[str, Any]
    seen: int = Field(
        0,
        ge=0,
        description="the newest version that was seen; 0: a plan that there was not, or that was withdrawn",
    )


@router.get("/assessment-plans", responses=answers(list[PlanRow]))
def list_plans(db: Db, language: LanguageDep) -> Any:
    """The newest version of every plan that is offered, by title."""
    own = stored.newest(db)
    rows = [
        *(_row(p, None, language) for name, p in built_in().items() if name not in own),
        *(_row(_plan(r), r, language) for r in own.values() if r.withdrawn is None),
    ]
    return sorted(rows, key=lambda row: row["title"].casefold())


@router.get("/assessment-plans/{plan}", responses=answers(PlanRow))
def read_plan(db: Db, language: LanguageDep, plan: str, version: Version = None) -> Any:
    """A plan with its tasks."""
    found, row = find(db, plan, version)
    return _row(found, row, language)


@router.get("/assessment-plans/{plan}/file.json")
def export_plan(db: Db, plan: str, version: Version = None) -> Response:
    """A plan as a file for another house."""
    found, _ = find(db, plan, version)
    name = f"{found.name}-{found.version}.json"
    return Response(
        json.dumps(content_of(found), indent=2, ensure_ascii=False) + "\n",
        media_type="application/json",
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )


@router.post("/assessment-plans", status_code=201, responses=answers(PlanRow, 201))
def store_plan(
    db: Db, parts: PartsDep, requester: RequesterDep, language: LanguageDep, new: NewPlan
) -> Any:
    """Store a plan, or a new version of one; 409 where there is a newer one than was seen.

    A plan that was withdrawn is in no list: it is offered again with its next version, seen or not.
    """
    plan = plan_of({**new.content, "version": 1}, _tasks(parts.store.folder))
    rows, known = stored.versions(db, plan.name), built_in().get(plan.name)
    before = max([*(r.version for r in rows), known.version if known else 0])
    is_withdrawn = bool(rows) and rows[0].withdrawn is not None
    if new.seen or not is_withdrawn:
        require_seen(phrase("conflict.plan"), before, new.seen)
    row = stored.store(db, content_of(plan), before, requester.name)
    return _row(_plan(row), row, language)


@router.delete("/assessment-plans/{plan}", status_code=204)
def withdraw_plan(db: Db, plan: str) -> None:
    """Offer a plan of the clinic's no more, nor one of Handscope's by that name; a new version of it brings it back."""
    row = stored.newest(db).get(plan)
    if row is None:
        raise InputError("plan.not_own", plan=plan)
    stored.withdraw(db, row)


def find(db: Session, name: str, version: int | None = None) -> tuple[Plan, AssessmentPlan | None]:
    """A plan in a version, or in the newest; InputError where there is none."""
    for row in stored.versions(db, name):
        if version in (None, row.version):
            return _plan(row), row
    known = built_in().get(name)
    if known is None or version not in (None, known.version):
        raise InputError("plan.unknown", plan=name)
    return known, None


def _plan(row: AssessmentPlan) -> Plan:
    """A stored plan, whatever tasks there are now."""
    return plan_of(row.content, None)


def _row(plan: Plan, row: AssessmentPlan | None, language: Language) -> PlanRow:
    content, translate = content_of(plan), language.translate
    if row is None:  # Handscope's own words have translations
        content = {
            **content,
            "title": translate(plan.title),
            "note": translate(plan.note) if plan.note else "",
            "sources": [translate(s) for s in plan.sources],
        }
    return {
        "name": plan.name,
        "version": plan.version,
        "title": content["title"],
        "content": content,
        "own": row is not None,
        "author": row.author if row else "",
        "stored": row.stored if row else None,
    }


def _tasks(folder: Any) -> dict[str, Protocol]:
    return offered(folder)[0]
