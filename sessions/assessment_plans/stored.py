"""Versions of assessment plans: a change is a new version, the older ones stay for the sessions that had them."""

from collections.abc import Mapping
from typing import Any

from sqlalchemy import select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from handscope.estimators.messages.sentence import phrase
from handscope.sessions.db.conflicts import ConflictError
from handscope.sessions.db.tables import AssessmentPlan, now


def store(db: Session, content: Mapping[str, Any], seen: int, author: str) -> AssessmentPlan:
    """Keep the version after `seen`; ConflictError where somebody else stored it meanwhile."""
    version = seen + 1
    row = AssessmentPlan(
        name=content["name"],
        version=version,
        content={**content, "version": version},
        author=author,
    )
    db.add(row)
    try:
        db.commit()
    except IntegrityError:
        db.rollback()
        raise ConflictError(phrase("conflict.plan")) from None
    return row


def newest(db: Session) -> dict[str, AssessmentPlan]:
    """The newest version of each plan by name, withdrawn ones too."""
    rows = db.scalars(select(AssessmentPlan).order_by(AssessmentPlan.version))
    return {row.name: row for row in rows}


def versions(db: Session, name: str) -> list[AssessmentPlan]:
    """All versions of a plan, the newest first."""
    found = select(AssessmentPlan).where(AssessmentPlan.name == name)
    return list(db.scalars(found.order_by(AssessmentPlan.version.desc())))


def withdraw(db: Session, row: AssessmentPlan) -> None:
    """Offer a plan no more; sessions that had it keep it."""
    row.withdrawn = now()
    db.commit()
