"""how high above the hips the trunk's sensor is worn: a measure of the patient, and what a session began with."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None


def upgrade() -> None:
    for table in ("patient", "session"):
        op.add_column(table, sa.Column("trunk_height", sa.Double(), nullable=True))


def downgrade() -> None:
    for table in ("session", "patient"):
        op.drop_column(table, "trunk_height")
