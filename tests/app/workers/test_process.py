"""The process for long work: values and errors come back, and it never outlives its parent."""

import os
import subprocess
import sys

import pytest

from handscope.app.workers.process import DiedError, Send, WorkerProcess
from tests.app.devices.virtual import wait_for

PARENT = """
import os, sys
from handscope.app.workers.process import WorkerProcess
if __name__ == "__main__":
    with WorkerProcess(os.getpid) as process:
        print(process.do(int), flush=True)
        sys.stdin.read()
"""


def divide(_: int, a: int, b: int) -> tuple[int, int]:
    return divmod(a, b)


def pid(prepared: int) -> int:
    """What `prepare` returned is what a call gets."""
    assert prepared == os.getpid()
    return prepared


def variable(_: int, name: str) -> str | None:
    return os.getenv(name)


def count(_: int, send: Send, to: int) -> None:
    for k in range(to):
        send(k)
    if to > 3:
        raise ValueError("enough")


def bug(_: int, word: str) -> None:
    raise ValueError(word)


def imported(_: int) -> set[str]:
    return set(sys.modules)


def unsendable(_: int) -> object:
    return lambda: None


def test_values_and_errors_come_back_with_where_they_arose() -> None:
    with WorkerProcess(os.getpid) as process:
        assert process.do(divide, 7, 2) == (3, 1)
        with pytest.raises(ValueError, match="seven") as error:
            process.do(bug, "seven")
        assert "in bug" in "".join(error.value.__notes__)
        assert process.do(divide, 7, 3) == (2, 1)


def test_messages_come_as_they_are_sent_and_then_the_error() -> None:
    with WorkerProcess(os.getpid) as process:
        assert list(process.stream(count, 3)) == [0, 1, 2]
        assert list(process.stream(count, 0)) == []
        messages = process.stream(count, 4)
        assert [next(messages) for _ in range(4)] == [0, 1, 2, 3]
        with pytest.raises(ValueError, match="enough"):
            list(messages)
        assert process.do(divide, 7, 3) == (2, 1)


def test_a_process_killed_while_it_waits_is_replaced() -> None:
    with WorkerProcess(os.getpid) as process:
        first = process.do(pid)
        process.kill()
        wait_for(lambda: not process.alive)
        assert process.do(pid) != first


def test_a_value_that_cannot_travel_ends_the_process_not_the_queue() -> None:
    with WorkerProcess(os.getpid) as process:
        with pytest.raises(DiedError):
            process.do(unsendable)
        assert process.do(divide, 7, 2) == (3, 1)


def test_a_process_sees_the_environment_of_its_own_beginning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for word in ("first", "second"):
        monkeypatch.setenv("HANDSCOPE_WORD", word)
        with WorkerProcess(os.getpid) as process:
            assert process.do(variable, "HANDSCOPE_WORD") == word


@pytest.mark.skipif(sys.platform != "linux", reason="forked on Linux alone")
def test_a_process_begins_with_what_its_work_needs() -> None:
    with WorkerProcess(os.getpid) as process:
        assert {"handscope.app.results.make", "handscope.app.results.report"} <= process.do(
            imported
        )


def test_killing_one_that_has_not_begun_is_nothing() -> None:
    with WorkerProcess(os.getpid) as process:
        process.kill()
        assert process.do(divide, 7, 2) == (3, 1)


@pytest.mark.slow
def test_it_leaves_when_its_parent_is_killed() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", PARENT],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as parent:
        assert parent.stdout is not None
        assert int(parent.stdout.readline()) != parent.pid
        parent.kill()
        parent.communicate(
            timeout=120
        )  # until nobody has the pipes any more: the process has them, too
