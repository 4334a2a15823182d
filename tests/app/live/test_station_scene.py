"""How often a station draws its hand."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

from handscope.app.live import station_scene
from handscope.app.live.station_scene import PICTURE_INTERVAL, UNSEEN_INTERVAL, StationScene
from handscope.app.live.viewers import Viewers


class Drawn:
    """In the place of a scene's process: counts the hands that it is given."""

    def __init__(self, viewers: int) -> None:
        self.viewers, self.hands = viewers, 0

    @contextmanager
    def picture(self) -> Iterator[None]:
        yield

    def show(self, *_: object, **__: object) -> None:
        self.hands += 1

    def trail(self, _: object) -> None:
        pass


@pytest.mark.parametrize(
    ("viewers", "interval"), [(0, UNSEEN_INTERVAL), (1, PICTURE_INTERVAL)], ids=["unseen", "seen"]
)
def test_a_hand_that_nobody_sees_is_drawn_seldom(
    viewers: int, interval: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    process, now = Drawn(viewers), [100.0]
    monkeypatch.setattr(station_scene, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(station_scene.pose_fit, "inclined_pose", lambda *_: (None, None))
    drawing = StationScene(process, None, Viewers(), dict)  # type: ignore[arg-type]
    for _ in range(10):
        drawing.draw_hand_if_due(PICTURE_INTERVAL)
        drawing.draw_hand_if_due(PICTURE_INTERVAL)
        now[0] += interval + 1e-9
    assert process.hands == 10


def test_poses_that_come_about_as_often_as_pictures_are_nearly_all_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One that is a little early is not left until the next."""
    process, now = Drawn(1), [100.0]
    monkeypatch.setattr(station_scene, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(station_scene.pose_fit, "inclined_pose", lambda *_: (None, None))
    drawing = StationScene(process, None, Viewers(), dict)  # type: ignore[arg-type]
    poses = (np.arange(0, 2, 0.01), np.arange(0, 2, 0.018) + 0.004 * (np.arange(112) % 2))
    for times, least in zip(poses, (118, 108)):
        process.hands, start = 0, now[0] + 1
        for t in times:
            now[0] = start + t
            drawing.draw_hand_if_due(PICTURE_INTERVAL)
        assert least <= process.hands <= 121
