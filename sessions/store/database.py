"""Open the database: SQLite in the data folder by default, any SQLAlchemy URL otherwise; brought up to date on opening."""

from importlib.resources import files
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Engine, create_engine, event
from sqlalchemy.exc import ArgumentError, DatabaseError
from sqlalchemy.orm import Session, sessionmaker

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit, repeatability

FILE = "handscope.sqlite"
RESTORING = "restoring"  # lies in a data folder while a backup is being put into it
MIGRATIONS = str(files("handscope.sessions.db") / "migrations")
UPGRADE_LOCK = 0x68616E64  # PostgreSQL: one process at a time brings the schema up to date; any number that nobody else uses


def open_database(folder: Path, url: str | None = None) -> sessionmaker[Session]:
    """A factory of database sessions on a schema that is up to date."""
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
            f"the database {place_of(engine)} cannot be opened ({problem.orig}); restore it from a backup or choose another --data folder"
        ) from None
    database = sessionmaker(engine, expire_on_commit=False)
    repeatability.enable(database)
    audit.enable(database)
    return database


def connect(folder: Path, url: str | None = None) -> Engine:
    """The database as it is, not brought up to date; InputError where the URL names none or its driver is not installed."""
    try:
        engine = create_engine(url or f"sqlite:///{folder / FILE}", pool_pre_ping=True)
    except (ArgumentError, ImportError) as problem:
        raise InputError(
            f"the database URL is not understood ({problem}); for PostgreSQL: postgresql+psycopg://user:password@host/name, with pip install handscope[postgresql]"
        ) from None
    if engine.dialect.name == "sqlite":
        event.listen(engine, "connect", _prepare_sqlite)
    return engine


def place_of(engine: Engine) -> str:
    """The database's URL as it may be shown: without its password."""
    return engine.url.render_as_string(hide_password=True)


def upgrade(engine: Engine, to: str = "head") -> None:
    """Run the migrations that are missing."""
    config = Config()
    config.set_main_option("script_location", MIGRATIONS)
    with engine.connect() as connection:
        sqlite = engine.dialect.name == "sqlite"
        if sqlite:  # a table is changed by making it anew: dropping the old one must not take the rows that refer to it
            connection.exec_driver_sql("PRAGMA foreign_keys=OFF")
            connection.commit()
        with connection.begin():
            if sqlite:
                connection.exec_driver_sql(
                    "BEGIN IMMEDIATE"
                )  # all or nothing, one process at a time
            else:
                connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({UPGRADE_LOCK})")
            config.attributes["connection"] = connection
            command.upgrade(config, to)
        if sqlite:
            connection.exec_driver_sql("PRAGMA foreign_keys=ON")
            connection.commit()


def is_known(revision: str) -> bool:
    """Whether this program knows a revision of the schema."""
    config = Config()
    config.set_main_option("script_location", MIGRATIONS)
    return revision in {
        script.revision for script in ScriptDirectory.from_config(config).walk_revisions()
    }


def _require_known(engine: Engine) -> None:
    """InputError where a newer program has been at work: what it changed would not be kept as it means it."""
    with engine.connect() as connection:
        revision = MigrationContext.configure(connection).get_current_revision()
    if revision is not None and not is_known(revision):
        raise InputError(
            f"the database {place_of(engine)} has the schema {revision} of a newer version of Handscope, which this one does not know; "
            "start the newer version, or restore a backup that was made before it"
        )


def _prepare_sqlite(connection: object, record: object) -> None:
    cursor = connection.cursor()  # type: ignore[attr-defined]
    for pragma in (
        "journal_mode=WAL",
        "synchronous=FULL",
        "foreign_keys=ON",
        "busy_timeout=10000",
        "secure_delete=ON",
    ):
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()
