"""What a station's viewers are told is written once for all of them, and nobody misses a point of the curve."""

import asyncio
import json
import time
from collections.abc import Callable
from typing import Any

import pytest

from handscope.app import language
from handscope.app.api.broadcast import NEXT_POSE, StationBroadcast, changed, next_pulse
from handscope.app.live.viewers import Viewers

ENGLISH = language.language("en")


class Told:
    """A station that counts how often it is asked."""

    def __init__(self) -> None:
        self.viewers, self.points, self.asked, self.number = Viewers(), [(0.0, 1.0)], 0, 1
        self.more: dict[str, Any] = {}

    @property
    def changes(self) -> int:
        return self.viewers.changes

    def watch(self, notice: Callable[[], object]) -> Callable[[], None]:
        return self.viewers.add(notice)

    def pulse(self, since: float) -> dict[str, Any]:
        self.asked += 1
        return {"points": [p for p in self.points if p[0] > since]}

    def news(self) -> tuple[int, dict[str, Any]]:
        self.asked += 1
        return self.number, {"title": "Finished", **self.more}

    def moved(self, t: float) -> None:
        self.points.append((t, 1.0))
        self.viewers.notify()


def points(written: str) -> list[float]:
    return [p[0] for p in json.loads(written)["points"]]


def test_viewers_in_step_are_written_for_once_and_one_behind_gets_what_it_missed() -> None:
    station, broadcast = Told(), StationBroadcast()
    first, second = broadcast.pulse(station, -1.0), broadcast.pulse(station, -1.0)
    assert first == second and station.asked == 1
    station.moved(0.1)
    station.moved(0.2)
    written, newest = broadcast.pulse(station, 0.0)
    assert (points(written), newest) == ([0.1, 0.2], 0.2)
    assert points(broadcast.pulse(station, -1.0)[0]) == [0.0, 0.1, 0.2]
    assert broadcast.pulse(station, 0.2) == ('{"points":[]}', 0.2), (
        "a viewer keeps its place where nothing is new"
    )


def test_a_snapshot_is_written_again_when_there_is_another() -> None:
    station, broadcast = Told(), StationBroadcast()
    assert broadcast.snapshot(station, ENGLISH) == (1, '{"title":"Finished"}')
    station.number = 2
    assert broadcast.snapshot(station, ENGLISH)[0] == 2


def test_who_saw_the_snapshot_before_is_sent_what_changed_and_others_are_not() -> None:
    station, broadcast = Told(), StationBroadcast()
    assert broadcast.changes(station, ENGLISH, None) == (1, None)
    station.number, station.more = 2, {"wizard": {"state": "tasks", "left": 2}}
    assert broadcast.changes(station, ENGLISH, None) == (2, None)
    station.number, station.more = 3, {"wizard": {"state": "tasks", "left": 1}}
    number, written = broadcast.changes(station, ENGLISH, 2)
    assert (number, json.loads(written or "")) == (3, [[["wizard", "left"], 1]])
    assert broadcast.changes(station, ENGLISH, 1) == (3, None)
    assert broadcast.changes(station, ENGLISH, 3) == (3, None)


@pytest.mark.parametrize(
    ("before", "now", "parts"),
    [
        ({"a": {"b": 1, "c": [1]}}, {"a": {"b": 1, "c": [1]}}, []),
        (
            {"a": {"b": 1, "c": [1]}},
            {"a": {"b": None, "c": [2]}},
            [(("a", "b"), None), (("a", "c"), [2])],
        ),
        ({"a": {"b": 1}}, {"a": {"b": 1, "c": 2}}, [(("a",), {"b": 1, "c": 2})]),
        ({"a": None}, {"a": {"b": 1}}, [(("a",), {"b": 1})]),
        ({"a": 1}, {"b": 1}, [((), {"b": 1})]),
    ],
)
def test_changes_name_the_smallest_parts_and_a_part_with_other_keys_as_a_whole(
    before: Any, now: Any, parts: Any
) -> None:
    assert changed(before, now) == parts


def test_every_viewer_is_woken_and_a_station_nobody_watches_is_left_alone() -> None:
    async def watched() -> None:
        station, broadcast = Told(), StationBroadcast()
        with broadcast.news(station) as one:
            with broadcast.news(station) as other:
                one.clear(), other.clear()
                station.moved(0.1)
                await asyncio.wait_for(asyncio.gather(one.wait(), other.wait()), 5.0)
            assert station.viewers
        assert not station.viewers

    asyncio.run(watched())


def test_a_viewer_that_slept_for_long_is_sent_the_next_pose_not_the_one_that_waited() -> None:
    async def poses_seen() -> int:
        news, seen = asyncio.Event(), 0

        def pose() -> None:
            nonlocal seen
            seen += 1
            news.set()

        await asyncio.sleep(0.05 - time.monotonic() % 0.05)
        pose()
        asyncio.get_running_loop().call_later(0.05 + NEXT_POSE / 2, pose)
        await next_pulse(news, 0.05)
        return seen

    assert asyncio.run(poses_seen()) == 2


def test_news_after_which_no_other_comes_are_sent_all_the_same() -> None:
    async def is_sent() -> bool:
        news = asyncio.Event()
        news.set()
        await asyncio.wait_for(next_pulse(news, 0.05), 0.05 + 50 * NEXT_POSE)
        return news.is_set()

    assert asyncio.run(is_sent())
