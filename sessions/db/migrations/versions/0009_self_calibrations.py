"""what self-calibration found is kept with the patient; a person decides what a session takes over of it."""

import sqlalchemy as sa
from alembic import op

from handscope.sessions.db import tables

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "self_calibration",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("patient_id", sa.Integer(), nullable=False),
        sa.Column("recording_id", sa.Integer(), nullable=False),
        sa.Column("hand", sa.String(length=5), nullable=False),
        sa.Column("glove", sa.String(length=200), nullable=False),
        *(sa.Column(name, sa.Double(), nullable=False) for name in ("onset", "end")),
        sa.Column("version", sa.String(length=32), nullable=False),
        *(sa.Column(name, sa.JSON(), nullable=False) for name in ("found", "told")),
        sa.Column("kept", tables.UtcDateTime(), nullable=False),
        sa.Column("withdrawn", tables.UtcDateTime(), nullable=True),
        sa.ForeignKeyConstraint(["patient_id"], ["patient.id"], ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["recording_id"], ["recording.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id"),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "reuse",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("session_id", sa.Integer(), nullable=False),
        sa.Column("self_calibration_id", sa.Integer(), nullable=True),
        sa.Column("parts", sa.String(length=20), nullable=False),
        sa.Column("made", tables.UtcDateTime(), nullable=False),
        sa.ForeignKeyConstraint(["session_id"], ["session.id"], ondelete="CASCADE"),
        sa.ForeignKeyConstraint(
            ["self_calibration_id"], ["self_calibration.id"], ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id"),
    )
    for table, column in (
        ("self_calibration", "patient_id"),
        ("self_calibration", "recording_id"),
        ("reuse", "session_id"),
        ("reuse", "self_calibration_id"),
    ):
        op.create_index(f"ix_{table}_{column}", table, [column])
    with op.batch_alter_table("result") as batch_op:
        batch_op.add_column(sa.Column("reused", sa.JSON(), nullable=False, server_default="{}"))


def downgrade() -> None:
    with op.batch_alter_table("result") as batch_op:
        batch_op.drop_column("reused")
    op.drop_table("reuse")
    op.drop_table("self_calibration")
