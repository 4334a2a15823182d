"""The tracker of a live station: it takes blocks from the glove's thread and steps the method in its own thread.

Nothing here can delay the recording: the queue is bounded; when it is full, the oldest blocks are skipped and counted.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handscope.app.devices.strip_progress import StripProgress
from handscope.app.live import measured_pose
from handscope.app.live.readouts.hand_trail import HandTrail
from handscope.app.live.readouts.motion import Motion, latest, motions
from handscope.app.workers.turns import Share, Turns
from handscope.estimators.alignment import (
    functional_calibration,
    functional_movements,
    initial_pose,
    mounting_checks,
    repeated_pose,
)
from handscope.estimators.alignment.functional_movements import CalibrationMovement
from handscope.estimators.alignment.initial_pose import Pose
from handscope.estimators.alignment.repeated_pose import TakenPose, extend_row
from handscope.estimators.data import trajectory
from handscope.estimators.data.calibration import Calibration, CalibrationSource, PriorCalibration
from handscope.estimators.data.findings import Finding
from handscope.estimators.data.held_contact import HeldContact
from handscope.estimators.data.samples import ORIENTATION, Block, join, join_consecutive
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation.given_orientations import (
    GivenParams,
    LiveRates,
    rate_orientations,
    require_rates,
)
from handscope.estimators.pipeline.contacts import contact_messages
from handscope.estimators.pipeline.coupled_segments import coupled_segments
from handscope.estimators.pipeline.flags import is_fault
from handscope.estimators.pipeline.method import (
    Capabilities,
    Method,
    notices_mounting_changes,
    uses_contacts,
)
from handscope.estimators.pipeline.mounting_changes import of_change
from handscope.estimators.pipeline.recording_calibration import with_known
from handscope.estimators.sensors import fault_detection

log = logging.getLogger(__name__)
# blocks, a minute of 7 streams at 10 ms, which computing a calibration may take while other work, such as translating the estimators, keeps the
# cores; older ones are skipped, and headings are lost with them
QUEUE = 42_000
PAST_SAMPLES = 90.0  # s of raw samples, for a pose or a calibration movement that just ended
PAST_POSES = PAST_SAMPLES  # s of trajectory: poses are read together with their samples
# trajectories joined into one: few large arrays need less memory and garbage collection
JOINED_POSES = 128
JOINED_BLOCKS = 16  # small blocks joined into one: the last second is read ten times a second
ORIENTATION_WAIT = 0.1  # s in which the hand's orientation is searched
GUESSED_FROM = 1.0  # s of samples that gravity is read from where nothing is calibrated
MAX_FAILURES = 3  # failures in a row until the method starts again from the calibration
PATIENCE = 0.1  # s of waiting for a silent strip


@dataclass(frozen=True)
class _PreviousCalibration:
    """The tracker's state before the newest calibration."""

    seen: Mapping[str, float]  # s, newest sample in the state, by stream
    calibration: Calibration | None
    state: Any
    findings: tuple[Finding, ...]
    segment_flags: NDArray[np.uint8]


class Tracking:
    """A context manager that owns the estimator's thread."""

    def __init__(
        self,
        method: Method[Any, Any],
        params: Any,
        hand: Hand,
        geometry: HandGeometry,
        on_pose: Callable[[Trajectory], None],
        patience: float = PATIENCE,
        on_samples: Callable[[], None] = lambda: None,
        share: Share | None = None,
    ) -> None:
        """`on_pose` gets every new row; `on_samples` is called for samples without one: nothing is calibrated. `share`: with other stations of the process."""
        self._patience = patience
        self._share = share or Turns().share()
        self.method, self.params, self.hand, self.geometry = method, params, hand, geometry
        self.skipped = 0  # blocks that the live view skipped; the recording has them
        self.rest = 0.0  # s for which the tracker takes no more blocks
        self.spent = 0.0  # s of processor time
        self.failures = 0  # of the method, each followed by a new start
        self._failed_since = 0  # failures in a row
        self.calibration: Calibration | None = None
        self.mounting: Mapping[str, Array] = {}
        # by step of a functional calibration; every later pose is combined with them
        self.movements: Mapping[str, CalibrationMovement] = {}
        # an earlier self-calibration, used by every later pose
        self.prior: PriorCalibration | None = None
        self.findings: tuple[Finding, ...] = ()  # of the sensors, from the newest check
        self._segment_flags = np.zeros(len(SEGMENTS), np.uint8)  # until the next calibration
        self._previous: _PreviousCalibration | None = None
        self._on_pose, self._on_samples = on_pose, on_samples
        self._row: list[TakenPose] = []  # poses taken one after the other
        self._queue: deque[Block] = deque()
        self._progress = StripProgress(patience)
        self._is_complete = False  # whether what waits completes a row
        self._wake = threading.Condition()
        self._stop = False
        self._lock = threading.RLock()  # state, past samples and past poses
        self._state: Any = None
        self._samples: dict[str, deque[Block]] = {}
        self._rates = LiveRates()
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
        self._share.leave()

    def feed(self, blocks: list[Block]) -> float:
        """Take blocks from the glove's thread; never waits. Returns for how long (s) it takes no more."""
        with self._wake:
            self._queue.extend(blocks)
            while len(self._queue) > QUEUE:
                self._queue.popleft()
                self.skipped += 1
            if self._progress.take(blocks):
                self._is_complete = True
                self._wake.notify()
        return self.rest

    def calibrate(self, pose: Pose) -> Calibration:
        """Start the method from the pose that just ended, and catch up; InputError for an unusable pose."""
        window = self.samples(-np.inf)
        require_rates([b.stream for b in window])
        once = initial_pose.calibrate(
            self.params, self.hand, self.geometry, self.mounting, window, pose
        )
        row = extend_row(self._row, TakenPose(pose, once))
        calibration = repeated_pose.average([taken.calibration for taken in row])
        if self.movements:
            calibration = functional_calibration.combine(
                self.params, self.movements, calibration, self.mounting
            )
        if self.prior is not None:
            subtracts = self.method.CAPABILITIES.subtracts_acc_bias
            calibration = with_known(calibration, self.prior, subtracts)
        if isinstance(self.params, GivenParams):
            (calibration,), whose = rate_orientations(self.params, [calibration])
            calibration = replace(calibration, warnings=(*calibration.warnings, *whose))
        calibration = self._add_findings(calibration, window, pose)
        self._row = row
        self._replace_calibration(calibration)
        return calibration

    def guess(self) -> Calibration:
        """Start the method from defaults; every segment is flagged as uncalibrated. InputError without the hand's sensor."""
        calibration = initial_pose.guess_calibration(
            self.params,
            self.hand,
            self.geometry,
            self.mounting,
            self.samples(self.newest_sample() - GUESSED_FROM),
        )
        self.findings = ()
        self._replace_calibration(calibration)
        return calibration

    def restore_previous(self) -> Calibration | None:
        """Go back to the calibration before the newest, and to the method's state of that time."""
        before, self._previous = self._previous, None
        self._row = self._row[:-1]
        with self._lock:
            if before is None or before.calibration is None:
                self.calibration, self._state = None, None
                self._trail.begin(None)
                return None
            self.calibration, self._state, self.findings, self._segment_flags = (
                before.calibration,
                before.state,
                before.findings,
                before.segment_flags,
            )
            self._trail.begin(before.calibration)
            self._poses.clear()
            self._catch_up(before.seen)
            return self.calibration

    def faults(self) -> tuple[Finding, ...]:
        """Faults of single sensors that the buffered samples show without a pose."""
        return tuple(
            f
            for f in fault_detection.check(measured(self.samples(-np.inf)), (0.0, 0.0))
            if f.kind in ("dead_axis", "stuck")
        )

    def swapped(self) -> tuple[str, str] | None:
        """Two fingers whose strips are exchanged, as the pose shows."""
        fingers = list(
            dict.fromkeys(
                f.sensor.split("_")[0]
                for f in self.findings
                if f.kind == "swapped" and f.severity == "fault"
            )
        )
        return (fingers[0], fingers[1]) if len(fingers) == 2 else None

    def _replace_calibration(self, calibration: Calibration) -> None:
        with self._lock:
            seen = {
                name: float(blocks[-1].t[-1]) for name, blocks in self._samples.items() if blocks
            }
            self._previous = _PreviousCalibration(
                seen, self.calibration, self._state, self.findings, self._segment_flags
            )
            self._segment_flags = segment_flags(
                calibration, self.findings, self.method.CAPABILITIES
            )
            self._begin(calibration)

    def measure(self, step: str, onset: float, end: float) -> CalibrationMovement:
        """Evaluate the calibration movement that just ended; gyroscope biases are those of the pose."""
        bias = self.calibration.gyr_bias if self.calibration else {}
        return functional_movements.measure(
            self.params, step, self.samples(onset), onset, end, bias
        )

    def samples(self, onset: float) -> list[Block]:
        """Buffered samples from `onset` s on, one block a stream."""
        with self._lock:
            recent = [
                list(takewhile(lambda b: b.t[-1] >= onset, reversed(blocks)))[::-1]
                for blocks in self._samples.values()
            ]
        return [join(blocks).between(onset, np.inf) for blocks in recent if blocks]

    def _add_findings(
        self, calibration: Calibration, window: list[Block], pose: Pose
    ) -> Calibration:
        """The calibration with the sensors' faults among its warnings."""
        still = initial_pose.calibrated_part(pose, calibration)
        # the whole window: sensors that stood still while others moved
        findings = fault_detection.check(measured(window), (calibration.t, calibration.end))
        broken = {f.sensor for f in findings if f.severity == "fault"}
        # alignment that movements have estimated
        mounting = {**self.mounting, **{s: calibration.q_BS[s] for s in calibration.q_BS_sd}}
        findings += [
            f for f in mounting_checks.check(window, mounting, still, ()) if f.sensor not in broken
        ]
        self.findings = tuple(findings)
        warnings = [*calibration.warnings, *(f.message for f in findings)]
        warnings += measured_pose.questions(calibration)
        return replace(calibration, warnings=tuple(dict.fromkeys(warnings)))

    def restart(self) -> None:
        """Drop every sample and calibration: new samples are read for other fingers."""
        with self._wake:
            self._queue.clear()
        with self._lock:
            self._samples.clear()
            self._rates = LiveRates()
            self._poses.clear()
            self._trail.begin(None)
            self.calibration, self._state, self._previous, self.movements, self.prior = (
                None,
                None,
                None,
                {},
                None,
            )
            self.findings, self._segment_flags = (), np.zeros(len(SEGMENTS), np.uint8)

    def begin(self, calibration: Calibration) -> None:
        """Start from an existing calibration."""
        with self._lock:
            self._begin(calibration)

    def turned(self) -> tuple[Suspicion, ...]:
        """Sensors that the method has found to turn on their segments since the newest calibration."""
        method, state = self.method, self._state
        if state is None or not notices_mounting_changes(method):
            return ()
        return tuple(of_change(c) for c in method.mounting_changes(state))

    def use_contacts(self, held: Sequence[HeldContact]) -> bool:
        """Begin again at the calibration with contacts that were held since; False where its samples are no longer kept, or the method makes nothing of them."""
        with self._lock:
            calibration = self.calibration
            if not held or calibration is None or not uses_contacts(self.method):
                return False
            oldest = max(b[0].t[0] for b in self._samples.values() if b)
            if not calibration.source.is_pose or oldest > calibration.t:
                return False
            every = sorted((*calibration.contacts, *held), key=lambda h: h.onset)
            self._begin(replace(calibration, contacts=tuple(every)))
            return True

    def noticed(self) -> tuple[Suspicion, ...]:
        """What the method itself says of sensors and contacts since the newest calibration."""
        return (*self.turned(), *self.contacts())

    def contacts(self) -> tuple[Suspicion, ...]:
        """What became of the contacts that were held since the newest calibration."""
        method, state = self.method, self._state
        if state is None or not uses_contacts(method):
            return ()
        return tuple(
            Suspicion(message, (), (), 1.0)
            for message in contact_messages(method.contact_outcomes(state))
        )

    def motion(self) -> dict[str, Motion]:
        """Movement of each sensor in the last second, by segment."""
        return {segment: m for block in self.recent(1.0) for segment, m in motions(block).items()}

    def recent(self, seconds: float) -> list[Block]:
        """The last seconds of every inertial stream, one block a stream."""
        with self._lock:  # the method waits for this lock: only collect the blocks
            recent = [latest(blocks, seconds) for blocks in self._samples.values()]
        return [
            join(blocks).between(blocks[-1].t[-1] - seconds, np.inf) for blocks in recent if blocks
        ]

    def newest_sample(self) -> float:
        """Time of the newest sample of any stream, s; -inf before the first."""
        with self._lock:
            return max(
                (float(blocks[-1].t[-1]) for blocks in self._samples.values() if blocks),
                default=-np.inf,
            )

    def past(self, start: float, stop: float = np.inf) -> Trajectory:
        """The trajectory between two instants, as it was shown."""
        with self._lock:
            late = takewhile(lambda p: not len(p) or p.t[-1] >= start, reversed(self._poses))
            pieces = [p for p in late if len(p) and p.t[0] < stop][::-1]
        return trajectory.join(pieces, self.hand).between(start, stop)

    def trail(self, seconds: float) -> Array:
        """Path of the hand in the last seconds (n, 3) m in the global frame, relative to its place now; oldest first."""
        with self._lock:
            hand = next(
                (
                    b
                    for b in self._samples.values()
                    if b and b[-1].stream.inertial and "hand" in b[-1].stream.sensors
                ),
                (),
            )
            self._trail.follow(hand, self._hand_orientation)
            return self._trail.places(seconds)

    def _hand_orientation(self, t: float) -> Array | None:
        """q_GH (4,) of the hand at an instant as it was shown; None where unknown."""
        rows = self.past(t, t + ORIENTATION_WAIT)
        return (
            rows.q_GS[0, SEGMENT["hand"]]
            if len(rows) and np.isfinite(rows.q_GS[0, SEGMENT["hand"]]).all()
            else None
        )

    def drain(self) -> None:
        """Release what the method still holds back: no more samples will come."""
        with self._lock:
            if self._state is not None:
                self._process(join_consecutive(self._queue))
                self._queue.clear()
                self._state, rest = self.method.finish(self.params, self._state)
                rest = self._add_flags(rest)
                if len(rest):
                    self._poses.append(rest)
        if self._state is not None and len(rest):
            self._call(partial(self._on_pose, rest))

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._is_complete or self._stop, self._patience)
                if self._stop:
                    return
                waited = list(self._queue)
                self._queue.clear()
                self._is_complete = False
            if not waited:
                continue
            self.wait_until_free()
            with self._share.turn(first=True):
                computed = time.thread_time()
                with self._lock:
                    newest = self._process(join_consecutive(waited))
                if newest is not None:
                    self._call(partial(self._on_pose, newest))
                elif self._state is None:
                    self._call(self._on_samples)
                self.spent += time.thread_time() - computed
            self.rest = self._share.rest()

    def wait_until_free(self) -> None:
        """Before a turn: whoever computes for long, such as a calibration, has none."""
        with self._lock:
            pass

    def _call(self, notice: Callable[[], None]) -> None:
        """Pass on what is new; a failure there must not stop the method."""
        try:
            notice()
        except Exception:
            log.exception("a pose could not be shown")

    def _process(self, blocks: list[Block]) -> Trajectory | None:
        """Buffer and step blocks; a failed step loses the rows of its block and is counted."""
        if self.method.CAPABILITIES.takes_orientations:
            blocks = [d for b in blocks if (d := self._rates.derive(b)) is not None]
        for block in blocks:
            self._buffer(block)
        if self._state is None:
            return None
        faults: list[Exception] = []
        pieces = self._step_together(faults, blocks)
        pieces.append(self._step_or_keep_state(faults, self.method.release, self._patience))
        self.failures += len(faults)
        self._failed_since = self._failed_since + 1 if faults else 0
        if faults:
            # the first stands for all of these blocks
            log.error("the method failed and goes on from its state before", exc_info=faults[0])
        if self._failed_since > MAX_FAILURES:
            self._start_again()
        return self._store_poses(pieces)

    def _step_together(self, faults: list[Exception], blocks: list[Block]) -> list[Trajectory]:
        """The rows of blocks of several streams; where that fails, of each block that does not."""
        try:
            self._state, rows = self.method.step(self.params, self._state, *blocks)
        except Exception:
            step = self.method.step
            return [self._step_or_keep_state(faults, step, block) for block in blocks]
        return [rows]

    def _step_or_keep_state(
        self,
        faults: list[Exception],
        function: Callable[..., tuple[Any, Trajectory]],
        argument: Block | float,
    ) -> Trajectory:
        """The rows of one step; a failure is added to `faults` and leaves the state as it was."""
        try:
            self._state, rows = function(self.params, self._state, argument)
        except Exception as fault:  # any failure of a method must leave the station alive
            faults.append(fault)
            return trajectory.empty(self.hand)
        return rows

    def _start_again(self) -> None:
        """Start from the calibration again: the method fails from its last state."""
        assert self.calibration is not None
        try:
            self._state, self._failed_since = (
                self.method.start(self.params, self.calibration, self._streams()),
                0,
            )
        except Exception:
            log.exception("the method could not be started again")

    def _store_poses(self, pieces: Sequence[Trajectory]) -> Trajectory | None:
        """Join and store the rows; None where there are none."""
        if not any(len(p) for p in pieces):
            return None
        rows = self._add_flags(trajectory.join([p for p in pieces if len(p)], self.hand))
        self._poses.append(rows)
        if len(self._poses) >= JOINED_POSES and len(self._poses[-JOINED_POSES]) < JOINED_POSES:
            loose = [self._poses.pop() for _ in range(JOINED_POSES)]
            self._poses.append(trajectory.join(reversed(loose), self.hand))
        while self._poses and self._poses[0].t[-1] < rows.t[-1] - PAST_POSES:
            self._poses.popleft()
        return rows

    def _add_flags(self, rows: Trajectory) -> Trajectory:
        """The rows with the flags of their segments since the calibration."""
        return (
            replace(rows, flags=rows.flags | self._segment_flags)
            if self._segment_flags.any()
            else rows
        )

    def _begin(self, calibration: Calibration) -> None:
        self.calibration = calibration
        self._trail.begin(calibration)
        self._state = self.method.start(self.params, calibration, self._streams())
        self._poses.clear()
        self._catch_up(dict.fromkeys(self._samples, float(np.nextafter(calibration.t, -np.inf))))

    def _catch_up(self, seen: Mapping[str, float]) -> None:
        """Step through the samples later than `seen` (s by stream)."""
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
        """Step buffered blocks; errors go to the caller."""
        self._state, rows = self.method.step(self.params, self._state, *blocks)
        self._state, late = self.method.release(self.params, self._state, self._patience)
        self._store_poses([rows, late])

    def _streams(self) -> tuple[Any, ...]:
        return tuple(blocks[-1].stream for blocks in self._samples.values() if blocks)

    def _buffer(self, block: Block) -> None:
        blocks = self._samples.setdefault(block.stream.name, deque())
        if blocks and blocks[-1].stream != block.stream:
            blocks.clear()
        blocks.append(block)
        if len(blocks) >= JOINED_BLOCKS and all(
            len(blocks[-k].t) < JOINED_BLOCKS for k in range(1, JOINED_BLOCKS + 1)
        ):
            loose = [blocks.pop() for _ in range(JOINED_BLOCKS)]
            blocks.append(join(loose[::-1]))
        while blocks[0].t[-1] < block.t[-1] - PAST_SAMPLES:
            blocks.popleft()


def measured(blocks: Sequence[Block]) -> list[Block]:
    """The blocks whose values a sensor read and nobody derived."""
    return [b for b in blocks if ORIENTATION not in b.stream.quantities]


def segment_flags(
    calibration: Calibration, findings: Sequence[Finding], capabilities: Capabilities
) -> NDArray[np.uint8]:
    """Flags (segments,) as a batch run gives them: sensor at fault, or coupled with it, or not calibrated."""
    flags = np.zeros(len(SEGMENTS), np.uint8)
    for finding in findings:
        if is_fault(finding, capabilities.needs_magnetometers):
            flags[SEGMENT[finding.sensor]] |= np.uint8(Flag.FAULTY)
            if capabilities.couples_chains:
                coupled = [SEGMENT[s] for s in coupled_segments([finding.sensor])]
                flags[coupled] |= np.uint8(Flag.DOUBTFUL)
    for segment in calibration.q_BS if calibration.source is CalibrationSource.NONE else ():
        flags[SEGMENT[segment]] |= np.uint8(Flag.UNCALIBRATED)
    return flags
