"""A hand in the browser: the patient's hand as it moves, a ghost hand that shows the pose to take, one segment lit, one sentence.

One HandScene owns one viser server and belongs to one station. Every method may be called at any rate and from any thread; what was drawn last
is shown to viewers (at about 57 Hz, or at once after a `picture`), and to viewers who come later.
"""

import asyncio
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType

import numpy as np
from viser import ClientHandle

from handscope.app.scene import palette, postures, stage, view
from handscope.app.scene.angle_arc import AngleArc, Measured
from handscope.app.scene.camera import sides
from handscope.app.scene.camera.operator import CameraOperator
from handscope.app.scene.camera.sides import Side
from handscope.app.scene.drawn_hand import DrawnHand
from handscope.app.scene.force_arrows import ForceArrows, in_hand
from handscope.app.scene.ground import Ground
from handscope.app.scene.loopback_server import make_server, quiet, renumber
from handscope.app.scene.mesh import bones
from handscope.app.scene.mesh.hand_mesh import hand_mesh
from handscope.app.scene.mesh.highlight_mesh import highlight_parts
from handscope.app.scene.mesh.skinned_mesh import SkinnedMesh
from handscope.app.scene.palette import Paint
from handscope.app.scene.postures import Passage
from handscope.app.scene.reach_map import ReachMap
from handscope.app.scene.second_hand import BESIDE, SecondHand
from handscope.estimators.hand.anatomy import FINGERS, JOINT, SEGMENT, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

_LIT = "lit_"
_BENT_WRIST = np.radians(2.0)


class HandScene:
    """A context manager: `port` and `secret` are what bridge.bridge needs."""

    def __init__(
        self,
        hand: Hand,
        geometry: HandGeometry,
        beside: HandGeometry | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """`beside`: of a second hand, drawn to the right of this one; `clock`: s, for what moves by itself."""
        assert geometry.hand == hand
        self._hand, self._geometry, self._mesh = hand, geometry, hand_mesh(geometry)
        self._lock = threading.Lock()
        self._q_DG: Array | None = None  # set by the first orientation shown
        self._clock = clock
        self._q_DH = self._q_wanted = view.palm_down(hand)
        self._followed: bool | None = None  # set by the first hand shown
        self._passage = Passage(-np.inf, postures.relaxed(), self._q_DH)
        self._measured = frozenset(FINGERS)
        self._ghost_is_whole = False
        self._map: ReachMap | None = None  # drawn with the first place
        self._arrows: ForceArrows | None = None  # drawn with the first forces
        self._forces: Array | None = None
        self._arc: AngleArc | None = None  # drawn with the first quantity
        self._quantity: Measured | None = None
        self._mirrored = False
        self._shown = postures.relaxed(), quat.IDENTITY  # angles and orientation
        self._server, self.secret = make_server()
        self.port: int = self._server.get_port()
        self._cameras = CameraOperator(
            self._server, view.NARROW if beside is None else view.NARROW_PAIR, clock
        )
        with self._server.atomic():
            stage.set_up(self._server)
            self._ground = Ground(self._server)
            scale = view.units_per_metre(geometry)
            self._own = DrawnHand(self._server, "/hand", self._mesh.rest, scale)
            self._ghost = DrawnHand(self._server, "/ghost", self._mesh.rest, scale)
            self._own.paint_hand(self._mesh, self._measured)
            self._trail = self._server.scene.add_line_segments(
                "/trail",
                np.zeros((view.TRAIL, 2, 3), np.float32),
                palette.trail(view.TRAIL),
                thickness=5.0,
                thickness_units="screen",
                visible=False,
            )
            self._beside = None if beside is None else SecondHand(self._server, beside)
            if beside is not None:
                self._own.place((-BESIDE, 0.0, 0.0))
            self._place = np.array([0.0 if beside is None else -BESIDE, 0.0, 0.0])
            self._draw(self._own, postures.relaxed())
            self._own.turn(self._q_DH)
        self._server.on_client_disconnect(self._renumber)

    def __enter__(self) -> "HandScene":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Stop the server; viewers are disconnected."""
        self._cameras.stop()
        with quiet():
            self._server.stop()

    def show(self, angles: Array, q_GH: Array | None, followed: bool = True) -> None:
        """Draw the hand with joint angles (joints, 3) rad, turned as the hand's segment q_GH (4,) is in the global frame.

        Angles that are not known (NaN) are the resting hand's; an orientation that is not known keeps the one before (at first: palm down).
        A hand that is not `followed` is drawn grey; from one kind to the other the hand passes smoothly.
        """
        if q_GH is not None and np.isnan(q_GH).any():
            q_GH = None
        with self._lock:
            if followed != self._followed:
                self._change_kind(followed)
            if q_GH is not None and self._q_DG is None:
                self._q_DG = view.heading_removed(q_GH, self._hand)
            wanted = (
                self._q_wanted
                if q_GH is None or self._q_DG is None
                else quat.multiply(self._q_DG, q_GH)
            )
            filled, q_DH = self._passage.at(self._clock(), postures.filled(angles), wanted)
        # outside the lock: nothing is sent to anybody while it is held
        pose = bones.pose(filled, self._geometry)
        with self._lock, self._server.atomic():
            self._own.bend(*pose)
            self._shown = filled, self._shown[1] if q_GH is None else q_GH
            self._q_wanted, self._q_DH = wanted, q_DH
            if self._forces is not None:
                self._push()
            if self._quantity is not None:
                self._draw_quantity()
            self._own.turn(q_DH)
            self._ground.follow(filled, q_DH, self._geometry, self._place)
            if not self._ghost_is_whole:
                self._ghost.turn(q_DH)

    def _change_kind(self, followed: bool) -> None:
        """Let the drawn hand pass from where it is to that of another kind."""
        if self._followed is not None:
            self._passage = Passage(self._clock(), self._shown[0], self._q_DH)
            self._q_DG = None
        self._followed = followed
        self._own.paint_hand(self._mesh, self._measured, followed)

    def show_beside(self, angles: Array, q_GH: Array, measured: Iterable[str]) -> None:
        """Draw the second hand, of which these fingers are measured."""
        assert self._beside is not None
        with self._lock, self._server.atomic():
            self._beside.measured(measured)
            self._beside.show(angles, q_GH)

    def face_ahead(self) -> None:
        """Let the fingers of the next hand shown point away from the viewer: call it when a calibration sets a new heading."""
        with self._lock:
            self._q_DG = None

    def measured(self, fingers: Iterable[str]) -> None:
        """Draw these fingers solid and the others pale."""
        with self._lock, self._server.atomic():
            if self._measured != (wanted := frozenset(fingers)):
                self._measured = wanted
                self._own.paint_hand(self._mesh, wanted, self._followed is not False)

    def ghost(self, angles: Array | None, whole: bool = False) -> None:
        """Show the pose to take, joint angles (joints, 3) rad, as translucent fingers on the patient's palm; None takes them away.

        With `whole`, and once the pose bends the wrist, the ghost is a hand of its own with a level forearm.
        """
        with self._lock, self._server.atomic():
            bent = angles is not None and bool(np.any(np.abs(angles[JOINT["wrist"]]) > _BENT_WRIST))
            self._ghost_is_whole = angles is not None and (whole or bent or self._ghost_is_whole)
            shown = () if angles is None else self._ghost_parts()
            for part in self._ghost.parts():
                self._ghost.show(part, part in shown)
            if angles is not None:
                self._draw(self._ghost, angles)
                self._ghost.turn(
                    view.forearm_level(postures.filled(angles), self._hand)
                    if self._ghost_is_whole
                    else self._q_DH
                )

    def measure(self, measured: Measured | None) -> None:
        """Draw on the hand what a task measures; None takes it away."""
        with self._lock, self._server.atomic():
            self._quantity = measured
            self._draw_quantity()

    def mirror(self, mirrored: bool) -> None:
        """Leave the number out of a picture that its viewers mirror: digits would be reversed."""
        with self._lock, self._server.atomic():
            self._mirrored = mirrored
            self._draw_quantity()

    def look(self, side: Side | None, framed: Sequence[Array] = ()) -> None:
        """Ease every viewer's camera to a side of the hand as it is turned now, None: each stays on its own side.

        It frames the hand shown and these postures, joint angles (joints, 3).
        """
        with self._lock, self._server.atomic():
            (angles, _), q_DH, place = self._shown, self._q_DH, self._place
            wanted = [angles, *(postures.filled(a) for a in framed)]
            points = sides.outline(wanted, self._geometry, q_DH) + place
            if self._beside is not None:
                points = np.concatenate([points, points - 2 * place])
            towards = side and sides.direction(side, self._hand, q_DH)
            if towards is not None:
                self._ground.lie_below(points, seen_from_below=towards[2] < 0)
                self._ground.follow(angles, q_DH, self._geometry, place)
            self._cameras.look(towards, points)

    def trail(self, places: Array) -> None:
        """Draw where the hand has been: places (n, 3) m in the global frame, seen from where it is now, oldest first; fewer than two draw nothing."""
        with self._lock, self._server.atomic():
            self._trail.visible = len(places) > 1 and self._q_DG is not None
            if len(places) > 1 and self._q_DG is not None:
                back = quat.rotate(self._q_DH, view.back_of_hand(self._geometry))
                self._trail.points = view.trail(
                    quat.rotate(self._q_DG, places) * view.units_per_metre(self._geometry) + back
                )

    def place(self, place: Array, sd: Array, doubtful: bool) -> None:
        """Draw on a map where the hand is, (3,) m in the trunk's axes, how sure that is (3,) m, and whether it is to be doubted."""
        with self._lock, self._server.atomic():
            if self._map is None:
                self._map = ReachMap(self._server)
            self._map.show(place, sd, doubtful)

    def forces(self, forces: Array | None) -> None:
        """Draw what the fingertips of the hand shown last push with, (5, 3) N in the global frame; None takes the arrows away."""
        with self._lock, self._server.atomic():
            if self._arrows is None and forces is not None:
                self._arrows = ForceArrows(
                    self._server, "/hand", self._geometry, view.units_per_metre(self._geometry)
                )
            self._forces = forces
            self._push()

    def highlight(self, segment: str | None) -> None:
        """Light the skin of one segment of anatomy.SEGMENTS, or none."""
        assert segment is None or segment in SEGMENT
        with self._lock, self._server.atomic():
            shown = () if segment is None else self._lit_parts(segment)
            for part in self._own.parts():
                if part.startswith(_LIT):
                    self._own.show(part, part in shown)

    @property
    def viewers(self) -> int:
        """How many pages are connected."""
        return len(self._server.get_clients())

    def as_html(self) -> str:
        """The scene as it stands, a page of its own that needs no server."""
        page: str = self._server.get_scene_serializer().as_html()
        return page

    def bones_by_mesh(self) -> dict[str, list[int]]:
        """Of every mesh of the patient's hand which bones (of bones.BONES) it follows, by its name in the scene."""
        return self._own.bones_by_mesh()

    @contextmanager
    def picture(self) -> Iterator[None]:
        """What is drawn within goes out together, now rather than with the next picture."""
        with self._server.atomic():
            yield
        self._server.flush()

    def in_its_thread(self, draw: Callable[[], None]) -> None:
        """Draw in viser's own thread, and wait: from another, viser 1.1.1 falls over now and then while it wakes those who wait for messages."""

        async def drawn() -> None:
            draw()

        asyncio.run_coroutine_threadsafe(drawn(), self._server.get_event_loop()).result()

    def _later(self, wait: float, draw: Callable[[], None]) -> None:
        """Draw in viser's own thread so many s later."""
        loop = self._server.get_event_loop()

        def drawn() -> None:
            with self._lock, self._server.atomic():
                draw()

        loop.call_soon_threadsafe(loop.call_later, wait, drawn)

    async def _renumber(self, _: ClientHandle) -> None:
        renumber(self._server)

    def _draw_quantity(self) -> None:
        """What is measured, on the hand as it is shown."""
        if self._arc is None and self._quantity is not None:
            self._arc = AngleArc(
                self._server,
                "/hand",
                self._geometry,
                view.units_per_metre(self._geometry),
                self._later,
            )
        if self._arc is not None:
            self._arc.show(self._quantity, self._shown[0], not self._mirrored)

    def _draw(self, drawn: DrawnHand, angles: Array) -> None:
        drawn.bend(*bones.pose(postures.filled(angles), self._geometry))

    def _push(self) -> None:
        """The arrows at the fingertips as the hand is shown."""
        if self._arrows is not None:
            angles, q_GH = self._shown
            self._arrows.show(None if self._forces is None else in_hand(self._forces, q_GH), angles)

    def _ghost_parts(self) -> tuple[str, ...]:
        """Names of the ghost's meshes of the kind wanted; they are sent to viewers when they are first needed."""
        kind = "whole_" if self._ghost_is_whole else "finger_"
        return self._made(
            self._ghost, kind, lambda: self._mesh.ghost(self._ghost_is_whole), palette.GHOST
        )

    def _lit_parts(self, segment: str) -> tuple[str, ...]:
        return self._made(
            self._own,
            f"{_LIT}{segment}_",
            lambda: highlight_parts(self._mesh, segment),
            palette.HIGHLIGHT,
        )

    def _made(
        self,
        drawn: DrawnHand,
        prefix: str,
        meshes: Callable[[], dict[str, SkinnedMesh]],
        paint: Paint,
    ) -> tuple[str, ...]:
        """Names of the parts whose names begin with `prefix`, made and painted unless they are there."""
        if not any(part.startswith(prefix) for part in drawn.parts()):
            for name, mesh in meshes().items():
                drawn.add(prefix + name, mesh)
                drawn.paint(prefix + name, paint)
        return tuple(part for part in drawn.parts() if part.startswith(prefix))
