"""What the viewers of a station are told, written once for all of them: the newest pose as it comes, the whole snapshot when there is a new one.

A station's viewers wake together, with the first pose of each PULSE by the server's clock; so nearly always the first of them writes for all.
"""

import asyncio
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import orjson

from handscope.app.language import Language
from handscope.app.live.stations import AnyStation
from handscope.app.report.sections import self_calibration

PULSE = (
    1 / 120
)  # s: at most one message to a viewer in each; shorter than the 10 ms between two poses, so that hardly a pose waits
SPOKEN = (
    "title",
    "instruction",
    "message",
    "problem",
    "say",
    "word",
    "words",
    "next",
    "reason",
    "hint",
)  # keys of texts that stations tell in English


class Bulletin:
    """For the viewers of one station in one language; used in the server's event loop alone."""

    def __init__(self) -> None:
        self._viewers: list[asyncio.Event] = []
        self._leave: Callable[[], None] | None = None
        self._rung = False  # the loop was told that there is something new and has not got that far
        self._beat: tuple[tuple[int, float] | None, str, float] = (
            None,
            "",
            0.0,
        )  # what it was written for, as text, its newest point
        self._whole: tuple[int | None, str] = (None, "")  # number of the snapshot, as text

    @contextmanager
    def news(self, station: AnyStation) -> Iterator[asyncio.Event]:
        """Set now, and whenever there is something new."""
        mine = asyncio.Event()
        mine.set()
        self._viewers.append(mine)
        self._leave = self._leave or station.watch(partial(self._ring, asyncio.get_running_loop()))
        try:
            yield mine
        finally:
            self._viewers.remove(mine)
            if not self._viewers:
                self._leave()
                self._leave = None

    def beat(self, station: AnyStation, since: float) -> tuple[str, float]:
        """The newest pose with the curve's points later than `since`, and the newest of those."""
        wanted = (station.changes, since)
        if self._beat[0] != wanted:
            told = station.pulse(since)
            points = told["points"]
            self._beat = (wanted, _written(told), points[-1][0] if points else since)
        return self._beat[1:]

    def snapshot(self, station: AnyStation, language: Language) -> tuple[int, str]:
        """The newest snapshot with its number."""
        number, told = station.news()
        if self._whole[0] != number:
            self._whole = (number, _written(spoken(told, language)))
        return number, self._whole[1]

    def _ring(self, loop: asyncio.AbstractEventLoop) -> None:
        """From any thread: wake the loop once, however many watch."""
        if not self._rung:
            self._rung = True
            loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        self._rung = False
        for viewer in self._viewers:
            viewer.set()


class Bulletins:
    """One a station and language."""

    def __init__(self) -> None:
        self._all: WeakKeyDictionary[AnyStation, dict[str, Bulletin]] = WeakKeyDictionary()

    def of(self, station: AnyStation, language: Language) -> Bulletin:
        return self._all.setdefault(station, {}).setdefault(language.code, Bulletin())


def spoken(snapshot: dict[str, Any], language: Language) -> dict[str, Any]:
    """A snapshot in a language."""
    found: dict[str, Any] = language.told(snapshot, SPOKEN)
    if (free := found.get("self_calibration")) and (kept := free["found"]):
        return {
            **found,
            "self_calibration": {
                **free,
                "found": self_calibration.told(kept["table"], kept["told"], language),
            },
        }
    return found


def until_next() -> float:
    """Seconds to the next PULSE of the server's clock."""
    return PULSE - time.monotonic() % PULSE


def _written(told: dict[str, Any]) -> str:
    return orjson.dumps(told, option=orjson.OPT_SERIALIZE_NUMPY).decode()
