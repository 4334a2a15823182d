"""what people write on a session has a version; its date can be corrected, and what the clock said is kept."""

import sqlalchemy as sa
from alembic import op

from handscope.sessions.db import tables

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("session", sa.Column("recorded_as", tables.UtcDateTime(), nullable=True))
    op.add_column(
        "session", sa.Column("date_reason", sa.String(), nullable=False, server_default="")
    )
    op.add_column("session", sa.Column("version", sa.Integer(), nullable=False, server_default="1"))


def downgrade() -> None:
    op.execute("UPDATE session SET started = recorded_as WHERE recorded_as IS NOT NULL")
    for column in ("version", "date_reason", "recorded_as"):
        op.drop_column("session", column)
