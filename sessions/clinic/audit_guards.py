"""The triggers that keep the audit trail only appended to: which should be there, and which are not."""

from sqlalchemy import inspect, text
from sqlalchemy.orm import Session

TRIGGERS = {
    "sqlite": frozenset({"audit_no_update", "audit_no_delete", "audit_no_replace"}),
    "postgresql": frozenset({"audit_no_change", "audit_no_truncate"}),
}
QUERIES = {
    "sqlite": "SELECT name FROM sqlite_master WHERE type = 'trigger' AND tbl_name = 'audit'",
    "postgresql": "SELECT tgname FROM pg_trigger WHERE tgrelid = 'audit'::regclass AND tgenabled <> 'D'",
}


def has_trail(db: Session) -> bool:
    """Whether the table is there."""
    return inspect(db.connection()).has_table("audit")


def find_missing_triggers(db: Session) -> tuple[str, ...]:
    """Names of triggers that somebody removed or disabled."""
    dialect = db.get_bind().dialect.name
    if dialect not in TRIGGERS:
        return ()
    return tuple(sorted(TRIGGERS[dialect] - set(db.scalars(text(QUERIES[dialect])))))
