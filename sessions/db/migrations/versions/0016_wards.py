"""wards: patients and accounts belong to them. Everybody and everything from before belongs to the whole house."""

import sqlalchemy as sa
from alembic import op

from handscope.sessions.db import tables

revision = "0016"
down_revision = "0015"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "ward",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(length=64), nullable=False, unique=True),
        sa.Column("created", tables.UtcDateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id"),
        sqlite_autoincrement=True,
    )
    # without a number: the first that the database gives is 1, and PostgreSQL's sequence goes on from it
    op.execute("INSERT INTO ward (name, created) VALUES ('all', CURRENT_TIMESTAMP)")
    op.create_table(
        "ward_member",
        sa.Column("account_id", sa.Integer(), nullable=False),
        sa.Column("ward_id", sa.Integer(), nullable=False),
        sa.Column("head", sa.Boolean(), nullable=False),
        sa.ForeignKeyConstraint(["account_id"], ["account.id"], ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["ward_id"], ["ward.id"]),
        sa.PrimaryKeyConstraint("account_id", "ward_id"),
    )
    op.create_index("ix_ward_member_ward_id", "ward_member", ["ward_id"])
    op.execute(
        "INSERT INTO ward_member (account_id, ward_id, head) SELECT id, 1, false FROM account"
    )
    op.create_table(
        "emergency_access",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("patient_id", sa.Integer(), nullable=False),
        sa.Column("account_id", sa.Integer(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("begun", tables.UtcDateTime(), nullable=False),
        sa.Column("ends", tables.UtcDateTime(), nullable=False),
        sa.ForeignKeyConstraint(["patient_id"], ["patient.id"], ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["account_id"], ["account.id"], ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id"),
        sqlite_autoincrement=True,
    )
    for column in ("patient_id", "account_id"):
        op.create_index(f"ix_emergency_access_{column}", "emergency_access", [column])
    # as SQL: Alembic would make SQLite's table anew, which forgets the numbers of erased patients
    op.execute(
        "ALTER TABLE patient ADD COLUMN ward_id INTEGER DEFAULT 1 NOT NULL REFERENCES ward (id)"
    )
    op.create_index("ix_patient_ward_id", "patient", ["ward_id"])


def downgrade() -> None:
    op.drop_index("ix_patient_ward_id", "patient")
    with op.batch_alter_table("patient") as patient:
        patient.drop_column("ward_id")
    for table in ("emergency_access", "ward_member", "ward"):
        op.drop_table(table)
