"""A picture's time by parts, from a trace that was made by hand."""

from typing import Any

import numpy as np

from tests.app.scene import picture_parts
from tests.app.scene.picture_parts import BEGINS, COPYING, TASK

PAGE, SCENE = "page", "scene"


def event(name: str, began: float, took: float, frame: str | None = None) -> dict[str, Any]:
    about = {} if frame is None else {"data": {"frame": frame}}
    return {
        "name": name,
        "ph": "X",
        "pid": 1,
        "tid": 1,
        "ts": began,
        "dur": took,
        "tdur": took,
        "args": about,
    }


def test_each_event_has_the_time_that_none_within_it_has() -> None:
    trace = [
        event(TASK, 0, 5000),
        event(BEGINS, 100, 4800),
        event("FireAnimationFrame", 200, 1000, SCENE),
        event("FunctionCall", 300, 800, SCENE),
        event("FireAnimationFrame", 1300, 500, PAGE),
        event("UpdateLayoutTree", 1400, 100),
        event("PrePaint", 2000, 200, PAGE),
        event(COPYING, 2500, 400),
        event(TASK, 6000, 300),
        event("FunctionCall", 6100, 100, PAGE),
        event(TASK, 7000, 600),
        event("HandlePostMessage", 7100, 400),
        event("FunctionCall", 7200, 200, SCENE),
        event(TASK, 9000, 100),
        event(BEGINS, 9010, 50),
        {**event(TASK, 9500, 100), "tid": 2},
    ]
    thread = picture_parts.main_thread(trace)
    found = {part: times.tolist() for part, times in picture_parts.by_parts(thread).items()}
    assert found == {
        picture_parts.SCENE: [1.0],
        picture_parts.SCENE_MESSAGE: [0.4],
        picture_parts.PAGE: [0.4],
        picture_parts.PAGE_MESSAGE: [0.1],
        picture_parts.LAYOUT: [0.1],
        picture_parts.PAINT: [0.2],
        picture_parts.CHROMIUM: [3.3],
    }
    whole = picture_parts.per_picture(thread, TASK) - picture_parts.per_picture(thread, COPYING)
    np.testing.assert_allclose(whole, sum(np.array(times) for times in found.values()))
