"""Moves the cameras of all viewers of a scene to a side of the hand, smoothly; a viewer who comes later begins there."""

import asyncio
from collections.abc import Callable
from concurrent.futures import Future

import numpy as np
from viser import CameraHandle, ClientHandle, ViserServer

from handscope.app.scene import postures, view
from handscope.app.scene.camera import sides
from handscope.app.scene.camera.sides import Camera
from handscope.estimators.numerics.typing import Array

EASING, PICTURE = 0.8, 1 / 30  # s
AT_FIRST = 1e-3  # scene units from the first view: nobody drags a camera there


class CameraOperator:
    """For viser's event loop; `look` may be called from any thread."""

    def __init__(self, server: ViserServer, narrow: float, clock: Callable[[], float]) -> None:
        """`narrow`: what the first view keeps in sight (view.NARROW)."""
        self._server, self._narrow, self._clock = server, narrow, clock
        self._wanted: tuple[Array | None, Array] | None = None  # direction and points
        self._move: Future[None] | None = None  # the newest
        server.on_client_connect(self._begin)

    def look(self, towards: Array | None, points: Array) -> None:
        """Ease every viewer's camera to the direction `towards` (3,), None: its own, framing points (n, 3)."""
        self._wanted = towards, points
        self.stop()
        self._move = asyncio.run_coroutine_threadsafe(self._ease(), self._server.get_event_loop())

    def stop(self) -> None:
        """Leave the cameras where they are; before the server stops, whose event loop a move would outlive."""
        if self._move is not None:
            self._move.cancel()

    async def _ease(self) -> None:
        starts = {
            number: Camera(np.array(c.camera.position), np.array(c.camera.look_at))
            for number, c in self._server.get_clients().items()
        }
        began, share = self._clock(), 0.0
        while share < 1.0:
            share = min(1.0, (self._clock() - began) / EASING)
            for number, client in self._server.get_clients().items():
                if number in starts:
                    self._place(client, starts[number], postures.eased(share))
            await asyncio.sleep(PICTURE)

    async def _begin(self, client: ClientHandle) -> None:
        """Place a new viewer's camera, and keep what is needed in view of a narrow window.

        A browser that is busy goes to the first view of all after it was placed, and says so: it is placed again.
        """
        self._fit(client.camera)
        self._place(client, None, 1.0)

        async def refit(camera: CameraHandle) -> None:
            self._fit(camera)
            if np.allclose(camera.position, view.CAMERA, atol=AT_FIRST):
                self._place(client, None, 1.0)

        client.camera.on_update(refit)

    def _place(self, client: ClientHandle, start: Camera | None, share: float) -> None:
        if self._wanted is None:
            return
        camera = client.camera
        towards, points = self._wanted
        if towards is None:
            seen = camera if start is None else start
            towards = np.array(seen.position) - np.array(seen.look_at)
            towards = towards / np.linalg.norm(towards)
        stop = sides.frame(towards, points, camera.fov, max(camera.aspect, 0.1))
        shown = stop if start is None else sides.between(start, stop, share)
        with client.atomic():
            camera.position, camera.look_at = shown.position, shown.look_at

    def _fit(self, camera: CameraHandle) -> None:
        """Widen the view of a narrow window, so that no finger is cut off."""
        wanted = view.field_of_view(camera.aspect, self._narrow)
        if abs(camera.fov - wanted) > 0.002:
            camera.fov = wanted
