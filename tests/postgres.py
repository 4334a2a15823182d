"""A PostgreSQL server of the tests' own, where its programs are installed."""

import os
import shutil
import subprocess
import tempfile
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest

MISSING = "no PostgreSQL server (initdb, postgres) or no psycopg on this machine"


@cache
def programs() -> dict[str, str] | None:
    """Paths of the server's programs; None where they are not installed."""
    found = {}
    for name in ("initdb", "postgres"):
        places = [
            shutil.which(name),
            *sorted(map(str, Path("/usr/lib/postgresql").glob(f"*/bin/{name}")), reverse=True),
        ]
        if (path := next((p for p in places if p), None)) is None:
            return None
        found[name] = path
    return found


@contextmanager
def server(address: str = "", prefix: Sequence[str] = ()) -> Iterator[str]:
    """A server on a socket in a folder of its own, and on an IP address where one is named; gives the URL of its database `postgres`.

    `prefix` is a command that starts it elsewhere. Skips the test where there is none.
    """
    pytest.importorskip("psycopg", reason=MISSING)
    if (found := programs()) is None:
        pytest.skip(MISSING)
    folder = Path(tempfile.mkdtemp(prefix="handscope-pg-"))
    user = _other_user(folder)
    try:
        subprocess.run([found["initdb"], "-D", folder / "data", "-U", "handscope", "-A", "trust", "-E", "UTF8", "--no-sync"], user=user, check=True, capture_output=True, cwd=folder)  # fmt: skip
        if address:
            with (folder / "data" / "pg_hba.conf").open("a") as rules:
                rules.write("host all all samenet trust\n")
        words = [*prefix, "runuser", "-u", user, "--"] if prefix and user else list(prefix)
        words += [
            found["postgres"],
            "-D",
            folder / "data",
            "-k",
            folder,
            "-c",
            f"listen_addresses={address}",
            "-c",
            "fsync=off",
        ]
        with (folder / "log").open("wb") as log:
            as_user = None if prefix else user
            process = subprocess.Popen(words, user=as_user, stdout=log, stderr=log, cwd=folder)
        try:
            _wait(folder, process)
            yield (
                f"postgresql+psycopg://handscope@{address}/postgres"
                if address
                else f"postgresql+psycopg://handscope@/postgres?host={folder}"
            )
        finally:
            process.terminate()
            process.wait()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def empty_database(url: str) -> Iterator[str]:
    """A new database of the server; gives its URL."""
    from sqlalchemy import create_engine, make_url

    name = f"t{uuid.uuid4().hex}"
    engine = create_engine(url, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.exec_driver_sql(f"CREATE DATABASE {name}")
    try:
        yield make_url(url).set(database=name).render_as_string(hide_password=False)
    finally:
        with engine.connect() as connection:
            connection.exec_driver_sql(f"DROP DATABASE {name} WITH (FORCE)")
        engine.dispose()


def _other_user(folder: Path) -> str | None:
    """PostgreSQL does not run as root: then as its own user, or nobody."""
    if os.getuid() != 0:
        return None
    import pwd

    user = next(
        name for name in ("postgres", "nobody") if name in {u.pw_name for u in pwd.getpwall()}
    )
    shutil.chown(folder, user)
    return user


def _wait(folder: Path, process: "subprocess.Popen[bytes]") -> None:
    import time

    until = time.monotonic() + 120
    while (
        not list(folder.glob(".s.PGSQL.*.lock"))
        or b"ready to accept" not in (folder / "log").read_bytes()
    ):
        assert process.poll() is None, (folder / "log").read_text()
        assert time.monotonic() < until, "PostgreSQL did not start"
        time.sleep(0.05)
