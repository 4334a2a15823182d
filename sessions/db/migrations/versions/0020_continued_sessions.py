"""a session may continue another: the other hand, measured just before in the same visit."""

from alembic import op

revision = "0020"
down_revision = "0019"
branch_labels = None
depends_on = None


def upgrade() -> None:
    # as SQL: Alembic would make SQLite's table anew, which forgets the numbers of erased sessions
    op.execute(
        "ALTER TABLE session ADD COLUMN continues_id INTEGER REFERENCES session (id) ON DELETE SET NULL"
    )
    op.create_index("ix_session_continues_id", "session", ["continues_id"])


def downgrade() -> None:
    op.drop_index("ix_session_continues_id", "session")
    with op.batch_alter_table("session") as session:
        session.drop_column("continues_id")
