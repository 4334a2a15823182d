"""several servers on one database: who they are, and whose a file is until it lies in the object storage."""

import sqlalchemy as sa
from alembic import op

revision = "0024"
down_revision = "0023"
branch_labels = None
depends_on = None

OWNED = ("recording", "result", "erased_file")


def upgrade() -> None:
    op.create_table(
        "server",
        sa.Column("id", sa.String(32), primary_key=True),
        sa.Column("name", sa.String(100), nullable=False),
        sa.Column("address", sa.String(300), nullable=False),
        sa.Column("storage", sa.String(32), nullable=False),
        sa.Column("seen", sa.DateTime(), nullable=False),
    )
    for table in OWNED:
        op.add_column(table, sa.Column("server", sa.String(32), nullable=False, server_default=""))


def downgrade() -> None:
    for table in OWNED:
        op.drop_column(table, "server")
    op.drop_table("server")
