"""What a live station draws in its 3-D scene: the hand, its path, the ghost, the place, the forces."""

import threading
import time

import numpy as np

from handscope.app.live import ghost
from handscope.app.live.readouts.bending_finger import MOVES
from handscope.app.live.tracking import Tracking
from handscope.app.live.viewers import Viewers
from handscope.app.live.wizard.machine import State, StationStatus, Wizard
from handscope.app.scene.scene_process import SceneProcess
from handscope.estimators.alignment.initial_pose import DEG
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.movements.task_performance import POSE_THUMB

TRAIL, MOVED = 2.0, 0.03  # s of the hand's path that are drawn, once it went so far (m)
PICTURE_INTERVAL = 1 / 60  # s, least time between two pictures; more where the tracker is behind
THUMB = (POSE_THUMB[0] * DEG, POSE_THUMB[1] * DEG, POSE_THUMB[2] * DEG)


class StationScene:
    """Draws into a SceneProcess; the tracker's thread and the station's tick both call it."""

    def __init__(self, process: SceneProcess, tracking: Tracking, viewers: Viewers) -> None:
        self._process, self._tracking, self._viewers = process, tracking, viewers
        self._lock = threading.Lock()
        self.newest: Trajectory | None = None  # row of the tracker
        self._shown: Trajectory | None = None  # row that was drawn last
        self._drawn_at = -np.inf  # s, host's clock

    def draw_hand_if_due(self, interval: float) -> None:
        """Draw the newest pose where the last picture is older than `interval` s."""
        if time.monotonic() - self._drawn_at >= interval:
            self._draw_hand()

    def draw_wizard(self, wizard: Wizard, status: StationStatus) -> None:
        """Ghost, highlighted segment and measured fingers of the wizard's state."""
        scene = self._process
        scene.ghost(ghost.ghost(wizard, THUMB, status.now - wizard.since))
        is_checking = (
            wizard.state in (State.CONNECT, State.CHECK) and status.angular_rate_peak > MOVES
        )
        scene.highlight(status.fastest_segment if is_checking else None)
        if wizard.state in (State.CONNECT, State.CHECK, State.CHECKED):
            scene.measured([f for f in FINGERS if set(CHAINS[f]) <= status.measured])

    def _draw_hand(self) -> None:
        with self._lock:
            rows = self.newest
            if rows is None or rows is self._shown:
                return
            self._drawn_at, self._shown = time.monotonic(), rows
            with self._process.picture():
                self._process.show(rows.angles[-1], rows.q_GS[-1, SEGMENT["hand"]])
                if self._viewers:  # following the path costs a fifth of tracking the hand
                    self._process.trail(self._trail())

    def _trail(self) -> Array:
        """Path (n, 3) m of the hand in the last seconds; empty where it hardly moved."""
        places = self._tracking.trail(TRAIL)
        return places if len(places) and np.ptp(places, axis=0).max() > MOVED else places[:0]
