"""What is made on demand: it waits for no computation, says what went wrong, and ends as soon as nobody waits for it."""

import asyncio
import os
import time
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path

import pytest

from handscope.app.documents import Documents, LeftError, make_report
from handscope.estimators.errors import InputError
from handscope.sessions.store.store import Store, open_store

WAIT = 120.0  # s until a test gives up


def nothing(_: Store) -> int:
    return 7


def abort(_: Store) -> None:
    os.abort()


def take_long(store: Store, name: str = "begun") -> None:
    (store.folder / name).touch()
    time.sleep(WAIT)


async def stays() -> bool:
    return False


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path)


@pytest.fixture
def documents(store: Store) -> Iterator[Documents]:
    with Documents(store) as made:
        yield made


def after(path: Path) -> Callable[[], Awaitable[bool]]:
    """Somebody who leaves as soon as the file is there."""

    async def gone() -> bool:
        return path.exists()

    return gone


def test_work_whose_process_dies_says_so_and_the_next_is_done(documents: Documents) -> None:
    with pytest.raises(InputError, match="ended unexpectedly"):
        asyncio.run(documents.run(stays, abort))
    assert asyncio.run(documents.run(stays, nothing)) == 7


def test_work_that_is_refused_says_why(documents: Documents) -> None:
    with pytest.raises(InputError, match="there is no result 99"):
        asyncio.run(documents.run(stays, make_report, 99, "pdf"))


def test_what_is_made_for_one_who_leaves_is_ended_and_the_next_is_done(
    documents: Documents, store: Store, caplog: pytest.LogCaptureFixture
) -> None:
    begun = time.monotonic()
    with pytest.raises(LeftError):
        asyncio.run(documents.run(after(store.folder / "begun"), take_long))
    assert asyncio.run(documents.run(stays, nothing)) == 7
    assert time.monotonic() - begun < WAIT
    assert caplog.records == []  # nothing went wrong


def test_what_waits_for_one_who_leaves_is_never_begun(documents: Documents, store: Store) -> None:
    async def two() -> list[object]:
        first = asyncio.ensure_future(
            documents.run(after(store.folder / "over"), take_long, "first")
        )
        while not (store.folder / "first").exists():
            await asyncio.sleep(0.01)
        second = documents.run(after(store.folder / "first"), take_long, "second")
        found: list[object] = list(await asyncio.gather(second, return_exceptions=True))
        (store.folder / "over").touch()
        return found + list(await asyncio.gather(first, return_exceptions=True))

    assert [type(error) for error in asyncio.run(two())] == [LeftError, LeftError]
    assert not (store.folder / "second").exists()
