"""Two people change the same thing at once: the second gets a ConflictError, and nothing is overwritten unseen."""

from sqlalchemy import update
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.sessions.db.tables import Account, PatientSession


class ConflictError(InputError):
    """What was to be changed is no longer what was seen."""


def require_seen(sentence: str, version: int, seen: int) -> None:
    """ConflictError with this sentence where the version that was seen is not the one stored."""
    if version != seen:
        raise ConflictError(sentence)


def claim_version(db: Session, row: Account | PatientSession, version: int, sentence: str) -> None:
    """Count the row's version up and read the row anew; undo all and ConflictError with this sentence where `version` is not the one stored."""
    table = type(row)
    seen = update(table).where(table.id == row.id, table.version == version)
    claimed = db.execute(
        seen.values(version=version + 1)
        .returning(table.id)
        .execution_options(synchronize_session=False)
    ).first()
    if claimed is None:
        db.rollback()
        raise ConflictError(sentence)
    db.refresh(row)
