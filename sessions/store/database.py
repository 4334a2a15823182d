"""Open the database: SQLite in the data folder by default, any SQLAlchemy URL otherwise; brought up to date on opening."""

import os
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, Engine, create_engine, event, text, update
from sqlalchemy.exc import ArgumentError, DatabaseError, DBAPIError
from sqlalchemy.orm import Session, sessionmaker

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit, repeatability
from handscope.sessions.db import visible_rows
from handscope.sessions.db.tables import Login
from handscope.sessions.store.folder_privacy import keep_private
from handscope.sessions.wards import access_deadlines

FILE = "handscope.sqlite"
AUDIT_COPY = "HANDSCOPE_AUDIT_COPY"  # environment: where lines of the audit trail go besides
RESTORING = "restoring"  # lies in a data folder while a backup is being put into it
MIGRATIONS = str(files("handscope.sessions.db") / "migrations")
WAIT = 5.0  # s that a change waits for another process that holds SQLite's lock
# reads go on beside changes that wait
_POOL: dict[str, Any] = {"pool_size": 20, "max_overflow": 40}
UPGRADE_LOCK = 0x68616E64  # PostgreSQL: one process at a time brings the schema up to date; any number that nobody else uses


def open_database(folder: Path, url: str | None = None) -> sessionmaker[Session]:
    """A factory of database sessions on a schema that is up to date."""
    keep_private()
    engine = connect(folder, url)
    try:
        _require_known(engine)
        upgrade(engine)
    except InputError:
        engine.dispose()
        raise
    except DatabaseError as problem:
        engine.dispose()
        raise InputError(
            "store.database_cannot_open", engine=place_of(engine), orig=answer_of(problem)
        ) from None
    database = sessionmaker(engine, expire_on_commit=False)
    visible_rows.enable(database)
    access_deadlines.enable(database)
    repeatability.enable(database)
    audit.enable(database, os.environ.get(AUDIT_COPY, ""))
    return database


def connect(folder: Path, url: str | None = None) -> Engine:
    """The database as it is, not brought up to date; InputError where the URL names none or its driver is not installed."""
    try:
        engine = create_engine(
            url or f"sqlite:///{folder / FILE}",
            pool_pre_ping=True,
            hide_parameters=True,  # an error's words, which are logged, quote no patient
            **_POOL,
            connect_args=connect_arguments(url or ""),
        )
    except (ArgumentError, ImportError) as problem:
        raise InputError("store.database_url", problem=str(problem)) from None
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", _prepare_sqlite)
        event.listen(engine, "checkin", _patient_again)
    return engine


def hurry(db: Session, wait: float) -> None:
    """Until its end, changes of the transaction that begins wait at most so long (s) for another writer: work that may be left out makes nobody wait."""
    if db.get_bind().dialect.name == "sqlite":  # the pool sets it back (_patient_again)
        db.execute(text(f"PRAGMA busy_timeout={1000 * wait:.0f}"))
    else:
        db.execute(text(f"SET LOCAL lock_timeout = {1000 * wait:.0f}"))


def require_writable(db: Session, wait: float) -> None:
    """DBAPIError where the database takes no change within `wait` s; nothing is changed."""
    hurry(db, wait)
    db.execute(update(Login).where(Login.id < 0).values(token_hash=""))
    db.rollback()


def place_of(engine: Engine) -> str:
    """The database's URL as it may be shown: without its password."""
    return engine.url.render_as_string(hide_password=True)


def answer_of(problem: DBAPIError) -> str:
    """What the database's driver says, on one line: PostgreSQL's words come with a picture of where in the query they belong."""
    return " ".join(str(problem.orig).replace("^", " ").split())


def upgrade(engine: Engine, to: str = "head") -> None:
    """Run the migrations that are missing."""
    with engine.connect() as connection:
        if to == "head" and is_up_to_date(connection):
            return
        connection.rollback()  # what was read began a transaction
        config = _config()
        sqlite = engine.dialect.name == "sqlite"
        if sqlite:  # a table is changed by making it anew: dropping the old one must not take the rows that refer to it
            connection.exec_driver_sql("PRAGMA foreign_keys=OFF")
            connection.commit()
        with connection.begin():
            if sqlite:
                # all or nothing, one process at a time
                connection.exec_driver_sql("BEGIN IMMEDIATE")
            else:
                connection.exec_driver_sql("SET LOCAL lock_timeout = 0")
                connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({UPGRADE_LOCK})")
            config.attributes["connection"] = connection
            command.upgrade(config, to)
        if sqlite:
            connection.exec_driver_sql("PRAGMA foreign_keys=ON")
            connection.commit()


def is_known(revision: str) -> bool:
    """Whether a revision of the schema is one of this program."""
    return revision in {script.revision for script in _scripts().walk_revisions()}


def is_up_to_date(connection: Connection) -> bool:
    """Whether the schema is this program's."""
    newest = _scripts().get_current_head()
    return MigrationContext.configure(connection).get_current_revision() == newest


@cache
def _scripts() -> ScriptDirectory:
    """The migrations, read once."""
    return ScriptDirectory.from_config(_config())


def _config() -> Config:
    config = Config()
    config.set_main_option("script_location", MIGRATIONS)
    return config


def _require_known(engine: Engine) -> None:
    """InputError where a newer program has been at work: what it changed would not be kept as it means it."""
    with engine.connect() as connection:
        revision = MigrationContext.configure(connection).get_current_revision()
    if revision is not None and not is_known(revision):
        raise InputError("store.database_newer", engine=place_of(engine), revision=revision)


def connect_arguments(url: str) -> dict[str, Any]:
    """PostgreSQL: a network that was cut is noticed within seconds, and a change waits for a lock at most WAIT."""
    if not url.startswith("postgresql+psycopg"):
        return {}
    return {
        "connect_timeout": round(WAIT),
        "keepalives_idle": 5,
        "keepalives_interval": 2,
        "keepalives_count": 3,
        "tcp_user_timeout": round(1000 * 2 * WAIT),
        "options": f"-c lock_timeout={1000 * WAIT:.0f}",
    }


def _patient_again(connection: object, record: object) -> None:
    """A connection that goes back to the pool waits as long as every other."""
    if connection is not None:
        connection.execute(f"PRAGMA busy_timeout={1000 * WAIT:.0f}")  # type: ignore[attr-defined]


def _prepare_sqlite(connection: Any, record: object) -> None:
    # its own knows the letters of ASCII alone
    connection.create_function("lower", 1, _casefold, deterministic=True)
    cursor = connection.cursor()
    for pragma in (
        "journal_mode=WAL",
        "synchronous=FULL",
        "foreign_keys=ON",
        f"busy_timeout={1000 * WAIT:.0f}",
        "secure_delete=ON",
    ):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


def _casefold(value: object) -> object:
    return value.casefold() if isinstance(value, str) else value
