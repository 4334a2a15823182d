"""Who runs which test: the longest files first, a file's tests in one process, the journeys in two of the processes.

A journey waits for a hand that moves in real time, for a page, for a server: other processes compute meanwhile. Two servers
and two browsers leave a core to the others. Parts of pages that are tested in a browser have one for all, and self-calibration's
tests their solved fingers.
"""

from collections.abc import Collection, Iterable
from typing import Any

import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling

from tests.durations import FILES

JOURNEYS = "tests/journeys/"
LANES = 2
IN_BROWSER = "_in_browser.py"
SOLVED = "tests/solved"  # behind the journeys, which take longer
UNKNOWN = 40.0  # s that a file takes which the table does not know yet: it must not be the last


def swept(cases: Iterable[Any], kept: Collection[Any]) -> list[Any]:
    """Cases of a sweep for `parametrize`: `make test` takes those that are `kept`, `make test-all` the others, too (CONTRIBUTING.md)."""
    found = list(cases)
    assert kept and all(case in found for case in kept), f"{kept} are not among the cases"
    return [case if case in kept else pytest.param(case, marks=pytest.mark.slow) for case in found]


def seconds() -> dict[str, float]:
    """How long each file takes, from the table that `make durations` writes."""
    lines = [line.split() for line in FILES.read_text().splitlines()]
    return {file: float(total) for total, file in lines}


def lanes(known: dict[str, float]) -> dict[str, str]:
    """The lane of each file of journeys, the longest first, each into the lane that is shorter so far; one for all that share a browser, one for all
    that share what takes seconds to solve."""
    root = FILES.parent.parent
    sharing = (FILES.parent / "app").rglob(f"test_*{IN_BROWSER}")
    files = [f.relative_to(root).as_posix() for f in FILES.with_name("journeys").rglob("test_*.py")]
    taken = dict.fromkeys((f"{JOURNEYS}{k}" for k in range(LANES)), 0.0)
    found = {f.relative_to(root).as_posix(): IN_BROWSER for f in sharing}
    solving = (FILES.parent / "estimators" / "self_calibration").rglob("test_*.py")
    found |= {f.relative_to(root).as_posix(): SOLVED for f in solving}
    for file in sorted(files, key=lambda f: (-known.get(f, UNKNOWN), f)):
        found[file] = min(taken, key=lambda lane: taken[lane])
        taken[found[file]] += known.get(file, UNKNOWN)
    return found


def order(items: list[pytest.Item]) -> None:
    """A lane after the other, then the longest files, so that no process works alone on the last of them."""
    known = seconds()
    lane = lanes(known)

    def rank(item: pytest.Item) -> tuple[bool, str, float]:
        file = item.nodeid.partition("::")[0]
        return file not in lane, lane.get(file, ""), -known.get(file, UNKNOWN)

    items.sort(key=rank)  # stable


def shares_browser(item: pytest.Item, following: pytest.Item | None) -> bool:
    """Whether the browser of a test stays open for the next one."""
    return following is not None and (
        following.path == item.path
        or all(i.path.name.endswith(IN_BROWSER) for i in (item, following))
    )


class Schedule(LoadFileScheduling):
    """xdist's, where a lane counts as one file."""

    def __init__(self, config: pytest.Config, log: Producer | None = None) -> None:
        super().__init__(config, log)
        self._lanes = lanes(seconds())

    def _split_scope(self, nodeid: str) -> str:
        file = super()._split_scope(nodeid)
        return self._lanes.get(file, file)
