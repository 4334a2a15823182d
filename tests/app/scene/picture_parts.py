"""What the page's main thread does in a picture, by parts, from a trace of Chromium.

In      events of a trace with the categories TRACED
Out     processor time of each picture, ms, in all and by PARTS
Limits  where one event lies within another, the outer one has the rest of the time. A function is of the frame whose page it belongs to: the scene's, or
        the station's
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from handscope.estimators.numerics.typing import Array

TIMED = ["toplevel", "cc", "disabled-by-default-devtools.timeline"]  # what a picture's time needs
TRACED = [*TIMED, "devtools.timeline"]
BEGINS = "ProxyMain::BeginMainFrame"  # a picture: a mark of our own would cost 0.1 ms each
TASK = "RunTask"
COPYING = "LayerTreeHost::DoUpdateLayers"
SCENE, SCENE_MESSAGE = "three.js draws", "a message of the scene"
PAGE, PAGE_MESSAGE = "the page draws, the curve above all", "a message of the page"
LAYOUT, PAINT = "style and layout of changed texts", "paint"
CHROMIUM = "Chromium's own steps"
PARTS = (SCENE, SCENE_MESSAGE, PAGE, PAGE_MESSAGE, LAYOUT, PAINT, CHROMIUM)
_BY_NAME = {
    "HandlePostMessage": SCENE_MESSAGE,  # the scene's worker has read one
    "UpdateLayoutTree": LAYOUT,
    "Layout": LAYOUT,
    "PrePaint": PAINT,
    "Paint": PAINT,
    "Layerize": PAINT,
    COPYING: "",  # of no part: no tablet does it
}
_OF_FRAME = {"FireAnimationFrame": (SCENE, PAGE), "FunctionCall": (SCENE_MESSAGE, PAGE_MESSAGE)}

Event = dict[str, Any]


def main_thread(events: Sequence[Event]) -> list[Event]:
    """The complete events of the thread that begins pictures, in their order, outer ones first."""
    marks = [event for event in events if event.get("name") == BEGINS and event["ph"] == "X"]
    (thread, _), *_ = Counter((event["pid"], event["tid"]) for event in marks).most_common()
    # Chromium's flow events have the same names
    found = [e for e in events if e["ph"] == "X" and (e["pid"], e["tid"]) == thread]
    return sorted(found, key=lambda event: (event["ts"], -event.get("dur", 0)))


def per_picture(thread: Sequence[Event], name: str) -> Array:
    """Processor time (n,) of the main thread's events of this name between the beginnings of two pictures, ms."""
    return _summed(thread, [(e["ts"], e.get("tdur", 0)) for e in thread if e["name"] == name])


def by_parts(thread: Sequence[Event]) -> dict[str, Array]:
    """Processor time (n,) of each of PARTS in each picture, ms."""
    own = defaultdict(list)
    for part, began, took in _own_times(thread):
        own[part].append((began, took))
    return {part: _summed(thread, own[part]) for part in PARTS}


def _own_times(thread: Sequence[Event]) -> Iterator[tuple[str, float, float]]:
    """Of each event its part, when it began, and its processor time without that of events within it, us."""
    page = next(e["args"]["data"]["frame"] for e in thread if e["name"] == "PrePaint")
    around: list[tuple[float, str]] = []  # end and part of each event that the next one lies in
    for event in thread:
        while around and around[-1][0] <= event["ts"]:
            around.pop()
        took = event.get("tdur", 0)
        if around:
            yield around[-1][1], event["ts"], -took
        elif event["name"] != TASK:
            continue
        part = _part(event, around[-1][1] if around else CHROMIUM, page)
        yield part, event["ts"], took
        around.append((event["ts"] + event.get("dur", 0), part))


def _part(event: Event, outer: str, page: str) -> str:
    """An event's part; what has none of its own is of the `outer` event's."""
    if outer == CHROMIUM and event["name"] in _OF_FRAME:
        scene, own = _OF_FRAME[event["name"]]
        return own if event["args"]["data"]["frame"] == page else scene
    return _BY_NAME.get(event["name"], outer)


def _summed(thread: Sequence[Event], times: Sequence[tuple[float, float]]) -> Array:
    """Sum (n,) of times (began, took; us) from the task that begins a picture to that which begins the next, ms."""
    tasks = np.array([e["ts"] for e in thread if e["name"] == TASK])
    marks = [e["ts"] for e in thread if e["name"] == BEGINS]
    borders = tasks[np.searchsorted(tasks, marks, "right") - 1]
    if not times:
        return np.zeros(len(borders) - 1)
    began, took = np.array(sorted(times)).T
    spent = np.concatenate([[0.0], np.cumsum(took)])[np.searchsorted(began, borders)]
    return np.diff(spent) / 1e3
