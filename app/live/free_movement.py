"""The rung "free movement" of a live session: what can be observed already while the hand moves, then solving beside the session, then what was found.

watched      once a second, from the samples and the poses that the tracker keeps
solved       in a process of its own (solving.py); the wizard waits in FREE_WORK and may leave it
used         lengths and seats serve every pose from now on, and are kept with the patient: accepting is the decision
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from app.devices.glove import Glove
from app.live.solving import Solving
from app.live.tracking import Tracking
from app.live.wizard import Order
from estimators import joint_observability
from estimators import quaternions as quat
from estimators.calibration import Calibration, Known
from estimators.hand_anatomy import FLEXION, JOINT, JOINTS, SEGMENT
from estimators.joint_observability import ObservabilityParams, Observed
from estimators.quaternions import Array
from estimators.samples import GYR, Event
from estimators.trajectory import Trajectory
from sessions.recording import LoadedRecording
from sessions.self_calibrations import ALL, Found, taken_over

EVERY = 1.0  # s of samples that the meter takes at a time
LATE = 0.3  # s after which the last strip's samples have come
THIN = 5  # every so many poses count for a joint's excursion
MOVED = [j for j in JOINTS if j.parent != "forearm"]


class FreeMovement:
    """One for a station; `keep` takes what was found and accepted."""

    def __init__(self, glove: Glove, tracking: Tracking, number: Callable[[], int], keep: Callable[[Found, str], object]) -> None:
        self._glove, self._tracking, self._number, self._keep = glove, tracking, number, keep
        self.solving: Solving | None = None
        self.meter: tuple[Observed, ...] = ()
        self.found: Found | None = None
        self._watched = np.inf  # s of the recording up to which was looked
        self._information: dict[str, Array] = {}
        self._flexion: list[Array] = []
        self._event: tuple[str, Event] | None = None
        self._used: Known | None = None

    def known(self, earlier: Known | None, of_glove: str) -> Known | None:
        """What the next pose takes over: what was found and accepted here, else what was decided when the session began."""
        if self._used is None and earlier is not None:
            return reused(earlier, of_glove, self.worn)
        return self._used

    def forget(self) -> None:
        """The strips were read in another way: what was found of them holds no longer."""
        self._leave("not used")
        self._used = None

    def do(self, order: Order) -> None:
        """An order of the wizard's about free movement."""
        if order.kind == "watch_free":
            self._watched, self._information, self._flexion, self.meter, self.found = order.onset, {}, [], (), None
        elif order.kind == "solve_free":
            self._watched = np.inf
            self._begin(order)
        elif order.kind == "leave_free":
            self._leave(order.reason)
        elif order.kind == "use_free" and self.found is not None:
            self._used = taken_over(self.found.table, ALL)
            self._keep(self.found, self.worn)
            self._event = None

    def watch(self) -> None:
        """Take in the newest second of movement, where one has gone by."""
        stop = self._tracking.newest_sample() - LATE
        if stop - self._watched < EVERY or self._tracking.calibration is None:
            return
        start, self._watched = self._watched, stop
        rows = self._tracking.past(start, stop)
        for joint, told in gained(self._tracking, rows, start, stop).items():
            self._information[joint] = self._information.get(joint, np.zeros((6, 6))) + told
        self._flexion.append(rows.angles[::THIN, :, FLEXION])
        params, flexion = ObservabilityParams(), np.concatenate(self._flexion)
        self.meter = tuple(
            joint_observability.observed(params, name, told, flexion[:, JOINT[name]]) for name, told in self._information.items()
        )

    def solved(self) -> bool:
        """Whether the computation came to an end just now, in `found` or `refusal`."""
        if self.solving is None:
            return False
        self.solving.look()
        self.found = self.solving.found
        return self.solving.over

    def settle(self) -> str:
        """The computation that came to an end is put away; gives why it found nothing."""
        refusal = self.solving.refusal if self.solving else ""
        self.solving = None
        if refusal:
            self._take_back("refused")
        return refusal

    def close(self) -> None:
        """End what is being computed."""
        if self.solving is not None:
            self.solving.close()
            self.solving = None

    def told(self) -> dict[str, Any]:
        """For a page: the meter joint by joint, how far the computation is, what was found."""
        return {
            "meter": [
                {
                    "joint": o.joint,
                    "share": math.floor(100 * o.share) / 100,  # 1 is enough, and nothing less
                    "excursion_deg": round(float(np.degrees(o.excursion))),
                    "place_mm": round(1e3 * o.place_sd, 1),
                }
                for o in self.meter
            ],
            "share": None if self.solving is None else round(self.solving.share, 2),
            "found": None if self.found is None else {"table": self.found.table, "told": list(self.found.told)},
        }

    @property
    def worn(self) -> str:
        """The number of the glove that is worn; "" before it said so."""
        identity = self._glove.assembler.identity
        return "" if identity is None else f"{identity.device_id:016x}"

    def _begin(self, order: Order) -> None:
        """The movement is kept in the recording, and solved."""
        self.close()
        tracking, event = self._tracking, Event(order.onset, order.end - order.onset, order.task, {})
        self._event = (f"free-{self._number()}", event)
        self._glove.keep_event(*self._event)
        samples = {b.stream.name: b for b in (b.between(order.onset, order.end) for b in tracking.samples(order.onset)) if len(b.t)}
        self.solving = Solving(LoadedRecording(tracking.hand, tracking.geometry, self._glove.assembler.mounting, samples, (event,)))

    def _leave(self, outcome: str) -> None:
        self.close()
        self.found, self._watched = None, np.inf
        self._take_back(outcome)

    def _take_back(self, outcome: str) -> None:
        """It is not to count: the recording says that it was done, and no more."""
        if self._event is not None:
            event_id, event = self._event
            details = {"task_name": event.trial_type, "outcome": outcome}
            self._glove.keep_event(event_id, replace(event, trial_type="annotation", details=details))
            self._event = None


def reused(known: Known, of_glove: str, worn: str) -> Known:
    """What an earlier self-calibration gives a session: of another glove its lengths alone."""
    return known.of_hand() if of_glove and worn and of_glove != worn else known


def gained(tracking: Tracking, rows: Trajectory, start: float, stop: float) -> dict[str, Array]:
    """Information (6, 6) on every joint between two sensors that a stretch of samples holds; `rows` are its poses."""
    calibration = tracking.calibration
    if calibration is None or len(rows) < 2:
        return {}
    where = {s: (b, k) for b in tracking.samples(start) if b.stream.inertial for k, s in enumerate(b.stream.sensors)}
    found = {}
    for joint in (j for j in MOVED if j.parent in where and j.child in where):
        (before, p), (behind, c) = where[joint.parent], where[joint.child]
        before, behind = before.between(start, stop), behind.between(start, stop)
        if len(before.t) < 3 or len(behind.t) < 3:
            continue
        gyr_c = np.stack([np.interp(before.t, behind.t, axis) for axis in behind.of(GYR)[:, c].T], axis=1)
        at = np.clip(np.searchsorted(rows.t, before.t), 0, len(rows.t) - 1)
        q_pc = quat.relative(*(_sensor(rows, calibration, s)[at] for s in (joint.parent, joint.child)))
        found[joint.name] = joint_observability.information(
            ObservabilityParams(), before.of(GYR)[:, p], gyr_c, q_pc, 1.0 / before.stream.rate
        )
    return found


def _sensor(rows: Trajectory, calibration: Calibration, segment: str) -> Array:
    """Orientation of a segment's sensor (n, 4)."""
    return quat.multiply(rows.q_GS[:, SEGMENT[segment]], calibration.q_BS.get(segment, quat.IDENTITY))
