"""notes of their own, the audit line of an erased patient, numbers that are never given again, an index for sessions left open."""

from typing import Literal

import sqlalchemy as sa
from alembic import op

from handscope.sessions.db import tables

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

NUMBERED = ("patient", "session", "recording", "result")


def upgrade() -> None:
    op.create_table(
        "note",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("patient_id", sa.Integer(), nullable=False),
        sa.Column("text", sa.String(), nullable=False),
        sa.Column("written", tables.UtcDateTime(), nullable=False),
        sa.Column("removed", tables.UtcDateTime(), nullable=True),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["patient_id"], ["patient.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_note_patient_id", "note", ["patient_id"])
    op.execute(
        "INSERT INTO note (patient_id, text, written, version) SELECT id, notes, created, 1 FROM patient WHERE trim(notes) <> ''"
    )
    op.create_table(
        "audit",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("at", tables.UtcDateTime(), nullable=False),
        sa.Column("what", sa.String(length=64), nullable=False),
        sa.Column("counts", sa.JSON(), nullable=False),
        sa.PrimaryKeyConstraint("id"),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "erased_file",
        sa.Column("file", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("file"),
    )
    again: Literal["always", "auto"] = (
        "always" if op.get_context().dialect.name == "sqlite" else "auto"
    )
    for table in NUMBERED:
        with op.batch_alter_table(
            table, recreate=again, table_kwargs={"sqlite_autoincrement": True}
        ) as batch_op:
            if table == "patient":
                batch_op.drop_column("notes")
            if table == "session":
                batch_op.create_index("ix_session_state", ["state"])


def downgrade() -> None:
    with op.batch_alter_table("session") as batch_op:
        batch_op.drop_index("ix_session_state")
    with op.batch_alter_table("patient") as batch_op:
        batch_op.add_column(sa.Column("notes", sa.String(), nullable=False, server_default=""))
    texts: dict[int, list[str]] = {}
    for patient, text in op.get_bind().execute(
        sa.text("SELECT patient_id, text FROM note WHERE removed IS NULL ORDER BY id")
    ):
        texts.setdefault(patient, []).append(text)
    for patient, found in texts.items():
        op.get_bind().execute(
            sa.text("UPDATE patient SET notes = :notes WHERE id = :id"),
            {"notes": "\n\n".join(found), "id": patient},
        )
    for table in ("erased_file", "audit", "note"):
        op.drop_table(table)
