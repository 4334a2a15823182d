"""The checks of a recording, run over what has come so far: while the glove is put on, after the pose, after each task.

In      the tracker's buffered samples, what is declared of the hand, the wizard's state at every tick
Out     suspicions, and of those of the first step the one correction that the readings leave
Limits  after the first step checks take at most `SHARE` of the tracker's processor time: one that is not paid for waits for the next task
"""

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handscope.app.live.tracking import Tracking, measured
from handscope.app.live.wizard.machine import State, StationStatus, Wizard, propose
from handscope.app.workers.process import WorkerProcess, no_context, stand_back
from handscope.estimators.data.samples import GYR, Block
from handscope.estimators.errors import InputError
from handscope.estimators.fault_detection.check import check_recording
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.sessions.files import sensor_corrections
from handscope.sessions.files.recording import LoadedRecording

log = logging.getLogger(__name__)
MOVED, MOVING = 10.0, 0.5  # s of movement that a first check needs; rad/s of the fastest sensor
OFTENER = 2.0  # times as much movement until the next check of the first step
LOOKED_AT = 30.0  # s, the newest of a recording
# s of those since the check before, in which sensors turn most: after the first step
BUSIEST = 15.0
SHARE = 0.05  # of the tracker's processor time
USUAL_COST = 0.07  # s of processor time, of a check of 15 s of 16 sensors; until one was run
LESS_URGENT = 10  # of a process's priority
OWN = {State.POSE_REVIEW, State.TASK_REVIEW}


@dataclass
class SensorChecks:
    """Runs checks in a thread of their own, one at a time."""

    tracking: Tracking
    hand: Hand
    geometry: HandGeometry
    notify: Callable[[], None]
    one_at_a_time: AbstractContextManager[object]  # with checks of other stations
    found: tuple[Suspicion, ...] = ()
    spent: float = 0.0  # s of processor time after the first step
    _moved: float = 0.0  # s in the first step
    _needed: float = MOVED
    _last: tuple[State, float] = (State.CONNECT, 0.0)  # state and recording time at the last tick
    _due: bool = False
    _cost: float = USUAL_COST  # s of processor time of the newest check
    _looked: float = -np.inf  # s, newest sample that a check has seen
    _begun: int = 0  # times that samples were read anew
    _thread: threading.Thread | None = field(default=None, repr=False)

    def follow(
        self, wizard: Wizard, status: StationStatus, mounting: Mapping[str, Array]
    ) -> Wizard:
        """At every tick: begin a check where one is due and the last is done; the wizard offers what was found."""
        self._begin_if_due(wizard.state, status, mounting)
        return propose(wizard, self.swapped(), self.mend())

    def _begin_if_due(
        self, state: State, status: StationStatus, mounting: Mapping[str, Array]
    ) -> None:
        before, at = self._last
        self._last = state, status.t
        if state is State.CONNECT and status.flowing and status.angular_rate_peak > MOVING:
            self._moved += min(max(status.t - at, 0.0), 1.0)  # rates are those of a second
        first = state is State.CONNECT and self._moved >= self._needed
        self._due |= state in OWN and state is not before
        paid = self.spent + self._cost <= SHARE * self.tracking.spent
        if (first or (self._due and paid)) and not (self._thread and self._thread.is_alive()):
            self._needed *= OFTENER if first else 1.0
            self._due = False
            arguments = (state is State.CONNECT, dict(mounting), self._begun)
            self._thread = threading.Thread(target=self._run, args=arguments, daemon=True)
            self._thread.start()

    def restart(self) -> None:
        """Samples are read in another manner from now on: what was found of the others holds no more."""
        self.found, self._moved, self._needed, self._looked = (), 0.0, MOVED, -np.inf
        self._begun += 1

    def swapped(self) -> tuple[str, str] | None:
        """Two fingers whose strips are exchanged."""
        one = next((s for s in self.found if s.message.code == "fingers.exchanged"), None)
        if one is None or one.correction is None:
            return None
        fingers = [f for f in FINGERS if set(CHAINS[f]) & set(one.sensors)]
        return (fingers[0], fingers[1]) if len(fingers) == 2 else None

    def mend(self) -> str:
        """The first correction of readings that the findings leave; empty where there is none."""
        for one in self.found:
            correction = sensor_corrections.from_finding(one.sensors, one.correction)
            if correction and one.message.code != "fingers.exchanged":
                return correction.text
        return ""

    def _run(self, first: bool, mounting: Mapping[str, Array], begun: int) -> None:
        try:
            with self.one_at_a_time:
                found, self._cost = self.check(mounting, first)
        except InputError:
            found = []
        except Exception:  # a check that fails must not end a session that records
            log.exception("checks of the sensors")
            found = []
        self.spent += 0.0 if first else self._cost
        if begun == self._begun:
            known = [] if first else [s for s in self.found if not _again(s, found)]
            self.found = (*known, *found)
            self.notify()

    def check(
        self, mounting: Mapping[str, Array], first: bool = False
    ) -> tuple[list[Suspicion], float]:
        """What the newest samples show, questions about the person left out, and what the check cost (s of processor time); after the first step the part in which sensors turn most."""
        newest = self.tracking.newest_sample()
        since = newest - LOOKED_AT if first else max(newest - LOOKED_AT, self._looked)
        blocks = [b for b in measured(self.tracking.samples(since)) if len(b.t)]
        self._looked = newest
        declared = LoadedRecording(self.hand, self.geometry, mounting, {}, ())
        calibration = self.tracking.calibration
        calibrations = (
            [] if calibration is None or not calibration.source.is_pose else [calibration]
        )
        found, cost = find_beside(blocks if first else busiest(blocks), declared, calibrations)
        return [s for s in found if s.message.severity != "info"], cost


def find_beside(*given: Any) -> tuple[list[Suspicion], float]:
    """What `check_recording` finds, and the processor time (s) of it, in a process of its own: here it would ask for the interpreter in the middle of every station's steps."""
    with WorkerProcess(no_context) as process:
        return process.do(_find, given)


def _find(_: None, given: tuple[Any, ...]) -> tuple[list[Suspicion], float]:
    """In the process, which comes after all others."""
    stand_back(LESS_URGENT)
    began = time.process_time()
    return check_recording(*given), time.process_time() - began


def busiest(blocks: Sequence[Block], seconds: float = BUSIEST) -> list[Block]:
    """The part of so many seconds, from a full second on, in which the sensors turn most; all where there is no more."""
    turning = [b for b in blocks if GYR in b.stream.quantities]
    if not turning:
        return list(blocks)
    first, last = (f(b.t[k] for b in turning) for f, k in ((min, 0), (max, -1)))
    starts = np.arange(first, max(last - seconds, first) + 1e-9)
    turned = sum(_turned_since(b, starts) - _turned_since(b, starts + seconds) for b in turning)
    start = float(starts[int(np.argmax(turned))])
    return [part for b in blocks if len((part := b.between(start, start + seconds)).t)]


def _turned_since(block: Block, t: Array) -> Array:
    """Squared rates of a block's sensors from instants (n,) on, integrated."""
    squares = np.nansum(block.of(GYR) ** 2, axis=(1, 2)) / block.stream.rate
    left = np.append(np.cumsum(squares[::-1])[::-1], 0.0)
    return np.asarray(left[np.searchsorted(block.t, t)])


def _again(one: Suspicion, others: list[Suspicion]) -> bool:
    return any((o.message.code, o.sensors) == (one.message.code, one.sensors) for o in others)
