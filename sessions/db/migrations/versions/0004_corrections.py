"""what a person took out of the figures, or moved, and why."""

import sqlalchemy as sa
from alembic import op

from handscope.sessions.db import tables

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "correction",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("recording_id", sa.Integer(), nullable=False),
        sa.Column("event", sa.Integer(), nullable=False),
        sa.Column("kind", sa.String(length=16), nullable=False),
        *(sa.Column(name, sa.Double(), nullable=False) for name in ("onset", "end")),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("made", tables.UtcDateTime(), nullable=False),
        sa.Column("undone", tables.UtcDateTime(), nullable=True),
        sa.ForeignKeyConstraint(["recording_id"], ["recording.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id"),
    )
    with op.batch_alter_table("correction") as batch_op:
        batch_op.create_index("ix_correction_recording_id", ["recording_id"])
    with op.batch_alter_table("result") as batch_op:
        batch_op.add_column(
            sa.Column("corrections", sa.JSON(), nullable=False, server_default="[]")
        )


def downgrade() -> None:
    with op.batch_alter_table("result") as batch_op:
        batch_op.drop_column("corrections")
    op.drop_table("correction")
