"""how far figures come out alike when measured again, by patient and by glove."""

import sqlalchemy as sa
from alembic import op

from handscope.sessions.db import tables

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "repeatability",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("patient_id", sa.Integer(), nullable=True),
        sa.Column("device", sa.String(length=200), nullable=False),
        sa.Column("hand", sa.String(length=5), nullable=False),
        sa.Column("method", sa.String(length=32), nullable=False),
        sa.Column("parameters", sa.JSON(), nullable=False),
        sa.Column("measure", sa.String(length=32), nullable=False),
        sa.Column("task", sa.String(), nullable=False),
        sa.Column("name", sa.String(length=64), nullable=False),
        sa.Column("unit", sa.String(length=16), nullable=False),
        *(
            sa.Column(name, sa.Double(), nullable=False)
            for name in ("sem", "mdc95", "mdc95_low", "mdc95_high")
        ),
        *(sa.Column(name, sa.Double(), nullable=True) for name in ("icc", "icc_low", "icc_high")),
        *(
            sa.Column(name, sa.Integer(), nullable=False)
            for name in ("people", "sessions", "freedom")
        ),
        sa.Column("results", sa.JSON(), nullable=False),
        sa.Column("computed", tables.UtcDateTime(), nullable=False),
        sa.ForeignKeyConstraint(["patient_id"], ["patient.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id"),
    )
    with op.batch_alter_table("repeatability") as batch_op:
        batch_op.create_index("ix_repeatability_patient_id", ["patient_id"])
        batch_op.create_index("ix_repeatability_device", ["device"])


def downgrade() -> None:
    op.drop_table("repeatability")
