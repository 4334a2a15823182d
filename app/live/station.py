"""A live station: one glove, one patient's session, one scene, led by the wizard.

glove thread:    bytes that a process of its own has recorded are decoded, handed to the tracker; the more others compute, the more of them together
tracker thread:  newest pose -> curve, notice to viewers, scene (in a process of its own)
station thread:  facts -> wizard -> orders, ghost, notice to viewers, 10 times a second
requests:        `act` leaves a person's wish, `snapshot` tells where things stand
"""

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from handscope.app.devices.glove import Glove
from handscope.app.live import ghost, trial_events
from handscope.app.live.calibration_movements import MeasuredSteps
from handscope.app.live.free_movement import FreeMovement
from handscope.app.live.readouts.bending_finger import MOVES, bends
from handscope.app.live.readouts.grasp_estimate import HeldSoFar
from handscope.app.live.readouts.hand_position import Whereabouts
from handscope.app.live.setup import Setup
from handscope.app.live.snapshot import beat, tell
from handscope.app.live.tracking import Tracking
from handscope.app.live.viewers import Viewers
from handscope.app.live.wizard import machine as wizard_machine
from handscope.app.live.wizard.machine import Act, Facts, NotNowError, Order, State, Wizard
from handscope.app.results.quantity_curve import Curve
from handscope.app.scene.scene_process import SceneApart
from handscope.app.version import software_version
from handscope.estimators.alignment import quality as alignment_quality
from handscope.estimators.alignment.initial_pose import DEG, THERAPIST, Pose
from handscope.estimators.alignment.quality import JointQuality
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import Block, Event
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT
from handscope.estimators.hand.geometry import table_of
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.movements.task_performance import POSE_THUMB
from handscope.sessions.wire.messages import Cue

log = logging.getLogger(__name__)
TICK = 0.1  # s
TRAIL, MOVED = 2.0, 0.03  # s of the hand's path that are drawn, once it went so far (m)
DRAWN = (
    1 / 60
)  # s, least time between two pictures of the scene; more where blocks wait long for the tracker
FLOWING = 0.5  # s without a sample that count as silence
FINGER_LEAD = 2.5  # s in which the finger before has come to rest
WIGGLE = 10.0  # s that bending one finger after the other takes
THUMB = (POSE_THUMB[0] * DEG, POSE_THUMB[1] * DEG, POSE_THUMB[2] * DEG)


class Station:
    """A context manager; leaving it ends the recording. `on_finish` is called once, when the wizard says that the session is over."""

    kind: Literal["live"] = "live"

    def __init__(self, name: str, setup: Setup, on_finish: Callable[["Station"], None]) -> None:
        self.name, self.setup = name, setup
        self.scene = SceneApart(setup.hand, setup.geometry)
        self.curve = Curve()
        self.latest: Trajectory | None = None  # the newest row
        self._drawing = threading.Lock()
        self._shown: Trajectory | None = None  # what the scene was given last
        self._drawn = -np.inf  # host's clock then
        self.attempt_numbers = 0
        self._on_finish = on_finish
        self._lock = threading.RLock()
        self._wizard = Wizard(setup.protocols, setup.params.pose_duration, setup.steps, setup.free)
        self._calibration: Calibration | None = None
        self._viewers = Viewers()
        self._told: tuple[int, dict[str, Any]] = (0, {})  # of the last tick
        self._stop = threading.Event()
        self._problem = ""
        self._replaced = (
            0  # times that another glove had been plugged in when the newest calibration was made
        )
        self.faults: list[str] = []  # of sensors, found by the check
        self.exchanged: dict[str, str] = {}  # strips that are on another finger than they say
        self._wiggled = (
            -np.inf
        )  # host's clock when a virtual patient was told last to bend one finger after the other
        self._known = Facts(time.monotonic(), -np.inf, False, 0.0, "", frozenset())
        about = {
            "hand": setup.hand,
            "geometry": table_of(setup.geometry),
            "software": software_version(),
            "port": setup.port,
            **setup.about,
        }
        self.tracking = Tracking(
            setup.method, setup.params, setup.hand, setup.geometry, self._posed
        )
        self.whereabouts = Whereabouts()
        self.held = HeldSoFar(self.tracking)
        self.glove = Glove(setup.port, setup.recording, about, self._fed)
        self.steps = MeasuredSteps(self.glove, self.tracking, self._number)
        self.free = FreeMovement(self.glove, self.tracking, self._number, setup.keep_found)

    def __enter__(self) -> "Station":
        self.scene.measured(())
        self.scene.__enter__()
        self.tracking.__enter__()
        self.glove.__enter__()
        self._thread = threading.Thread(target=self._run, name=f"station {self.name}", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        if threading.current_thread() is not self._thread:
            self._thread.join(5.0)
        self.free.close()
        self.glove.__exit__(None, None, None)
        self.tracking.__exit__()
        self.scene.close()
        self._viewers.notify()

    @property
    def ended(self) -> bool:
        return self._stop.is_set()

    def act(
        self,
        what: str,
        task: str = "",
        reason: str = "",
        group: str = "",
        value: float | None = None,
    ) -> None:
        """A person's wish; InputError where it cannot be done now."""
        try:
            wish = Act(what)
        except ValueError:
            raise InputError(
                f"there is no action {what!r}; actions are {', '.join(a for a in Act if a in wizard_machine.BY_PERSON)}"
            ) from None
        with self._lock:
            facts = self._now()
            try:
                self._wizard, orders = wizard_machine.act(
                    self._wizard, wish, facts, task, reason, group, value
                )
            except NotNowError as refusal:
                raise InputError(str(refusal)) from None
            self._do(orders, facts)
            self._tell(facts)
        self._viewers.notify()

    def snapshot(self) -> dict[str, Any]:
        """Where the session stands, for a page."""
        with self._lock:
            return tell(self, self._wizard, self._now(), self._calibration, self._problem)

    def news(self) -> tuple[int, dict[str, Any]]:
        """The snapshot of the last tick or action with its number: whoever tells viewers waits for no tick."""
        return (-1, self.snapshot()) if self.ended else self._told

    @property
    def changes(self) -> int:
        """Another number where a pulse may differ."""
        return self._viewers.changes

    def pulse(self, since: float) -> dict[str, Any]:
        """What changes with every pose: angles, the curve's points later than `since`, the age of the newest row."""
        return beat(self, since)

    def watch(self, notice: Callable[[], object]) -> Callable[[], None]:
        """Have `notice` called (from any thread) whenever there is something new; gives back how to stop that."""
        with self._lock:
            leave = self._viewers.add(notice)
            self._tell(self._now())
        return leave

    def _tell(self, facts: Facts) -> None:
        """Write down for viewers where things stand."""
        if self._viewers:
            self._told = (
                self._told[0] + 1,
                tell(self, self._wizard, facts, self._calibration, self._problem),
            )

    def _run(self) -> None:
        while not self._stop.wait(TICK):
            try:
                with self._lock:
                    self._known = facts = self._facts()
                    self._wizard, orders = wizard_machine.tick(self._wizard, facts)
                    self._do(orders, facts)
                    self._move_freely(facts)
                    self._wiggle(facts)
                    with self.scene.picture():
                        self._draw(facts)
                        self._place()
                    if self._wizard.state is State.TASK_RUN:
                        self.held.follow(str(self._wizard.task), self._wizard.onset)
                    self._tell(facts)
                    if time.monotonic() - self._drawn > TICK:
                        self._draw_hand()
            except Exception:  # one bad tick must not end a session that records
                log.exception("station %s", self.name)
            self._viewers.notify()

    def _fed(self, blocks: list[Block]) -> None:
        """In the glove's thread: what comes next is read once the tracker wants more; until then the pipe keeps it."""
        self.whereabouts.feed(blocks)
        time.sleep(self.tracking.feed(blocks))

    def _place(self) -> None:
        """Where the hand is, seen from the trunk, and what its fingertips push with."""
        a = self.glove.assembler
        self.whereabouts.follow(a.plate, list(a.streams.values()), a.mounting)
        if (at := self.whereabouts.latest) is not None:
            self.scene.place(at.place[0], at.sd[0], bool(at.flags[0]))
        self.scene.forces(
            self.held.pushes(self._wizard.task if self._wizard.state is State.TASK_RUN else None)
        )

    def _posed(self, rows: Trajectory) -> None:
        """In the tracker's thread: remember the curve, tell of the newest pose, draw it."""
        self.latest = rows
        self.curve.add(rows)
        self._viewers.notify()
        if time.monotonic() - self._drawn >= max(DRAWN, 2 * self.tracking.rest):
            self._draw_hand()

    def _draw_hand(self) -> None:
        """The newest pose; a tick draws the last one, which no other follows."""
        with self._drawing:
            rows = self.latest
            if rows is not None and rows is not self._shown:
                self._drawn, self._shown = time.monotonic(), rows
                with self.scene.picture():
                    self.scene.show(rows.angles[-1], rows.q_GS[-1, SEGMENT["hand"]])
                    if self._viewers:  # following the hand costs a fifth of tracking it
                        self.scene.trail(self._trail())

    def _trail(self) -> Array:
        """The hand's path of the last seconds, where it went anywhere."""
        places = self.tracking.trail(TRAIL)
        return places if len(places) and np.ptp(places, axis=0).max() > MOVED else places[:0]

    def _now(self) -> Facts:
        """The facts of the last tick at this moment: looking at every sensor again for every viewer would cost a core."""
        return replace(self._known, now=time.monotonic(), t=self.tracking.newest_sample())

    def _facts(self) -> Facts:
        motion = self.tracking.motion()
        newest = self.tracking.newest_sample()
        now = self.glove.now()
        fresh = {s: m for s, m in motion.items() if m.seen > newest - FLOWING and s in SEGMENT}
        worst = max(fresh, key=lambda s: fresh[s].rate, default="")
        flowing = (
            bool(fresh) and now is not None and now - newest < FLOWING and not self._contradiction()
        )
        felt = {
            p for s in self.glove.assembler.streams.values() for p in s.sensors if p not in SEGMENT
        }
        kept = self.glove.state.state != "recording_failed"
        rate, measured = fresh[worst].rate if worst else 0.0, frozenset(fresh) | felt
        return Facts(time.monotonic(), newest, flowing, rate, worst, measured, bends(fresh), kept)

    def _contradiction(self) -> str:
        identity = self.glove.assembler.identity
        if identity is not None and identity.hand is not None and identity.hand != self.setup.hand:
            return f"This is a {identity.hand} glove, the session is of the {self.setup.hand} hand. Connect the {self.setup.hand} glove or end the session."
        return ""

    def _stranger(self) -> str:
        """Said from when another glove is plugged in until it is calibrated, too."""
        if self.glove.assembler.replaced == self._replaced:
            return ""
        return (
            "Another glove was plugged in. Take the initial pose again, or plug the first one in."
        )

    def _do(self, orders: Sequence[Order], facts: Facts) -> None:
        if (w := self._wizard).state in (
            *wizard_machine.RUNNING,
            State.TASK_PAUSED,
            State.TASK_REVIEW,
            State.STEP_REVIEW,
        ):
            self.curve.attempt(
                w.onset, np.inf if w.state in wizard_machine.RUNNING else w.end, w.pauses
            )
        for order in orders:
            if order.kind == "cue":
                self._cue(order.task)
            elif order.kind == "calibrate":
                self._calibrate(order)
            elif order.kind == "cue_finger":
                self.glove.send(Cue("wiggle", {"finger": order.task, "lead": f"{FINGER_LEAD:g}"}))
            elif order.kind == "look":
                threading.Thread(
                    target=self._look, name=f"sensors {self.name}", daemon=True
                ).start()
            elif order.kind == "exchange":
                self._exchange(dict(order.worn_on))
            elif order.kind == "guess":
                self._guess(facts)
            elif order.kind == "drop_pose":
                self._drop_pose()
            elif order.kind == "keep_attempt":
                self._keep(order)
            elif order.kind == "measure_step":
                self._wizard = wizard_machine.judge(
                    self._wizard, self.steps.measure(order).problems
                )
            elif order.kind in ("drop_step", "drop_steps"):
                self.steps.drop(order.task)
            elif order.kind == "use_steps":
                self.steps.use()
            elif order.kind.endswith("_free"):
                self.free.do(order)
            elif order.kind == "finish":
                threading.Thread(target=self._on_finish, args=(self,), daemon=True).start()

    def _move_freely(self, facts: Facts) -> None:
        """Look at free movement, and whether what is computed of it is there."""
        self.free.watch()
        if self.free.solved():
            refusal = self.free.settle()
            self._wizard = (
                wizard_machine.unsolved(self._wizard, facts, refusal)
                if refusal
                else wizard_machine.solved(self._wizard, facts)
            )

    def _wiggle(self, facts: Facts) -> None:
        """While sensors are checked, a virtual patient does what the page asks for."""
        if (
            self._wizard.state is State.CONNECT
            and facts.flowing
            and facts.now - self._wiggled > WIGGLE
        ):
            self._wiggled = facts.now
            self._cue("wiggle")

    def _cue(self, task: str) -> None:
        protocol = next(
            (
                p
                for p in (*self.setup.protocols, *self.setup.steps, self.setup.free)
                if p and p.name == task
            ),
            None,
        )
        self.curve.follow(protocol.curve if protocol else None)
        name, details = (
            (protocol.cue, {"lead": f"{protocol.countdown:g}", **protocol.cue_details})
            if protocol
            else (task, {})
        )
        if name:
            self.glove.send(Cue(name, details))

    def _calibrate(self, order: Order) -> None:
        """Compute off the tick: combining a pose with the steps of a functional calibration takes seconds."""
        pose = Pose(order.onset, order.end - order.onset, THUMB, self._wizard.passive)
        self.tracking.mounting = self.glove.assembler.mounting
        self.tracking.known = self.free.known(self.setup.known, self.setup.known_glove)
        threading.Thread(
            target=self._computed, args=(pose,), name=f"calibration {self.name}", daemon=True
        ).start()

    def _computed(self, pose: Pose) -> None:
        """In a thread of its own: the pose's calibration, or why there is none."""
        calibration, refusal = None, ""
        try:
            calibration = self.tracking.calibrate(pose)
        except InputError as problem:
            refusal = str(problem)
        except Exception:  # the wizard must not wait for ever
            log.exception("station %s", self.name)
            refusal = "the calibration could not be computed; take the pose again"
        with self._lock:
            facts = self._now()
            if self.ended:
                return
            if calibration is None:
                self._wizard = wizard_machine.refused(self._wizard, facts, refusal)
            else:
                self._calibration, self._replaced = calibration, self.glove.assembler.replaced
                self._keep_pose(pose)
                self.scene.measured(alignment_quality.measured_fingers(calibration))
                poor = sum(j.grade == "poor" for j in self.joints())
                self._wizard, orders = wizard_machine.posed(
                    self._wizard, facts, poor, self.tracking.swapped()
                )
                self._do(orders, facts)
        self._viewers.notify()

    def _keep_pose(self, pose: Pose) -> None:
        self.attempt_numbers += 1
        details: dict[str, Any] = {
            f"thumb_cmc_{name}_deg": value
            for name, value in zip(("flexion", "deviation", "pronation"), POSE_THUMB)
        }
        if pose.passive:
            details["held_by"] = THERAPIST
        self.glove.keep_event(
            f"pose-{self.attempt_numbers}",
            Event(pose.onset, pose.duration, "initial_pose", details),
        )
        self.scene.face_ahead()

    def _guess(self, facts: Facts) -> None:
        """Nobody could calibrate: defaults, and the recording says so."""
        self.tracking.mounting = self.glove.assembler.mounting
        try:
            self._calibration = c = self.tracking.guess()
        except InputError as problem:
            self._wizard = wizard_machine.refused(self._wizard, facts, str(problem))
            return
        self.attempt_numbers += 1
        self.glove.keep_event(
            f"pose-{self.attempt_numbers}",
            Event(c.t, c.end - c.t, "annotation", {"calibration": "none"}),
        )
        self.scene.face_ahead()
        self.scene.measured(alignment_quality.measured_fingers(c))

    def _look(self) -> None:
        """In a thread of its own: sensors that stood still while others moved."""
        self.faults = [f.said for f in self.tracking.faults()]
        self._viewers.notify()

    def _exchange(self, to: Mapping[str, str]) -> None:
        """Strips are on each other's fingers: read so from now on, and in the recording from its beginning."""
        worn_on = {
            f: to.get(on, on) for f, on in {**{f: f for f in FINGERS}, **self.exchanged}.items()
        }
        self.exchanged = {f: on for f, on in worn_on.items() if f != on}
        self._calibration = None
        self.steps.forget()
        self.free.forget()
        self.glove.exchange(self.exchanged, self.tracking.restart)

    def _drop_pose(self) -> None:
        """The newest pose is not to count: the one before it does again."""
        self.glove.keep_event(f"pose-{self.attempt_numbers}", None)
        self._calibration = self.tracking.take_back()
        self.scene.face_ahead()

    def joints(self) -> list[JointQuality]:
        """How good the calibration in force is for each joint; empty before the first."""
        faulty = {f.sensor for f in self.tracking.findings if f.severity == "fault"}
        return alignment_quality.of_joints(self._calibration, faulty) if self._calibration else []

    def _number(self) -> int:
        """Of an attempt that is kept, from 1 on."""
        self.attempt_numbers += 1
        return self.attempt_numbers

    def _keep(self, order: Order) -> None:
        number, trial = self._number(), self._wizard.accepted(order.task)
        protocol = next((p for p in self.setup.protocols if p.name == order.task), None)
        for name, event in trial_events.events(
            order, protocol, trial, self.tracking.newest_sample(), self.setup.worn
        ):
            self.glove.keep_event(name.format(number), event)

    def _draw(self, facts: Facts) -> None:
        """Ghost, lit segment and caption of the state."""
        self._problem = self._contradiction() or self._stranger()
        w = self._wizard
        self.scene.ghost(ghost.ghost(w, THUMB, facts.now - w.since))
        checking = w.state in (State.CONNECT, State.CHECK) and facts.wander > MOVES
        self.scene.highlight(facts.restless if checking else None)
        if w.state in (State.CONNECT, State.CHECK, State.CHECKED):
            self.scene.measured([f for f in FINGERS if set(CHAINS[f]) <= facts.measured])
