"""what a photograph of a hand on the sheet told is kept with the patient, the picture only where somebody asked."""

import sqlalchemy as sa
from alembic import op

from handscope.sessions.db import tables

revision = "0017"
down_revision = "0016"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "hand_photograph",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("patient_id", sa.Integer(), nullable=False),
        sa.Column("hand", sa.String(length=5), nullable=False),
        sa.Column("taken", tables.UtcDateTime(), nullable=False),
        sa.Column("version", sa.String(length=32), nullable=False),
        *(sa.Column(name, sa.JSON(), nullable=False) for name in ("marks", "figures")),
        sa.Column("picture", sa.Text(), nullable=True),
        sa.ForeignKeyConstraint(["patient_id"], ["patient.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_hand_photograph_patient_id", "hand_photograph", ["patient_id"])


def downgrade() -> None:
    op.drop_table("hand_photograph")
