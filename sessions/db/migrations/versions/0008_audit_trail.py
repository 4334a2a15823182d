"""the audit line becomes an audit trail: who, where from, about what, chained by hashes, refused by the database to be changed or removed."""

import hashlib
import json
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from alembic import op

from handscope.sessions.db import tables

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None

REFUSE = "the audit trail is only appended to"


def upgrade() -> None:
    before = sa.table(
        "audit",
        sa.column("id"),
        sa.column("at", tables.UtcDateTime()),
        sa.column("counts", sa.JSON()),
    )
    stored_lines = op.get_bind().execute(sa.select(before).order_by(before.c.id)).all()
    op.drop_table("audit")
    audit = op.create_table(
        "audit",
        sa.Column("id", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("at", tables.UtcDateTime(), nullable=False),
        sa.Column("who", sa.String(length=64), nullable=False),
        sa.Column("address", sa.String(length=64), nullable=False),
        sa.Column("what", sa.String(length=64), nullable=False),
        sa.Column("kind", sa.String(length=32), nullable=False),
        sa.Column("ref", sa.String(length=64), nullable=False),
        sa.Column("patient", sa.Integer(), nullable=True),
        sa.Column("counts", sa.JSON(), nullable=False),
        sa.Column("previous", sa.String(length=64), nullable=False),
        sa.Column("hash", sa.String(length=64), nullable=False),
        sa.PrimaryKeyConstraint("id"),
    )
    op.create_index("ix_audit_who", "audit", ["who"])
    op.create_index("ix_audit_patient", "audit", ["patient"])
    previous = "0" * 64
    for number, (_, at, counts) in enumerate(
        stored_lines, 1
    ):  # erased patients are all that there was
        row = _line(number, at, counts, previous)
        op.get_bind().execute(sa.insert(audit).values(row))
        previous = row["hash"]
    if op.get_context().dialect.name == "sqlite":
        for action in ("UPDATE", "DELETE"):
            op.execute(
                f"CREATE TRIGGER audit_no_{action.lower()} BEFORE {action} ON audit BEGIN SELECT RAISE(ABORT, '{REFUSE}'); END"
            )
    else:
        op.execute(
            f"CREATE FUNCTION audit_refuse() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN RAISE EXCEPTION '{REFUSE}'; END $$"
        )
        op.execute(
            "CREATE TRIGGER audit_no_change BEFORE UPDATE OR DELETE ON audit FOR EACH ROW EXECUTE FUNCTION audit_refuse()"
        )


def downgrade() -> None:
    bind = op.get_bind()
    erased = bind.execute(
        sa.text(
            "SELECT id, at, counts FROM audit WHERE what = 'erased' AND kind = 'patient' ORDER BY id"
        )
    ).all()
    op.drop_table("audit")
    if op.get_context().dialect.name != "sqlite":
        op.execute("DROP FUNCTION audit_refuse()")
    op.create_table(
        "audit",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("at", tables.UtcDateTime(), nullable=False),
        sa.Column("what", sa.String(length=64), nullable=False),
        sa.Column("counts", sa.JSON(), nullable=False),
        sa.PrimaryKeyConstraint("id"),
        sqlite_autoincrement=True,
    )
    for number, at, counts in erased:
        encoded = counts if isinstance(counts, str) else json.dumps(counts)
        statement = sa.text(
            "INSERT INTO audit (id, at, what, counts) VALUES (:id, :at, 'patient erased', :counts)"
        )
        bind.execute(statement, {"id": number, "at": at, "counts": encoded})


def _line(number: int, at: datetime, counts: dict[str, Any], previous: str) -> dict[str, Any]:
    row = {
        "id": number,
        "who": "server",
        "address": "",
        "what": "erased",
        "kind": "patient",
        "ref": "",
        "patient": None,
    }
    row |= {"counts": counts, "previous": previous}
    content = {**row, "at": at.astimezone(UTC).isoformat(timespec="microseconds")}
    total = hashlib.sha256(
        json.dumps(content, sort_keys=True, separators=(",", ":")).encode()
    ).hexdigest()
    return {**row, "at": at, "hash": total}
