"""What a live station draws in its 3-D scene: the hand, its path, the ghost, the place, the forces."""

import threading
import time
from collections.abc import Callable, Mapping

import numpy as np

from handscope.app.live import ghost
from handscope.app.live.readouts import pose_fit
from handscope.app.live.readouts.bending_finger import MOVES
from handscope.app.live.tracking import Tracking
from handscope.app.live.viewers import Viewers
from handscope.app.live.wizard.machine import State, StationStatus, Wizard
from handscope.app.protocols import Protocol
from handscope.app.scene.angle_arc import Measured
from handscope.app.scene.camera.sides import Side, side_of
from handscope.app.scene.scene_process import SceneProcess
from handscope.estimators.alignment import inclined_hand
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT
from handscope.estimators.numerics.typing import Array

TRAIL, MOVED = 2.0, 0.03  # s of the hand's path that are drawn, once it went so far (m)
# s, the same while nothing is calibrated: the mean over a quarter of a second moves slowly
INCLINED_INTERVAL = 1 / 30
PICTURE_INTERVAL = 1 / 60  # s, least time between two pictures; more where the tracker is behind
UNSEEN_INTERVAL = 0.25  # s, the same while no page shows the scene: drawing is half of what a station without a viewer costs
MEASURED = (
    State.TASK_READY,
    State.COUNTDOWN,
    State.RESUME_COUNTDOWN,
    State.TASK_RUN,
    State.TASK_PAUSED,
    State.TASK_REVIEW,
)
NOT_FOLLOWED = (
    State.CONNECT,
    State.CHECK,
    State.CHECKED,
    State.POSE_READY,
    State.POSE_HOLD,
    State.POSE_WORK,
)


class StationScene:
    """Draws into a SceneProcess; the tracker's thread and the station's tick both call it."""

    def __init__(
        self,
        process: SceneProcess,
        tracking: Tracking,
        viewers: Viewers,
        mounting: Callable[[], Mapping[str, Array]],
    ) -> None:
        """`mounting`: the nominal sensor-to-segment rotations as the glove states them now."""
        self._process, self._tracking, self._viewers = process, tracking, viewers
        self._mounting = mounting
        self.pose = pose_fit.NOMINAL  # that is to be taken
        self.followed = False  # whether the hand is tracked; else it shows inclinations alone
        self._lock = threading.Lock()
        self.newest: Trajectory | None = None  # row of the tracker
        self._protocol: Protocol | None = None  # whose measure is drawn
        self._framed: list[Array] = []  # its postures
        self.mirrored, self.measured = False, ""
        self.target: tuple[float, float] | None = None  # rad, band of what is measured
        self._again: Trajectory | None = None  # rows that are drawn once more
        self._again_since = 0.0  # s, host's clock
        self._shown: Trajectory | None = None  # row that was drawn last
        self._drawn_at = -np.inf  # s, host's clock

    def draw_hand_if_due(self, interval: float) -> None:
        """Draw the newest pose where the last picture is older than `interval` s."""
        if not self._process.viewers:
            interval = max(interval, UNSEEN_INTERVAL)
        now = time.monotonic()
        if now - self._drawn_at >= interval and self._draw_hand():
            self._drawn_at = max(self._drawn_at + interval, now - PICTURE_INTERVAL / 2)

    def begin(self) -> None:
        """Draw the neutral hand that stands until samples come."""
        self._process.measured(())
        self._process.show(inclined_hand.pose_angles(self.pose), None, followed=False)

    def draw_wizard(self, wizard: Wizard, status: StationStatus) -> None:
        """Ghost, highlighted segment and measured fingers of the wizard's state."""
        scene = self._process
        self.followed = is_followed(wizard, self._tracking.calibration is not None)
        scene.ghost(
            ghost.ghost(wizard, inclined_hand.pose_angles(self.pose), status.now - wizard.since)
        )
        is_checking = (
            wizard.state in (State.CONNECT, State.CHECK) and status.angular_rate_peak > MOVES
        )
        scene.highlight(status.fastest_segment if is_checking else None)
        self._follow_task(wizard, status)
        if wizard.state is not State.TASK_REVIEW:
            self._again = None
        if wizard.state in (State.CONNECT, State.CHECK, State.CHECKED):
            scene.measured([f for f in FINGERS if set(CHAINS[f]) <= status.measured])

    def look(self, side: Side | None) -> None:
        """Show a side of the hand, None: as each viewer looks at it, filling two thirds of the picture."""
        self._process.look(side, self._framed)

    def replay(self, rows: Trajectory) -> None:
        """Draw these rows once, in their own time, in place of the hand as it is now."""
        if len(rows):
            self._again, self._again_since = rows, time.monotonic()

    @property
    def replaying(self) -> bool:
        """Whether rows of before are drawn."""
        return self._again is not None

    def mirror(self, mirrored: bool) -> None:
        """Whether viewers see the hand as in a mirror."""
        self.mirrored = mirrored
        self._process.mirror(mirrored)

    def _follow_task(self, wizard: Wizard, status: StationStatus) -> None:
        """Turn to the side that shows a task, and mark what it measures, when the task comes."""
        protocol = wizard.protocol if wizard.state in MEASURED else None
        if protocol is self._protocol:
            return
        self._protocol = protocol
        if protocol is None:
            self.measured, self.target = "", None
            self._process.measure(None)
            return
        self.measured = curve = protocol.curve_of(status.measured)
        self._framed = [ghost.angles_of(p) for p in protocol.ghost]
        self.target = ghost.target(protocol, curve)
        self._process.measure(Measured(curve, self.target))
        self.look(side_of(curve))

    def _draw_hand(self) -> bool:
        with self._lock:
            if not self.followed:
                self._draw_inclined()
                return True
            rows = self._row_again() or self.newest
            if rows is None or rows is self._shown:
                return False
            self._shown = rows
            with self._process.picture():
                self._process.show(rows.angles[-1], rows.q_GS[-1, SEGMENT["hand"]])
                if self._viewers:  # following the path costs a fifth of tracking the hand
                    self._process.trail(self._trail())
            return True

    def _row_again(self) -> Trajectory | None:
        """The row of the replay that is due; None where nothing is replayed, or it is over."""
        rows = self._again
        if rows is None:
            return None
        k = int(np.searchsorted(rows.t, rows.t[0] + time.monotonic() - self._again_since))
        if k >= len(rows):
            self._again = None
            return None
        return rows.between(rows.t[k], np.nextafter(rows.t[k], np.inf))

    def _draw_inclined(self) -> None:
        self._shown = None
        if inclined := pose_fit.inclined_pose(self._tracking, self._mounting(), self.pose):
            with self._process.picture():
                self._process.show(*inclined, followed=False)
                self._process.trail(np.empty((0, 3)))

    def _trail(self) -> Array:
        """Path (n, 3) m of the hand in the last seconds; empty where it hardly moved."""
        places = self._tracking.trail(TRAIL)
        return places if len(places) and np.ptp(places, axis=0).max() > MOVED else places[:0]


def is_followed(wizard: Wizard, calibrated: bool) -> bool:
    """Whether the drawn hand is the tracked one: not before the first pose, nor while a pose is taken."""
    return calibrated and wizard.state not in NOT_FOLLOWED
