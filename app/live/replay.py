"""A station that replays a result's movement in the 3-D scene, with a second one in step where wanted."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from handscope.app.live.readouts.angle_rows import angle_rows
from handscope.app.live.viewers import Viewers
from handscope.app.results.curves import MatchedTask, at_other
from handscope.app.results.quantity_curve import Curve
from handscope.app.scene.camera.sides import Side
from handscope.app.scene.hand_scene import HandScene
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, JOINTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array

TICK = 1 / 60  # s
SNAPSHOT_INTERVAL = 0.1  # s between two snapshots while it plays
SPEEDS = (0.1, 4.0)
ARRIVAL_TIME = 5.0  # s for a page to begin watching


@dataclass(frozen=True)
class SecondMovement:
    """A movement played beside another: task by task in step, or on the clock of one recording."""

    geometry: HandGeometry
    session: int
    result: int
    movement: dict[str, Array]
    steps: tuple[MatchedTask, ...]  # of curves.matching_tasks; none: one clock

    def row(self, t: float) -> int:
        """The row that belongs to the first movement's time t."""
        return _row(self.movement, at_other(self.steps, t))


class Replay:
    """A context manager; `act` plays, pauses, seeks, changes the speed."""

    kind: Literal["replay"] = "replay"

    def __init__(
        self,
        name: str,
        hand: Hand,
        geometry: HandGeometry,
        session: int,
        result: int,
        movement: dict[str, Array],
        beside: SecondMovement | None = None,
    ) -> None:
        self.name, self.session, self.result, self.hand = name, session, result, hand
        self.scene = HandScene(hand, geometry, beside.geometry if beside else None)
        self.beside = beside
        self.curve = Curve()
        self.mirrored = False
        self.playing, self.speed = False, 1.0
        self.t = float(movement["t"][0])
        self.used = time.monotonic()
        self._movement = movement
        self._lock = threading.Lock()
        self._viewers = Viewers()
        self._number = 0  # of the newest snapshot
        self._stop = threading.Event()

    def __enter__(self) -> "Replay":
        self.scene.measured(_measured_fingers(self._movement))
        if self.beside:
            self._measured_beside = _measured_fingers(self.beside.movement)
            self._draw_beside(self.beside, 0)  # its first orientation faces ahead
        self._draw()
        self._thread = threading.Thread(target=self._run, name=f"replay {self.name}", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(5.0)
        self._number += 1
        self.scene.close()
        self._viewers.notify()

    @property
    def ended(self) -> bool:
        return self._stop.is_set()

    @property
    def is_taken(self) -> bool:
        """Whether somebody watches it or is about to."""
        return bool(self._viewers) or time.monotonic() - self.used < ARRIVAL_TIME

    @property
    def span(self) -> tuple[float, float]:
        return float(self._movement["t"][0]), float(self._movement["t"][-1])

    def act(self, what: str, value: float | None = None) -> None:
        """play, pause, seek (to `value` s) or speed (`value`)."""
        first, last = self.span
        self.used = time.monotonic()
        with self._lock:
            if what == "play":
                self.t = first if self.t >= last else self.t
                self.playing = True
            elif what == "pause":
                self.playing = False
            elif what == "seek" and value is not None and np.isfinite(value):
                self.t = float(np.clip(value, first, last))
            elif what == "speed" and value is not None and np.isfinite(value):
                self.speed = float(np.clip(value, *SPEEDS))
            else:
                raise InputError("live.action_value", what=what, value=str(value))
            self._draw()
            self._number += 1
        self._viewers.notify()

    def look(self, side: Side | None, mirrored: bool | None = None) -> None:
        """As Station.look."""
        if mirrored is None:
            self.scene.look(side)
        else:
            self.mirrored = mirrored
            self.scene.mirror(mirrored)
            self._number += 1
        self._viewers.notify()

    def snapshot(self) -> dict[str, Any]:
        first, last = self.span
        where = {
            "t": self.t,
            "start": first,
            "stop": last,
            "playing": self.playing,
            "speed": self.speed,
        }
        return {
            "station": self.name,
            "session": self.session,
            "result": self.result,
            "hand": self.hand,
            "replay": where,
            "mirrored": self.mirrored,
            "beside": {
                "session": self.beside.session,
                "result": self.beside.result,
                "hand": self.beside.geometry.hand,
            }
            if self.beside
            else None,
            "ended": self.ended,
        }

    def news(self) -> tuple[int, dict[str, Any]]:
        """The snapshot with its number; a new one after each action and from time to time while it plays."""
        return self._number, self.snapshot()

    @property
    def changes(self) -> int:
        """A counter that moves when a pulse may differ."""
        return self._viewers.changes

    def pulse(self, since: float) -> dict[str, Any]:
        angles = angle_rows(self._movement["angles"][_row(self._movement, self.t)])
        return {"angles": angles, "points": [], "t": round(self.t, 3), "playing": self.playing}

    def watch(self, notice: Callable[[], object]) -> Callable[[], None]:
        """As Station.watch."""
        return self._viewers.add(notice)

    def _run(self) -> None:
        before = time.monotonic()
        while not self._stop.wait(TICK):
            now = time.monotonic()
            passed, before = now - before, now
            if not self.playing:
                continue
            with self._lock:
                self.t = min(self.t + passed * self.speed, self.span[1])
                self.playing = self.t < self.span[1]
                self._draw()
                self._number += (
                    now // SNAPSHOT_INTERVAL != (now - passed) // SNAPSHOT_INTERVAL
                    or not self.playing
                )
            self._viewers.notify()

    def _draw(self) -> None:
        k = _row(self._movement, self.t)
        with self.scene.picture():
            self.scene.show(
                self._movement["angles"][k].astype(float), self._movement["q_GH"][k].astype(float)
            )
            if "forces" in self._movement:
                self.scene.forces(self._movement["forces"][k].astype(float))
            if self.beside:
                self._draw_beside(self.beside, self.beside.row(self.t))

    def _draw_beside(self, other: SecondMovement, k: int) -> None:
        angles, q_GH = (other.movement[name][k].astype(float) for name in ("angles", "q_GH"))
        self.scene.show_beside(angles, q_GH, self._measured_beside)


def _row(movement: dict[str, Array], t: float) -> int:
    return int(np.clip(np.searchsorted(movement["t"], t), 0, len(movement["t"]) - 1))


def _measured_fingers(movement: dict[str, Array]) -> list[str]:
    """The fingers whose last segment has angles."""
    angles = movement["angles"]
    is_known = [bool(np.isfinite(angles[:, k]).any()) for k in range(len(JOINTS))]
    children = {joint.child for joint, k in zip(JOINTS, is_known) if k}
    return [f for f in FINGERS if CHAINS[f][-1] in children]
