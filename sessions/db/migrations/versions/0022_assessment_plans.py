"""a clinic's own assessment plans are stored with all their versions, and a session names the one it had."""

import sqlalchemy as sa
from alembic import op

from handscope.sessions.db import tables

revision = "0022"
down_revision = "0021"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "assessment_plan",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(length=60), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("content", sa.JSON(), nullable=False),
        sa.Column("author", sa.String(length=64), nullable=False),
        sa.Column("stored", tables.UtcDateTime(), nullable=False),
        sa.Column("withdrawn", tables.UtcDateTime(), nullable=True),
        sa.PrimaryKeyConstraint("id"),
        sa.UniqueConstraint("name", "version"),
        sqlite_autoincrement=True,
    )
    op.add_column("session", sa.Column("plan", sa.JSON(), nullable=False, server_default="{}"))


def downgrade() -> None:
    op.drop_column("session", "plan")
    op.drop_table("assessment_plan")
