"""A live station: one glove, one patient's session, one scene, led by the wizard.

glove thread:    a process of its own records the bytes; here they are decoded and given to the tracker, which may ask for a pause
tracker thread:  newest pose -> curve, notice to viewers, scene (in a process of its own)
station thread:  status -> wizard -> effects, ghost, notice to viewers, 10 times a second
requests:        `act` carries out a person's action, `snapshot` gives the state for a page
"""

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from handscope.app.devices.glove import Glove
from handscope.app.live import trial_events
from handscope.app.live.calibration_movements import CalibrationMovements
from handscope.app.live.free_movement import FreeMovement
from handscope.app.live.live_corrections import LiveCorrections
from handscope.app.live.measured_pose import MeasuredPose, bent_joints_asked
from handscope.app.live.outputs.choice import open_outlets
from handscope.app.live.outputs.outlets import Outlets
from handscope.app.live.readouts import pose_fit, worn_glove
from handscope.app.live.readouts.grasp_estimate import GraspEstimator
from handscope.app.live.readouts.hand_position import HandPositionReadout
from handscope.app.live.readouts.trial_review import TrialReview
from handscope.app.live.sensor_checks import SensorChecks
from handscope.app.live.setup import Setup
from handscope.app.live.snapshot import GloveView, StationView, station_pulse, station_snapshot
from handscope.app.live.station_scene import INCLINED_INTERVAL, PICTURE_INTERVAL, StationScene
from handscope.app.live.tracking import Tracking
from handscope.app.live.viewers import Viewers
from handscope.app.live.wizard import effects as wizard_effects
from handscope.app.live.wizard import machine as wizard_machine
from handscope.app.live.wizard.machine import Action, NotNowError, State, StationStatus, Wizard
from handscope.app.results.quantity_curve import Curve
from handscope.app.scene.camera.sides import Side
from handscope.app.scene.scene_process import SceneProcess
from handscope.app.workers.turns import Turns
from handscope.estimators.alignment import quality as alignment_quality
from handscope.estimators.alignment.initial_pose import Pose
from handscope.estimators.alignment.quality import JointQuality
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.held_contact import held_contacts
from handscope.estimators.data.samples import Block, Event
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.wire.messages import Cue

log = logging.getLogger(__name__)
TICK = 0.1  # s
FINGER_LEAD = 2.5  # s for the finger before to come to rest
WIGGLE = 10.0  # s that bending one finger after the other takes


class Station:
    """A context manager; leaving it ends the recording. `on_finish` is called once, when the wizard says that the session is over."""

    kind: Literal["live"] = "live"

    def __init__(
        self, name: str, setup: Setup, on_finish: Callable[["Station"], None], turns: Turns
    ) -> None:
        self.name, self.setup, self._share = name, setup, turns.share()
        self.scene = SceneProcess(setup.hand, setup.geometry)
        self.curve = Curve()
        self._attempts = 0
        self.measured_pose = MeasuredPose()
        self._on_finish = on_finish
        self._lock = threading.RLock()
        self._wizard = Wizard(
            *(setup.protocols, setup.params.pose_duration, setup.steps, setup.free),
            plan_title=setup.plan_title,
        )
        self._calibration: Calibration | None = None
        self._viewers = Viewers()
        self._pose_readers = Viewers()  # other programs
        self._published: tuple[int, dict[str, Any]] = (0, {})  # of the last tick
        self._stop = threading.Event()
        self._problem = ""
        self._calibrated_glove, self._glove_before = 0, 0  # number of gloves plugged in by then
        self.sensor_faults: list[str] = []  # found by the sensor check
        self._corrections = LiveCorrections(self._next_number)
        self.exchanged: dict[str, str] = {}  # finger of a strip -> finger that wears it
        self._wiggled_at = -np.inf  # s, host's clock, newest request to a virtual patient
        self._status = worn_glove.UNKNOWN  # of the last tick
        self.tracking = Tracking(
            *(setup.method, setup.params, setup.hand, setup.geometry, self._take_pose),
            on_samples=self._take_samples,
            share=self._share,
        )
        self._drawing = StationScene(
            self.scene, self.tracking, self._viewers, lambda: self.glove.assembler.mounting
        )
        self.checks = SensorChecks(
            *(self.tracking, setup.hand, setup.geometry, self._viewers.notify, turns.background)
        )
        self.hand_position = HandPositionReadout()
        self.trial = TrialReview(self.tracking, setup.geometry, setup.earlier)
        self.grasp = GraspEstimator(self.tracking)
        self.glove = Glove(
            *(setup.port, setup.recording, setup.metadata, self._feed), True, self._share.turn
        )
        self.outlets = Outlets(
            open_outlets(
                setup.outlets, setup.hand, str(setup.session), setup.method_name, self.glove.now
            )
        )
        self._marked = (State.CONNECT, "")  # state and task of the newest marker
        self.steps = CalibrationMovements(self.glove, self.tracking, self._next_number)
        self.free = FreeMovement(
            self.glove, self.tracking, self._next_number, setup.store_solution, setup.scheduler
        )

    def __enter__(self) -> "Station":
        with ExitStack() as opened:
            self._drawing.begin()
            self.scene.__enter__()
            opened.callback(self.scene.close)
            for part in (self.outlets, self.tracking, self.glove):
                opened.enter_context(part)
            self._opened = opened.pop_all()
        self._thread = threading.Thread(target=self._run, name=f"station {self.name}", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        if threading.current_thread() is not self._thread:
            self._thread.join(5.0)
        try:
            self.free.close()
            self._opened.close()
        finally:
            self._viewers.notify()
            self._pose_readers.notify()

    @property
    def ended(self) -> bool:
        return self._stop.is_set()

    @property
    def latest(self) -> Trajectory | None:
        """The newest row of the trajectory."""
        return self._drawing.newest

    def act(
        self,
        what: str,
        task: str = "",
        reason: str = "",
        group: str = "",
        value: float | None = None,
    ) -> None:
        """Carry out a person's action; InputError where it cannot be done now."""
        try:
            action = Action(what)
        except ValueError:
            raise InputError(
                "live.unknown_action",
                what=what,
                actions=", ".join(a for a in Action if a in wizard_machine.BY_PERSON),
            ) from None
        with self._lock:
            status = self._current_status()
            try:
                self._wizard, effects = wizard_machine.act(
                    self._wizard, action, status, task, reason, group, value
                )
            except NotNowError as refusal:
                raise InputError(str(refusal)) from None
            self._carry_out(effects, status)
            self._publish(status)
        self._viewers.notify()

    def look(self, side: Side | None, mirrored: bool | None = None) -> None:
        """Turn every viewer's picture to a side of the hand (None: fit), and mirror it or not."""
        if mirrored is None:
            self._drawing.look(side)
        else:
            self._drawing.mirror(mirrored)
        with self._lock:
            self._publish(self._current_status())
        self._viewers.notify()

    def replay_trial(self) -> None:
        """Show the trial under review once more in the scene; nothing where there is none."""
        if self.trial.rows is not None:
            self._drawing.replay(self.trial.rows)

    def snapshot(self) -> dict[str, Any]:
        """The state of the session, for a page."""
        with self._lock:
            return station_snapshot(self._view(self._current_status()))

    def news(self) -> tuple[int, dict[str, Any]]:
        """The snapshot of the last tick or action with its number; it waits for no tick."""
        return (-1, self.snapshot()) if self.ended else self._published

    @property
    def changes(self) -> int:
        """A counter that grows with everything that may change a pulse."""
        return self._viewers.changes

    def pulse(self, since: float) -> dict[str, Any]:
        """What changes with every pose: angles, points of the curve later than `since` s, age of the newest row."""
        return station_pulse(self.latest, self.curve, since, self.row_age())

    def watch(self, notice: Callable[[], object]) -> Callable[[], None]:
        """Call `notice` from any thread whenever something changed; returns a function that ends this."""
        with self._lock:
            leave = self._viewers.add(notice)
            self._publish(self._current_status())
        return leave

    def watch_poses(self, notice: Callable[[], object]) -> Callable[[], None]:
        """Call `notice` from the tracker's thread with every new pose; returns a function that ends this."""
        return self._pose_readers.add(notice)

    def _publish(self, status: StationStatus) -> None:
        """Store the snapshot that viewers get next; mark what changed for other programs."""
        if (now := (self._wizard.state, self._wizard.task or "")) != self._marked:
            self._marked = now
            self.outlets.send_marker(max(0.0, status.t), " ".join(filter(None, now)))
        if self._viewers:
            self._published = (self._published[0] + 1, station_snapshot(self._view(status)))

    def _view(self, status: StationStatus) -> StationView:
        """Everything that a snapshot shows, as it stands now."""
        w = self._wizard
        return StationView(
            name=self.name,
            setup=self.setup,
            wizard=w,
            status=status,
            glove=self._glove_view(),
            calibration=self._calibration,
            joints=self.joints(),
            movement=self.steps.movement_of(w.task) if w.state is State.STEP_REVIEW else None,
            self_calibration=self.free.to_json()
            if w.state in wizard_machine.MOVING_FREELY
            else None,
            curve_title=self.curve.title,
            curve_unit=self.curve.unit,
            curve_quantity=self.curve.what,
            curve_points=self.curve.attempted(),
            taps=self.trial.taps,
            hand_position=self.hand_position.to_json(),
            followed=self._drawing.followed,
            mirrored=self._drawing.mirrored,
            replaying=self._drawing.replaying,
            trial=self.trial.number,
            measured=self._drawing.measured,
            target=self._drawing.target,
            pose_fit=pose_fit.fit_rows(
                self.tracking, self.glove.assembler.mounting, self._drawing.pose
            )
            if w.state in (State.POSE_READY, State.POSE_HOLD)
            else [],
            task_number=self._task_number(),
            measured_pose=self.measured_pose,
            sensor_faults=self.sensor_faults,
            findings=(*self.tracking.noticed(), *self.checks.found),
            trackers=self.glove.trackers,
            ended=self.ended,
        )

    def _glove_view(self) -> GloveView:
        """The glove as a snapshot shows it."""
        a = self.glove.assembler
        return GloveView(
            state=self.glove.state,
            identity=a.identity,
            status=a.status,
            streams=dict(a.streams),
            counts={name: replace(count) for name, count in a.counts.copy().items()},
            losses=a.frame_losses,
            corrupt=a.counters.corrupt,
            decoding_failures=self.glove.decoding_failures,
            skipped=self.tracking.skipped,
            method_failures=self.tracking.failures,
            problem=self._problem,
            row_age_ms=self.row_age(),
        )

    def _task_number(self) -> dict[str, Any] | None:
        """The number estimated for the task: distance of the hand from the trunk, or what the hand holds."""
        protocol = self._wizard.protocol
        if protocol and protocol.group == "reach":
            return self.hand_position.number()
        return self.grasp.number_of(self._wizard.task)

    def row_age(self) -> float | None:
        """Age of the newest pose from its samples to now, ms."""
        now, latest = self.glove.now(), self.latest
        return (
            None if latest is None or now is None else round(1e3 * (now - float(latest.t[-1])), 1)
        )

    def _run(self) -> None:
        while not self._stop.wait(TICK):
            try:
                self.tracking.wait_until_free()
                with self._lock, self._share.turn():
                    self._tick()
            except Exception:  # one bad tick must not end a session that records
                log.exception("station %s", self.name)
            self._viewers.notify_at_tick(self.latest)

    def _tick(self) -> None:
        self._status = status = worn_glove.read_status(self.glove, self.tracking, self.setup.hand)
        self._wizard, effects = wizard_machine.tick(self._wizard, status)
        self._carry_out(effects, status)
        self._follow_free_movement(status)
        self.trial.follow(self._wizard, self.curve.what)
        self._wiggle(status)
        self._wizard = self.checks.follow(self._wizard, status, self.glove.assembler.mounting)
        self._problem = worn_glove.problem_sentence(
            self.glove, self.setup.hand, self._calibrated_glove
        )
        self._drawing.pose = trial_events.pose_with(self._pose_details())
        with self.scene.picture():
            self._drawing.draw_wizard(self._wizard, status)
            self._draw_readouts()
        self.curve.follow(self._drawing.measured or None)  # what is marked on the drawn hand
        if self._wizard.state is State.TASK_RUN:
            self.grasp.update(str(self._wizard.task), self._wizard.onset)
        self._publish(status)
        self._drawing.draw_hand_if_due(TICK)

    def _feed(self, blocks: list[Block]) -> None:
        """In the glove's thread: pass blocks on, then wait as long as the tracker asks; the pipe buffers meanwhile."""
        blocks = self._corrections.read(blocks)
        self.outlets.send_samples(blocks)
        self.hand_position.feed(blocks)
        time.sleep(self.tracking.feed(blocks))

    def _draw_readouts(self) -> None:
        """Draw where the hand is seen from the trunk, and the forces of its fingertips."""
        a = self.glove.assembler
        self.hand_position.follow(a.plate, list(a.streams.values()), a.mounting)
        if (at := self.hand_position.latest) is not None:
            self.scene.place(at.place[0], at.sd[0], bool(at.flags[0]))
        task = self._wizard.task if self._wizard.state is State.TASK_RUN else None
        self.scene.forces(self.grasp.fingertip_forces(task))

    def _take_pose(self, rows: Trajectory) -> None:
        """In the tracker's thread: store the newest pose, notify viewers, draw."""
        self._drawing.newest = rows
        self.curve.add(rows)
        self.outlets.send_poses(rows)
        self._pose_readers.notify()
        self._viewers.notify()
        self._drawing.draw_hand_if_due(max(PICTURE_INTERVAL, 2 * self.tracking.rest))

    def _take_samples(self) -> None:
        """In the tracker's thread, before anything is calibrated: draw how the hand is inclined."""
        self._drawing.draw_hand_if_due(max(INCLINED_INTERVAL, 2 * self.tracking.rest))

    def _current_status(self) -> StationStatus:
        """The status of the last tick, at this moment: to read every sensor for every viewer would cost a core."""
        return replace(self._status, now=time.monotonic(), t=self.tracking.newest_sample())

    def _carry_out(self, effects: Sequence[wizard_effects.Effect], status: StationStatus) -> None:
        w = self._wizard
        reviewed = (State.TASK_PAUSED, State.TASK_REVIEW, State.STEP_REVIEW)
        if w.state in (*wizard_machine.RUNNING, *reviewed):
            end = np.inf if w.state in wizard_machine.RUNNING else w.end
            self.curve.attempt(w.onset, end, w.pauses)
        for effect in effects:
            self._carry_out_one(effect, status)

    def _carry_out_one(self, effect: wizard_effects.Effect, status: StationStatus) -> None:
        match effect:
            case wizard_effects.CueTask(task):
                self._cue(task)
            case wizard_effects.Calibrate():
                self._calibrate(effect)
            case wizard_effects.CueFinger(finger):
                self.glove.send(Cue("wiggle", {"finger": finger, "lead": f"{FINGER_LEAD:g}"}))
            case wizard_effects.CheckSensors():
                self._start_thread(self._check_sensors, "sensors")
            case wizard_effects.Exchange(worn_on):
                self._exchange(dict(worn_on))
            case wizard_effects.Correct(correction):
                self._corrections.add(correction, status.t, self.glove)
                self.checks.restart()
                self.tracking.restart()
            case wizard_effects.Guess():
                self._guess(status)
            case wizard_effects.DropPose():
                self._drop_pose()
            case wizard_effects.KeepAttempt():
                self._store_attempt(effect)
            case wizard_effects.MeasureStep():
                problems = self.steps.measure(effect).problems
                self._wizard = wizard_machine.record_judgement(self._wizard, problems)
            case wizard_effects.DropStep(task):
                self.steps.drop(task)
            case wizard_effects.DropSteps():
                self.steps.drop()
            case wizard_effects.UseSteps():
                self.steps.use()
            case wizard_effects.Finish():
                threading.Thread(target=self._on_finish, args=(self,), daemon=True).start()
            case _:  # of free movement
                self.free.carry_out(effect)

    def _start_thread(self, work: Callable[..., None], name: str, *arguments: object) -> None:
        threading.Thread(
            target=work, args=arguments, name=f"{name} {self.name}", daemon=True
        ).start()

    def _follow_free_movement(self, status: StationStatus) -> None:
        """Update the meter, and take the solution once it is there."""
        self.free.update_meter()
        if self.free.poll_solver():
            refusal = self.free.take_refusal()
            self._wizard = (
                wizard_machine.reject_free_movement(self._wizard, status, refusal)
                if refusal
                else wizard_machine.accept_free_movement(self._wizard, status)
            )

    def _wiggle(self, status: StationStatus) -> None:
        """A virtual patient bends its fingers while the page asks for it."""
        if (
            self._wizard.state is State.CONNECT
            and status.flowing
            and status.now - self._wiggled_at > WIGGLE
        ):
            self._wiggled_at = status.now
            self._cue("wiggle")

    def _cue(self, task: str) -> None:
        """Cue a virtual patient, and let the curve follow what the task measures."""
        known = (*self.setup.protocols, *self.setup.steps, self.setup.free)
        protocol = next((p for p in known if p and p.name == task), None)
        self.curve.follow(protocol.curve_of(self._status.measured) if protocol else None)
        name, details = (
            (protocol.cue, {"lead": f"{protocol.countdown:g}", **protocol.cue_details})
            if protocol
            else (task, {})
        )
        if name:
            self.glove.send(Cue(name, details))

    def _calibrate(self, effect: wizard_effects.Calibrate) -> None:
        """Compute outside the tick: to combine a pose with calibration movements takes seconds."""
        details = self._pose_details()
        pose = trial_events.pose_with(details, effect.onset, effect.end - effect.onset)
        self.tracking.mounting = self.glove.assembler.mounting
        self.tracking.prior = self.free.prior(self.setup.prior, self.setup.prior_glove)
        self._start_thread(self._compute_calibration, "calibration", pose, details)

    def _compute_calibration(self, pose: Pose, details: Mapping[str, Any]) -> None:
        """In a thread of its own: calibrate from the pose, or give the reason why not."""
        calibration, refusal = None, ""
        try:
            calibration = self.tracking.calibrate(pose)
        except InputError as problem:
            refusal = str(problem)
        except Exception:  # the wizard must not wait for ever
            log.exception("station %s", self.name)
            refusal = phrase("calibration.not_computed")
        with self._lock:
            status = self._current_status()
            if self.ended:
                return
            if calibration is None:
                self._wizard = wizard_machine.reject_pose(self._wizard, status, refusal)
            else:
                self._calibration = calibration
                self._take_calibrated_glove()
                self._store_pose(pose, details)
                self.scene.measured(alignment_quality.measured_fingers(calibration))
                asked = bent_joints_asked(calibration)  # a bent joint looks like a poor one
                poor = 0 if asked else sum(j.grade == "poor" for j in self.joints())
                self._wizard, effects = wizard_machine.accept_pose(
                    self._wizard, status, poor, self.tracking.swapped()
                )
                self._carry_out(effects, status)
        self._viewers.notify()

    def _pose_details(self) -> dict[str, Any]:
        """Details for the event of the pose that is being taken."""
        wizard, measured = self._wizard, self.measured_pose.columns()
        return trial_events.pose_details(measured, wizard.passive, wizard.repetition)

    def _take_calibrated_glove(self) -> None:
        """The newest calibration is of the glove that is plugged in now."""
        self._glove_before = self._calibrated_glove
        self._calibrated_glove = self.glove.assembler.replaced

    def _store_pose(self, pose: Pose, details: Mapping[str, Any]) -> None:
        """Keep the pose with the details that it was calibrated with."""
        self._attempts += 1
        self.measured_pose.count(details)
        self.glove.keep_event(
            f"pose-{self._attempts}",
            Event(pose.onset, pose.duration, "initial_pose", dict(details)),
        )
        self.scene.face_ahead()

    def _guess(self, status: StationStatus) -> None:
        """Calibrate by defaults, where nobody could calibrate; the recording says so."""
        self.tracking.mounting = self.glove.assembler.mounting
        try:
            self._calibration = c = self.tracking.guess()
        except InputError as problem:
            self._wizard = wizard_machine.reject_pose(self._wizard, status, str(problem))
            return
        self._take_calibrated_glove()
        self._attempts += 1
        self.glove.keep_event(
            f"pose-{self._attempts}",
            Event(c.t, c.end - c.t, "annotation", {"calibration": "none"}),
        )
        self.scene.face_ahead()
        self.scene.measured(alignment_quality.measured_fingers(c))

    def _check_sensors(self) -> None:
        """In a thread of its own: find sensors that stood still while others moved."""
        self.sensor_faults = [f.message for f in self.tracking.faults()]
        self._viewers.notify()

    def _exchange(self, to: Mapping[str, str]) -> None:
        """Read strips as those of the fingers that wear them, in the recording from its beginning."""
        worn_on = {
            f: to.get(on, on) for f, on in {**{f: f for f in FINGERS}, **self.exchanged}.items()
        }
        self.exchanged = {f: on for f, on in worn_on.items() if f != on}
        self._calibration = None
        self.steps.reset()
        self.free.reset()
        self.checks.restart()
        self._corrections.withdraw(self.glove)
        self.glove.exchange(self.exchanged, self.tracking.restart)

    def _drop_pose(self) -> None:
        """Take the newest pose back; the calibration before it holds again."""
        self.glove.keep_event(f"pose-{self._attempts}", None)
        self._calibration = self.tracking.restore_previous()
        self._calibrated_glove = self._glove_before
        self.scene.face_ahead()

    def joints(self) -> list[JointQuality]:
        """Quality of the current calibration for each joint; empty before the first."""
        faulty = {f.sensor for f in self.tracking.findings if f.severity == "fault"}
        return alignment_quality.of_joints(self._calibration, faulty) if self._calibration else []

    def _next_number(self) -> int:
        """The number of the next stored attempt, from 1 on."""
        self._attempts += 1
        return self._attempts

    def _store_attempt(self, effect: wizard_effects.KeepAttempt) -> None:
        number, trial = self._next_number(), self._wizard.accepted(effect.task)
        protocol = next((p for p in self.setup.protocols if p.name == effect.task), None)
        newest, trunk = self.tracking.newest_sample(), self.setup.trunk_details
        stored = dict(trial_events.events(effect, protocol, trial, newest, trunk))
        for name, event in stored.items():
            self.glove.keep_event(name.format(number), event)
        self.tracking.use_contacts(held_contacts(stored.values()))
