"""Messages to the viewers of a station, serialised once for all: every new pose, and each new snapshot.

Viewers wake together, with the first pose of each PULSE of the server's clock, so the first nearly always writes for all.
"""

import asyncio
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import orjson

from handscope.app.language import Language
from handscope.app.live.stations import AnyStation
from handscope.app.report.sections import self_calibration

# s, at most one message to a viewer in each; shorter than the 10 ms between two poses
PULSE = 1 / 120
# s: a pose that came in a pulse longer than this is old when its time comes; longest wait for the next one
OLD, NEXT_POSE = 0.02, 0.05
TRANSLATED_KEYS = (
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
    "sentence",
    "sensor_faults",
    "warnings",
)  # keys of English texts in a snapshot


class StationBroadcast:
    """For the viewers of one station in one language; used only in the server's event loop."""

    def __init__(self) -> None:
        self._viewers: list[asyncio.Event] = []
        self._leave: Callable[[], None] | None = None
        self._is_waking = False  # the loop will wake the viewers
        # its key, text, newest point
        self._pulse: tuple[tuple[int, float] | None, str, float] = None, "", 0.0
        self._snapshot: tuple[int | None, str] = (None, "")  # number of the snapshot, as text
        # the same for one whose changes were asked for
        self._plain: tuple[int | None, Any] = None, None
        self._changes: tuple[tuple[int, int] | None, str] = (None, "")  # from and to which

    @contextmanager
    def news(self, station: AnyStation) -> Iterator[asyncio.Event]:
        """Set now, and whenever there is something new."""
        event = asyncio.Event()
        event.set()
        self._viewers.append(event)
        self._leave = self._leave or station.watch(
            partial(self._request_wake, asyncio.get_running_loop())
        )
        try:
            yield event
        finally:
            self._viewers.remove(event)
            if not self._viewers:
                self._leave()
                self._leave = None

    def pulse(self, station: AnyStation, since: float) -> tuple[str, float]:
        """The newest pose with the curve's points later than `since`, and the newest of those."""
        wanted = (station.changes, since)
        if self._pulse[0] != wanted:
            payload = station.pulse(since)
            points = payload["points"]
            self._pulse = (wanted, _to_json_text(payload), points[-1][0] if points else since)
        return self._pulse[1:]

    def snapshot(self, station: AnyStation, language: Language) -> tuple[int, str]:
        """The newest snapshot with its number."""
        number, payload = station.news()
        if self._snapshot[0] != number:
            self._snapshot = (number, _to_json_text(localised_snapshot(payload, language)))
        return number, self._snapshot[1]

    def changes(
        self, station: AnyStation, language: Language, seen: int | None
    ) -> tuple[int, str | None]:
        """The newest snapshot's number and what changed in it since the one of number `seen`, as `changed` has it; None where that is not known any more."""
        before = self._plain
        number, text = self.snapshot(station, language)
        if before[0] != number:
            self._plain = number, orjson.loads(text)
            step = None if before[0] is None else (before[0], number)
            self._changes = step, _to_json_text(changed(before[1], self._plain[1])) if step else ""
        return number, self._changes[1] if self._changes[0] == (seen, number) else None

    def _request_wake(self, loop: asyncio.AbstractEventLoop) -> None:
        """From any thread: wake the loop once, however many watch."""
        if not self._is_waking:
            self._is_waking = True
            loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        self._is_waking = False
        for viewer in self._viewers:
            viewer.set()


class Broadcasts:
    """One a station and language."""

    def __init__(self) -> None:
        self._all: WeakKeyDictionary[AnyStation, dict[str, StationBroadcast]] = WeakKeyDictionary()

    def of(self, station: AnyStation, language: Language) -> StationBroadcast:
        return self._all.setdefault(station, {}).setdefault(language.code, StationBroadcast())


def changed(before: Any, now: Any, path: tuple[str, ...] = ()) -> list[tuple[tuple[str, ...], Any]]:
    """What differs in plain data: the path of keys to each part that is another, and what stands there now. Lists are one part."""
    if before == now:
        return []
    if not isinstance(before, dict) or not isinstance(now, dict) or before.keys() != now.keys():
        return [(path, now)]
    return [part for key in now for part in changed(before[key], now[key], (*path, key))]


def localised_snapshot(snapshot: dict[str, Any], language: Language) -> dict[str, Any]:
    """A snapshot in a language."""
    localised: dict[str, Any] = language.translate_keys(snapshot, TRANSLATED_KEYS)
    if (free := localised.get("self_calibration")) and (solution := free["found"]):
        return {
            **localised,
            "self_calibration": {
                **free,
                "found": self_calibration.describe(solution["table"], solution["told"], language),
            },
        }
    return localised


async def next_pulse(news: asyncio.Event, pulse: float = PULSE) -> None:
    """Sleep to the next multiple of `pulse` s on the server's clock, and on to the first news after it.

    News that came while a viewer slept are old by then; where no other comes within NEXT_POSE they are sent all the same.
    """
    await asyncio.sleep(pulse - time.monotonic() % pulse)
    if pulse > OLD and news.is_set():
        news.clear()
        with suppress(TimeoutError):
            await asyncio.wait_for(news.wait(), NEXT_POSE)
        news.set()


def _to_json_text(payload: Any) -> str:
    return orjson.dumps(payload, option=orjson.OPT_SERIALIZE_NUMPY).decode()
