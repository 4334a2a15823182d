"""What keeps the audit trail only appended to: its table and triggers as they should be, and which are not."""

from sqlalchemy import inspect, text
from sqlalchemy.orm import Session

from handscope.sessions.db.tables import AuditLine

REFUSE = "SELECT RAISE(ABORT, 'the audit trail is only appended to'); END"
TRIGGERS = {  # by name, as the migrations make them: one that was made anew may do nothing
    "sqlite": {
        "audit_no_update": f"CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN {REFUSE}",
        "audit_no_delete": f"CREATE TRIGGER audit_no_delete BEFORE DELETE ON audit BEGIN {REFUSE}",
        "audit_no_replace": "CREATE TRIGGER audit_no_replace BEFORE INSERT ON audit "
        f"WHEN EXISTS (SELECT 1 FROM audit WHERE id = NEW.id) BEGIN {REFUSE}",
    },
    "postgresql": {  # pg_trigger.tgtype: for each row (1), before (2), delete (8), update (16), truncate (32)
        "audit_no_change": "27 BEGIN RAISE EXCEPTION 'the audit trail is only appended to'; END",
        "audit_no_truncate": "34 BEGIN RAISE EXCEPTION 'the audit trail is only appended to'; END",
    },
}
QUERIES = {
    "sqlite": "SELECT name, sql FROM sqlite_master WHERE type = 'trigger' AND tbl_name = 'audit'",
    "postgresql": "SELECT tgname, tgtype || ' ' || prosrc FROM pg_trigger JOIN pg_proc ON pg_proc.oid = tgfoid "
    "WHERE tgrelid = 'audit'::regclass AND tgenabled IN ('O', 'A') AND tgqual IS NULL",
}


def has_trail(db: Session) -> bool:
    """Whether the table is there."""
    return inspect(db.connection()).has_table("audit")


def find_missing_columns(db: Session) -> tuple[str, ...]:
    """Names of the table's columns that somebody removed."""
    found = {column["name"] for column in inspect(db.connection()).get_columns("audit")}
    return tuple(sorted(set(AuditLine.__table__.columns.keys()) - found))


def find_missing_triggers(db: Session) -> tuple[str, ...]:
    """Names of triggers that somebody removed, disabled or changed."""
    dialect = db.get_bind().dialect.name
    if dialect not in TRIGGERS:
        return ()
    found = {name: " ".join(words.split()) for name, words in db.execute(text(QUERIES[dialect]))}
    return tuple(n for n, words in sorted(TRIGGERS[dialect].items()) if found.get(n) != words)
