"""a session's conclusion, and pain on the numerical rating scale."""

import sqlalchemy as sa
from alembic import op

revision = "0023"
down_revision = "0022"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column(
        "session", sa.Column("conclusion", sa.String(), nullable=False, server_default="")
    )
    for column in ("pain_rest", "pain_movement"):
        op.add_column("session", sa.Column(column, sa.Integer(), nullable=True))


def downgrade() -> None:
    for column in ("pain_movement", "pain_rest", "conclusion"):
        op.drop_column("session", column)
