"""The process for long work: values and errors come back, and it never outlives its parent."""

import os
import subprocess
import sys

import pytest

from handscope.app.workers.process import DiedError, WorkerProcess
from tests.app.devices.virtual import wait_for

PARENT = """
import os, sys
from handscope.app.workers.process import WorkerProcess
if __name__ == "__main__":
    with WorkerProcess(os.getpid) as process:
        print(process.do(os.getpid), flush=True)
        sys.stdin.read()
"""


def bug(word: str) -> None:
    raise ValueError(word)


def imported() -> set[str]:
    return set(sys.modules)


def unsendable() -> object:
    return lambda: None


def test_values_and_errors_come_back_with_where_they_arose() -> None:
    with WorkerProcess(os.getpid) as process:
        assert process.do(divmod, 7, 2) == (3, 1)
        with pytest.raises(ValueError, match="seven") as error:
            process.do(bug, "seven")
        assert "in bug" in "".join(error.value.__notes__)
        assert process.do(divmod, 7, 3) == (2, 1)


def test_a_process_killed_while_it_waits_is_replaced() -> None:
    with WorkerProcess(os.getpid) as process:
        first = process.do(os.getpid)
        process.kill()
        wait_for(lambda: not process.alive)
        assert process.do(os.getpid) != first


def test_a_value_that_cannot_travel_ends_the_process_not_the_queue() -> None:
    with WorkerProcess(os.getpid) as process:
        with pytest.raises(DiedError):
            process.do(unsendable)
        assert process.do(divmod, 7, 2) == (3, 1)


def test_a_process_sees_the_environment_of_its_own_beginning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for word in ("first", "second"):
        monkeypatch.setenv("HANDSCOPE_WORD", word)
        with WorkerProcess(os.getpid) as process:
            assert process.do(os.getenv, "HANDSCOPE_WORD") == word


@pytest.mark.skipif(sys.platform != "linux", reason="forked on Linux alone")
def test_a_process_begins_with_what_its_work_needs() -> None:
    with WorkerProcess(os.getpid) as process:
        assert {"handscope.app.results.make", "handscope.app.results.report"} <= process.do(
            imported
        )


def test_killing_one_that_has_not_begun_is_nothing() -> None:
    with WorkerProcess(os.getpid) as process:
        process.kill()
        assert process.do(divmod, 7, 2) == (3, 1)


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
