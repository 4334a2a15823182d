"""Each task is seen from the side that shows it, the hand fills two thirds of the picture, and cameras move there without a jump."""

import asyncio
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, cast

import numpy as np
import pytest
from viser import ViserServer

from handscope.app.live import ghost
from handscope.app.protocols import load_all
from handscope.app.scene import postures, view
from handscope.app.scene.camera import operator, sides
from handscope.app.scene.camera.operator import CameraOperator
from handscope.app.scene.camera.sides import SIDES, Camera, Side, frame, outline, side_of
from handscope.estimators.hand.anatomy import HANDS, Hand, side_sign
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

FOV = view.FIELD_OF_VIEW


def filled(camera: Camera, points: Array, aspect: float) -> float:
    """The greater share of a picture's width and height that points take, measured from where their middle is to stand."""
    towards = camera.position - camera.look_at
    towards /= np.linalg.norm(towards)
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    seen = points - camera.position
    depth = -seen @ towards
    across = seen @ right / depth / np.tan(0.5 * FOV) / aspect
    raised = 2 * sides.RAISED * np.linalg.norm(camera.position - camera.look_at)
    up = seen @ np.cross(towards, right) / depth / np.tan(0.5 * FOV) - raised / depth
    return float(max(np.abs(across).max(), np.abs(up).max()))


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("aspect", [0.6, 1.5])
def test_the_hand_fills_two_thirds_of_the_picture_and_no_more(
    hand: Hand, side: Side, aspect: float
) -> None:
    q_DH, geometry = view.palm_down(hand), sized(hand)
    points = outline([np.zeros_like(postures.relaxed())], geometry, q_DH)
    camera = frame(sides.direction(side, hand, q_DH), points, FOV, aspect)
    assert 0.5 < filled(camera, points, aspect) <= sides.FILLED + 1e-9


@pytest.mark.parametrize("hand", HANDS)
def test_a_side_stays_the_same_side_of_a_hand_that_is_turned(hand: Hand) -> None:
    radial = side_sign(hand) * np.array([0.0, 0.0, -1.0])
    for q_turn in (quat.IDENTITY, quat.about(1, 0.9), quat.about(0, 0.4)):
        q_DH = quat.multiply(q_turn, view.palm_down(hand))
        assert sides.direction("thumb", hand, q_DH) @ quat.rotate(q_DH, radial) > 0.8
        assert abs(sides.direction("palm", hand, q_DH)[2]) <= np.sin(sides.STEEPEST) + 1e-9


def test_every_task_is_seen_from_the_side_that_shows_its_movement() -> None:
    seen_from = {name: side_of(p.curve) for name, p in load_all().items()}
    radial = {"rom_fist", "rom_pip", "rom_wrist_flexion", "tapping", "pinches", "open_close"}
    assert {seen_from[name] for name in radial} == {"thumb"}
    assert seen_from["rom_spread"] == seen_from["rom_wrist_deviation"] == "back"
    assert seen_from["kapandji"] == seen_from["rom_thumb_palmar"] == "palm"


def test_every_task_is_demonstrated_and_its_band_ends_where_the_demonstration_does() -> None:
    every = load_all()
    assert [p.name for p in every.values() if not p.ghost] == []
    band = ghost.target(every["rom_fist"], "index_pip_flexion")
    assert band == pytest.approx((np.radians(90), np.radians(100)))
    assert ghost.target(every["tapping"], "aperture") is None
    assert ghost.target(every["rom_spread"], "index_mcp_flexion") is None


@dataclass
class Seen:
    """A viewer's camera, and every place that it was put."""

    position: Array = field(default_factory=lambda: view.CAMERA.copy())
    look_at: Array = field(default_factory=lambda: view.LOOK_AT.copy())
    fov: float = float(FOV)
    aspect: float = 1.4
    told: list[Any] = field(default_factory=list)

    def on_update(self, told: Any) -> None:
        self.told.append(told)


@dataclass
class Viewer:
    camera: Seen = field(default_factory=Seen)

    def atomic(self) -> AbstractContextManager[None]:
        return nullcontext()


class Viewers:
    """As much of viser's server as the operator needs."""

    def __init__(self) -> None:
        self.viewer, self.loop = Viewer(), asyncio.get_running_loop()

    def get_clients(self) -> dict[int, Viewer]:
        return {0: self.viewer}

    def get_event_loop(self) -> asyncio.AbstractEventLoop:
        return self.loop

    def on_client_connect(self, begin: Any) -> None:
        self.begin = begin


def test_a_camera_moves_to_another_side_smoothly_and_a_newer_wish_ends_the_older(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(operator, "PICTURE", 0.0)
    points = outline([postures.relaxed()], sized("left"), view.palm_down("left"))
    wished = [sides.direction(s, "left", view.palm_down("left")) for s in ("back", "thumb")]

    async def places() -> tuple[list[Array], Seen]:
        server, now, seen = Viewers(), [0.0], list[Array]()
        operator = CameraOperator(cast(ViserServer, server), view.NARROW, lambda: now[0])
        for towards in wished:  # the second at once after the first
            operator.look(towards, points)
        for _ in range(80):
            await asyncio.sleep(0)
            now[0] += 1 / 60
            seen.append(server.viewer.camera.position)
        return seen, server.viewer.camera

    seen, last = asyncio.run(places())
    wanted = frame(wished[1], points, FOV, 1.4)
    np.testing.assert_allclose(last.position, wanted.position)
    np.testing.assert_allclose(last.look_at, wanted.look_at)
    steps = [np.linalg.norm(b - a) for a, b in pairwise(seen)]
    assert max(steps) < 0.12 * np.linalg.norm(wanted.position - view.CAMERA)


def test_a_browser_that_goes_to_its_first_view_after_it_was_placed_is_placed_again() -> None:
    """viser's page takes the first view in its next picture: on a busy machine after the place that it was sent when it came."""
    points = outline([postures.relaxed()], sized("left"), view.palm_down("left"))
    thumb = sides.direction("thumb", "left", view.palm_down("left"))

    async def places() -> tuple[Array, Array, Array]:
        server = Viewers()
        CameraOperator(cast(ViserServer, server), view.NARROW, lambda: 0.0).look(thumb, points)
        camera = server.viewer.camera
        await server.begin(server.viewer)
        placed, dragged = camera.position, camera.position + 0.3
        camera.position, camera.look_at = view.CAMERA.copy(), view.LOOK_AT.copy()
        await camera.told[0](camera)
        again = camera.position
        camera.position = dragged
        await camera.told[0](camera)
        return placed, again, camera.position - dragged

    placed, again, moved = asyncio.run(places())
    np.testing.assert_allclose(placed, frame(thumb, points, FOV, 1.4).position)
    np.testing.assert_array_equal(again, placed)
    np.testing.assert_array_equal(moved, 0.0)  # a view that was chosen by hand stays
