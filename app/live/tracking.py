"""The tracker of a live station: takes blocks from the glove's thread, steps the method in its own, keeps the newest pose and a short past.

Nothing here can hold up the recording: the queue is bounded, and full means that the oldest blocks are skipped and counted.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handscope.app.live.readouts.hand_trail import HandTrail
from handscope.app.live.readouts.motion import Motion, latest, motions
from handscope.estimators.alignment import (
    functional_calibration,
    functional_movements,
    initial_pose,
    mounting_checks,
)
from handscope.estimators.alignment.functional_movements import Piece
from handscope.estimators.alignment.initial_pose import Pose
from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import Calibration, Known
from handscope.estimators.data.findings import Finding
from handscope.estimators.data.samples import Block, join, joined
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import with_known
from handscope.estimators.sensors import fault_detection

log = logging.getLogger(__name__)
QUEUE = 2000  # blocks, about 3 s of 7 streams at 10 ms; older ones are skipped
PAST_SAMPLES = 90.0  # s of raw samples kept, for a pose just held or a calibration step just done
PAST_POSES = (
    PAST_SAMPLES  # s of trajectory kept: whoever asks for poses asks for their samples, too
)
TOGETHER = 128  # pieces of it that are laid together: few large arrays take less memory than many small ones, and the collector of garbage less time
BESIDE = 16  # small blocks of a stream's samples that are laid together: a second of them is looked at ten times a second
TURNED = 0.1  # s in which the hand's orientation is looked for
GUESSED_FROM = 1.0  # s of samples that tell gravity where nothing is calibrated
AGAIN = 3  # failures in a row after which a method does not go on from its last state: that is what it fails of
LONGEST_REST = (
    0.03  # s between two feedings, of the 80 ms that a viewer under load may be told late
)
PATIENCE = 0.1  # s that a silent strip is waited for


@dataclass(frozen=True)
class _Before:
    """Where the tracker stood when a calibration took the place of another."""

    seen: Mapping[str, float]  # s, newest sample that the state knows, by stream
    calibration: Calibration | None
    state: Any
    findings: tuple[Finding, ...]
    doubts: NDArray[np.uint8]


class Tracking:
    """A context manager that owns the estimator's thread."""

    def __init__(
        self,
        method: ModuleType,
        params: Any,
        hand: Hand,
        geometry: HandGeometry,
        on_pose: Callable[[Trajectory], None],
        patience: float = PATIENCE,
    ) -> None:
        self._patience = patience
        self.method, self.params, self.hand, self.geometry = method, params, hand, geometry
        self.skipped = 0  # blocks that the live view left out; the recording has them
        self.rest = 0.0  # s in which no more blocks are wanted after the newest
        self.failures = 0  # times that the method failed and was started again
        self._failed_since = 0  # of them since it last did not
        self.calibration: Calibration | None = None
        self.mounting: Mapping[str, Array] = {}
        self.pieces: Mapping[
            str, Piece
        ] = {}  # of a functional calibration, by step: every pose from now on is combined with them
        self.known: Known | None = (
            None  # of an earlier self-calibration: every pose from now on takes it over
        )
        self.findings: tuple[Finding, ...] = ()  # of the sensors, when they were looked at last
        self._doubts = np.zeros(
            len(SEGMENTS), np.uint8
        )  # Flags that every row of a segment has until the next calibration
        self._before: _Before | None = None  # what the newest calibration took the place of
        self._on_pose = on_pose
        self._queue: deque[Block] = deque()
        self._wake = threading.Condition()
        self._stop = False
        self._lock = threading.RLock()  # state, past samples and past poses
        self._state: Any = None
        self._samples: dict[str, deque[Block]] = {}
        self._poses: deque[Trajectory] = deque()
        self._trail = HandTrail()

    def __enter__(self) -> "Tracking":
        self._thread = threading.Thread(target=self._run, name="tracking", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._wake:
            self._stop = True
            self._wake.notify()
        self._thread.join(5.0)

    def feed(self, blocks: list[Block]) -> float:
        """Take blocks from the glove's thread; never waits. Gives how long (s) no more are wanted."""
        with self._wake:
            self._queue.extend(blocks)
            while len(self._queue) > QUEUE:
                self._queue.popleft()
                self.skipped += 1
            self._wake.notify()
        return self.rest

    def calibrate(self, pose: Pose) -> Calibration:
        """Start the method from a pose that was just held, and catch up; InputError when the pose is not usable."""
        window = self.samples(-np.inf)
        calibration = initial_pose.calibrate(
            self.params, self.hand, self.geometry, self.mounting, window, pose
        )
        if self.pieces:
            calibration = functional_calibration.combine(
                self.params, self.pieces, calibration, self.mounting
            )
        if self.known is not None:
            calibration = with_known(calibration, self.known)
        calibration = self._checked(calibration, window, pose)
        self._replace(calibration)
        return calibration

    def guess(self) -> Calibration:
        """Start the method from defaults, without any pose: everything is flagged as not calibrated. InputError without the hand's sensor."""
        calibration = initial_pose.guessed(
            self.params,
            self.hand,
            self.geometry,
            self.mounting,
            self.samples(self.newest_sample() - GUESSED_FROM),
        )
        self.findings = ()
        self._replace(calibration)
        return calibration

    def take_back(self) -> Calibration | None:
        """Go on as if the newest calibration had not been made: with the one before, from where the method stood then."""
        before, self._before = self._before, None
        with self._lock:
            if before is None or before.calibration is None:
                self.calibration, self._state = None, None
                self._trail.begin(None)
                return None
            self.calibration, self._state, self.findings, self._doubts = (
                before.calibration,
                before.state,
                before.findings,
                before.doubts,
            )
            self._trail.begin(before.calibration)
            self._poses.clear()
            self._catch_up(before.seen)
            return self.calibration

    def faults(self) -> tuple[Finding, ...]:
        """What is wrong with single sensors by the samples kept, as far as that can be told without a pose."""
        return tuple(
            f
            for f in fault_detection.check(self.samples(-np.inf), (0.0, 0.0))
            if f.kind in ("dead_axis", "stuck")
        )

    def swapped(self) -> tuple[str, str] | None:
        """Two fingers whose strips the pose shows on each other's."""
        fingers = list(
            dict.fromkeys(
                f.sensor.split("_")[0]
                for f in self.findings
                if f.kind == "swapped" and f.severity == "fault"
            )
        )
        return (fingers[0], fingers[1]) if len(fingers) == 2 else None

    def _replace(self, calibration: Calibration) -> None:
        with self._lock:
            seen = {
                name: float(blocks[-1].t[-1]) for name, blocks in self._samples.items() if blocks
            }
            self._before = _Before(seen, self.calibration, self._state, self.findings, self._doubts)
            self._doubts = doubts(
                calibration, self.findings, getattr(self.params, "MAGNETOMETER", False)
            )
            self._begin(calibration)

    def measure(self, step: str, onset: float, end: float) -> Piece:
        """What a step of a functional calibration tells that was just done; gyroscope biases are those of the pose."""
        bias = self.calibration.gyr_bias if self.calibration else {}
        return functional_movements.measure(
            self.params, step, self.samples(onset), onset, end, bias
        )

    def samples(self, onset: float) -> list[Block]:
        """Samples kept of an instant and later, one block a stream."""
        with self._lock:
            kept = [
                list(takewhile(lambda b: b.t[-1] >= onset, reversed(blocks)))[::-1]
                for blocks in self._samples.values()
            ]
        return [join(blocks).between(onset, np.inf) for blocks in kept if blocks]

    def _checked(self, calibration: Calibration, window: list[Block], pose: Pose) -> Calibration:
        """The calibration with what is wrong with the sensors among its warnings."""
        still = replace(pose, onset=calibration.t, duration=calibration.end - calibration.t)
        found = fault_detection.check(
            window, (calibration.t, calibration.end)
        )  # all of it: what stood still while others moved
        broken = {f.sensor for f in found if f.severity == "fault"}
        mounting = {
            **self.mounting,
            **{s: calibration.q_BS[s] for s in calibration.q_BS_sd},
        }  # told by movements: how it sits is known
        found += [
            f for f in mounting_checks.check(window, mounting, still, ()) if f.sensor not in broken
        ]
        self.findings = tuple(found)
        return replace(
            calibration,
            warnings=tuple(dict.fromkeys((*calibration.warnings, *(f.said for f in found)))),
        )

    def restart(self) -> None:
        """Forget every sample and calibration: what comes from now on is read in another way."""
        with self._wake:
            self._queue.clear()
        with self._lock:
            self._samples.clear()
            self._poses.clear()
            self._trail.begin(None)
            self.calibration, self._state, self._before, self.pieces, self.known = (
                None,
                None,
                None,
                {},
                None,
            )
            self.findings, self._doubts = (), np.zeros(len(SEGMENTS), np.uint8)

    def begin(self, calibration: Calibration) -> None:
        """Start from a calibration made before."""
        with self._lock:
            self._begin(calibration)

    def motion(self) -> dict[str, Motion]:
        """How much each sensor moves, from the last second of its samples, by segment."""
        with self._lock:  # the method waits for it: no more than take the blocks
            recent = [latest(blocks, 1.0) for blocks in self._samples.values()]
        seconds = (
            join(blocks).between(blocks[-1].t[-1] - 1.0, np.inf) for blocks in recent if blocks
        )
        return {segment: m for block in seconds for segment, m in motions(block).items()}

    def newest_sample(self) -> float:
        """Time of the newest sample of any stream, s; -inf before the first."""
        with self._lock:
            return max(
                (float(blocks[-1].t[-1]) for blocks in self._samples.values() if blocks),
                default=-np.inf,
            )

    def past(self, start: float, stop: float = np.inf) -> Trajectory:
        """The trajectory that was shown between two instants."""
        with self._lock:
            late = takewhile(lambda p: not len(p) or p.t[-1] >= start, reversed(self._poses))
            pieces = [p for p in late if len(p) and p.t[0] < stop][::-1]
        return trajectory.join(pieces, self.hand).between(start, stop)

    def trail(self, seconds: float) -> Array:
        """Where the hand has been in the last seconds (n, 3) m in the global frame, seen from where it is now; oldest first. Computed when it is asked for."""
        with self._lock:
            hand = next(
                (
                    b
                    for b in self._samples.values()
                    if b and b[-1].stream.inertial and "hand" in b[-1].stream.sensors
                ),
                (),
            )
            self._trail.follow(hand, self._turned)
            return self._trail.places(seconds)

    def _turned(self, t: float) -> Array | None:
        """Orientation of the hand (4,) in the global frame as it was shown at an instant; None where it was not."""
        rows = self.past(t, t + TURNED)
        return (
            rows.q_GS[0, SEGMENT["hand"]]
            if len(rows) and np.isfinite(rows.q_GS[0, SEGMENT["hand"]]).all()
            else None
        )

    def drain(self) -> None:
        """Give out what the method still holds back: nothing more will come."""
        with self._lock:
            if self._state is not None:
                self._take(joined(self._queue))
                self._queue.clear()
                self._state, rest = self.method.finish(self.params, self._state)
                rest = self._doubted(rest)
                if len(rest):
                    self._poses.append(rest)
        if self._state is not None and len(rest):
            self._show(rest)

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._queue or self._stop)
                if self._stop:
                    return
                waited = list(self._queue)
                self._queue.clear()
            began, computed = time.monotonic(), time.thread_time()
            with self._lock:
                newest = self._take(joined(waited))
            if newest is not None:
                self._show(newest)
            self.rest = rest_after(time.monotonic() - began, time.thread_time() - computed)

    def _show(self, rows: Trajectory) -> None:
        """Hand rows on; what is done with them may fail, and the method goes on."""
        try:
            self._on_pose(rows)
        except Exception:
            log.exception("a pose could not be shown")

    def _take(self, blocks: list[Block]) -> Trajectory | None:
        """Remember and step; what a step that fails would have made of its block is lost and nothing else, and the failure is counted."""
        for block in blocks:
            self._remember(block)
        if self._state is None:
            return None
        faults: list[Exception] = []
        pieces = [self._survived(faults, self.method.step, block) for block in blocks]
        pieces.append(self._survived(faults, self.method.release, self._patience))
        self.failures += len(faults)
        self._failed_since = self._failed_since + 1 if faults else 0
        if faults:
            log.error(
                "the method failed and goes on from its state before", exc_info=faults[0]
            )  # the first stands for all of these blocks
        if self._failed_since > AGAIN:
            self._start_again()
        return self._kept(pieces)

    def _survived(
        self,
        faults: list[Exception],
        face: Callable[..., tuple[Any, Trajectory]],
        given: Block | float,
    ) -> Trajectory:
        """The rows of one step; where it fails the fault is noted and the state stays what it was."""
        try:
            self._state, rows = face(self.params, self._state, given)
        except Exception as fault:  # any failure of a method must leave the station alive
            faults.append(fault)
            return trajectory.empty(self.hand)
        return rows

    def _start_again(self) -> None:
        """From the calibration: it is the last state that it fails of."""
        assert self.calibration is not None
        try:
            self._state, self._failed_since = (
                self.method.start(self.params, self.calibration, self._streams()),
                0,
            )
        except Exception:
            log.exception("the method could not be started again")

    def _kept(self, pieces: Sequence[Trajectory]) -> Trajectory | None:
        """The rows of these pieces, remembered; None where there are none."""
        if not any(len(p) for p in pieces):
            return None
        rows = self._doubted(trajectory.join([p for p in pieces if len(p)], self.hand))
        self._poses.append(rows)
        if len(self._poses) >= TOGETHER and len(self._poses[-TOGETHER]) < TOGETHER:
            loose = [self._poses.pop() for _ in range(TOGETHER)]
            self._poses.append(trajectory.join(reversed(loose), self.hand))
        while self._poses and self._poses[0].t[-1] < rows.t[-1] - PAST_POSES:
            self._poses.popleft()
        return rows

    def _doubted(self, rows: Trajectory) -> Trajectory:
        """The rows with what is known of their sensors since the calibration."""
        return replace(rows, flags=rows.flags | self._doubts) if self._doubts.any() else rows

    def _begin(self, calibration: Calibration) -> None:
        self.calibration = calibration
        self._trail.begin(calibration)
        self._state = self.method.start(self.params, calibration, self._streams())
        self._poses.clear()
        self._catch_up(dict.fromkeys(self._samples, float(np.nextafter(calibration.t, -np.inf))))

    def _catch_up(self, seen: Mapping[str, float]) -> None:
        """Step through what was sampled later than that (s by stream)."""
        first = {name: np.nextafter(t, np.inf) for name, t in seen.items()}
        later = [
            join(list(blocks)).between(first.get(name, -np.inf), np.inf)
            for name, blocks in self._samples.items()
            if blocks
        ]
        if any(
            len(b.t) for b in later
        ):  # one block a stream: thousands of small steps would take seconds, and the queue run over
            self._step([b for b in later if len(b.t)])

    def _step(self, blocks: Sequence[Block]) -> None:
        """Of what was kept; a failure is the caller's."""
        pieces = []
        for block in blocks:
            self._state, piece = self.method.step(self.params, self._state, block)
            pieces.append(piece)
        self._state, late = self.method.release(self.params, self._state, self._patience)
        self._kept([*pieces, late])

    def _streams(self) -> tuple[Any, ...]:
        return tuple(blocks[-1].stream for blocks in self._samples.values() if blocks)

    def _remember(self, block: Block) -> None:
        kept = self._samples.setdefault(block.stream.name, deque())
        if kept and kept[-1].stream != block.stream:
            kept.clear()
        kept.append(block)
        if len(kept) >= BESIDE and all(len(kept[-k].t) < BESIDE for k in range(1, BESIDE + 1)):
            loose = [kept.pop() for _ in range(BESIDE)]
            kept.append(join(loose[::-1]))
        while kept[0].t[-1] < block.t[-1] - PAST_SAMPLES:
            kept.popleft()


def rest_after(took: float, computed: float) -> float:
    """How long (s) nothing more is wanted after blocks that it took so long to step, of which it computed only a part.

    Until they are stepped, and then as long again as others had the machine: where much waits for its turn, fewer and larger steps cost all of them less.
    The two clocks are read one after the other: of a moment it may have computed longer than it took.
    """
    return min(LONGEST_REST, max(0.0, took + (took - computed)))


def doubts(
    calibration: Calibration, findings: Sequence[Finding], magnetometer: bool
) -> NDArray[np.uint8]:
    """The Flags (segments,) that a batch run gives a segment of which this is known: a sensor at fault, or nothing calibrated."""
    flags = np.zeros(len(SEGMENTS), np.uint8)
    for finding in findings:
        if (
            finding.severity == "fault"
            and finding.sensor in SEGMENT
            and (finding.kind != "magnetometer" or magnetometer)
        ):
            flags[SEGMENT[finding.sensor]] |= np.uint8(Flag.FAULTY)
    for segment in calibration.q_BS if calibration.source == "none" else ():
        flags[SEGMENT[segment]] |= np.uint8(Flag.UNCALIBRATED)
    return flags
