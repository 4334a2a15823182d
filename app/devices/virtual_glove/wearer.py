"""Where a virtual glove's samples come from: a simulated person who does what the cue says, or a recording played back."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol

import numpy as np

from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.data.samples import (
    ACC,
    FORCE,
    GYR,
    TORQUE,
    TRUNK,
    TRUNK_MAGNETOMETERS,
    Block,
    Event,
    Stream,
)
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS, SEGMENT, SEGMENTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation import force_sensors, kinematics, sensors, trunk
from handscope.estimators.simulation.force_sensors import ForceErrors
from handscope.estimators.simulation.motion import (
    Motion,
    continue_through,
    move_through,
    shift_motion,
)
from handscope.estimators.simulation.movements import (
    functional_calibration,
    guided_movements,
    object_dynamics,
    static_hold,
    task_performance,
    touched_fingertips,
    touched_surfaces,
)
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.estimators.simulation.trunk import TrunkGlove
from handscope.sessions.files.recording import LoadedRecording

BRIDGE = 0.8  # s from whatever the hand does to the beginning of the next task
HOLD = 3600.0  # s that a pose is held until the next cue
FORCE_RATE = 12.0  # Hz: Kortier, thesis 6.2.3
# strips that are not on the hand's segments; torque: the force sensors have six axes
MORE = "force", "torque", TRUNK
FRAME = 1.5  # s from the relaxed posture into what is held
HELD: Mapping[
    str, Callable[..., Performance]
] = {  # a spacer, a pinch or a block is held while the hand moves about
    "selfcheck_p1": static_hold.spacer_thumb_index,
    "selfcheck_p2": static_hold.spacer_index_middle,
    "selfcheck_p3": partial(static_hold.pinch_twice, shut=10.0),  # as its protocol beats
    "selfcheck_p4": static_hold.block,
    "pinches": static_hold.pinches,
    **{
        task: (lambda geometry, rng, sway, perform=perform: perform(geometry, rng))
        for task, perform in object_dynamics.TASKS.items()
    },
}
REACHING = 0.6  # s there and back


def _touching(perform: Callable[..., Performance], every: float) -> Callable[..., Performance]:
    """Contacts of `every` s each, as their protocol beats."""
    return partial(perform, held=every - 2 * REACHING, between=REACHING)


TOUCHES: Mapping[str, Callable[..., Performance]] = {
    "touch_fingertips": _touching(touched_fingertips.touch_fingertips, 4.5),
    "touch_table": _touching(touched_surfaces.fingertips_on_table, 6.0),
    "touch_palm": _touching(touched_surfaces.fingertips_on_palm, 4.5),
}
FREE, BEYOND = "free_movement", 5.0  # s that a person goes on beyond what is asked for
UNDERSTOOD = frozenset(
    {*task_performance.TASKS, *functional_calibration.STEPS, *HELD, FREE, *TOUCHES}
)


class Wearer(Protocol):
    """Gives the samples of a stream between two instants of the glove's time; calls go forward in time."""

    hand: Hand
    streams: tuple[Stream, ...]
    mounting: Mapping[str, Array]
    plate: Plate | None  # magnetometers on the trunk and magnet on the hand

    def samples(self, stream: Stream, start: float, stop: float) -> Block: ...

    def cue(self, task: str, details: Mapping[str, str], t: float) -> bool:
        """Told to do a task at time t; False where it does not understand."""
        ...

    def marks(self, start: float, stop: float) -> list[Event]:
        """Events of the glove itself that begin between the two instants."""
        ...


@dataclass
class SimulatedPerson:
    """A person with sensors on every segment asked for; understands the tasks of estimators.simulation.tasks and the steps of functional."""

    hand: Hand
    geometry: HandGeometry
    streams: tuple[Stream, ...]
    rng: np.random.Generator
    errors: SensorErrors
    repeat: str | None = None  # a task that is begun again whenever nothing else is going on
    # by the segment that a sensor says it is for, the one that it is on
    worn_on: Mapping[str, str] = field(default_factory=dict)
    negated: Mapping[str, int] = field(default_factory=dict)  # axis of a sensor's gyroscope

    def __post_init__(self) -> None:
        worn = [s for s in SEGMENTS if any(s in stream.sensors for stream in self.streams)]
        self._sensors = sensors.mount_sensors(worn, self.geometry, self.errors, self.rng)
        self._motion = move_through(
            [(0.0, task_performance.relaxed()), (1.0, task_performance.relaxed())]
        )
        self._held: list[tuple[float, Performance]] = []  # when something is taken in hand
        felt = [
            p.removesuffix("_tip_force")
            for s in self.streams
            if FORCE in s.quantities
            for p in s.sensors
        ]
        self._force = force_sensors.draw_sensors(felt, ForceErrors(), self.rng) if felt else None
        self._zero = np.zeros((len(felt), 3))  # N, by how much the force sensors' zeros have walked
        self._of_torque = self.rng.spawn(1)[0]
        self._six_axes = (
            force_sensors.draw_six_axes(self._force, self._of_torque) if self._force else None
        )
        self._torque_zero = np.zeros((len(felt), 3))  # Nm, the same of torques
        # by rate: span, times, readings of all sensors
        self._cache: dict[float, tuple[float, float, Array, Array]] = {}
        on_trunk = any(TRUNK in s.sensors for s in self.streams)
        self._trunk = trunk.draw_carried(TrunkGlove(), self.rng) if on_trunk else None
        self.mounting: Mapping[str, Array] = self._trunk.mounting if self._trunk else {}
        self.plate = self._trunk.plate if self._trunk else None

    def samples(self, stream: Stream, start: float, stop: float) -> Block:
        if FORCE in stream.quantities:
            return self._felt(stream, start, stop)
        if set(stream.sensors) <= {TRUNK, *TRUNK_MAGNETOMETERS}:
            return self._on_trunk(stream, start, stop)
        t, readings = self._readings(stream.rate, start, stop)
        on = [self.worn_on.get(s, s) for s in stream.sensors]
        rows = [self._sensors.segments.index(s) for s in on]
        values = readings[:, rows]
        for sensor, axis in self.negated.items():
            if sensor in stream.sensors and stream.inertial:
                values[:, stream.sensors.index(sensor), stream.axes(GYR).start + axis] *= -1.0
        return Block(
            stream,
            t,
            values
            if stream.inertial
            else np.full((len(t), len(rows), 3 * len(stream.quantities)), np.nan),
        )

    def cue(self, task: str, details: Mapping[str, str], t: float) -> bool:
        if task not in UNDERSTOOD:
            return False
        done, begins = _performance(task, details, self.geometry, self.rng)
        self._held = (
            [*self._held[-1:], (t + begins, done)] if done.forces is not None else self._held[-1:]
        )
        x, dx, ddx = (a[0] for a in self._motion.at(np.array([t])))
        waits = [(t + BRIDGE, task_performance.relaxed())] if begins > BRIDGE else []
        self._motion = _join_motions(
            continue_through((x, dx, ddx), [*waits, (t + begins, task_performance.relaxed())], t),
            shift_motion(done.motion, t + begins),
        )
        return True

    def marks(self, start: float, stop: float) -> list[Event]:
        return []

    def doing(self, t: Array) -> Array:
        """The coordinates (n, 54) that the person goes through at t (n,), as cued so far."""
        return self._motion.at(t)[0]

    def _felt(self, stream: Stream, start: float, stop: float) -> Block:
        """What the force sensors read."""
        assert self._force is not None
        t = (
            np.arange(np.ceil(start * stream.rate - 1e-6), np.ceil(stop * stream.rate - 1e-6))
            / stream.rate
        )
        k = kinematics.compute_kinematics(self._motion, self.geometry, t)
        forces = np.zeros((len(t), len(FINGERS), 3))
        for begins, done in self._held:
            inside = (t >= begins) & (t < begins + done.motion.duration)
            if done.forces is not None and inside.any():
                forces[inside] = done.forces(
                    kinematics.compute_kinematics(done.motion, self.geometry, t[inside] - begins)
                )
        e = self._force.errors
        steady = replace(self._force, errors=replace(e, drift=0.0, torque_drift=0.0))
        zeros = _random_walk(self._zero, e.drift, stream.rate, len(t), self.rng)
        self._zero = zeros[-1] if len(t) else self._zero
        read = force_sensors.simulate_forces(steady, self._sensors, k, forces, self.rng) + zeros
        if TORQUE in stream.quantities:
            assert self._six_axes is not None
            zeros = _random_walk(
                self._torque_zero, e.torque_drift, stream.rate, len(t), self._of_torque
            )
            self._torque_zero = zeros[-1] if len(t) else self._torque_zero
            turned = (
                force_sensors.simulate_torques(
                    steady, self._six_axes, self._sensors, k, forces, self._of_torque
                )
                + zeros
            )
            read = np.concatenate([read, turned], axis=2)
        return Block(stream, t, read)

    def _on_trunk(self, stream: Stream, start: float, stop: float) -> Block:
        """What the trunk's sensor or its magnetometers read."""
        assert self._trunk is not None
        t = (
            np.arange(np.ceil(start * stream.rate - 1e-6), np.ceil(stop * stream.rate - 1e-6))
            / stream.rate
        )
        if stream.inertial:
            return Block(stream, t, trunk.simulate_inertial(self._trunk, self._motion, t, self.rng))
        k = kinematics.compute_kinematics(self._motion, self.geometry, t)
        return Block(
            stream,
            t,
            trunk.simulate_magnetic(self._trunk, self._motion, k, self._sensors, self.rng),
        )

    def _readings(self, rate: float, start: float, stop: float) -> tuple[Array, Array]:
        """All sensors' readings at the instants k / rate in [start, stop); streams of one rate share them."""
        if self.repeat is not None and start >= self._motion.spline.x[-1]:
            self.cue(self.repeat, {}, start)
        cached = self._cache.get(rate)
        if cached is None or cached[:2] != (start, stop):
            t = np.arange(np.ceil(start * rate - 1e-6), np.ceil(stop * rate - 1e-6)) / rate
            k = kinematics.compute_kinematics(self._motion, self.geometry, t)
            cached = (start, stop, t, sensors.simulate_inertial(self._sensors, k, rate, self.rng))
            self._cache[rate] = cached
        return cached[2], cached[3]


@dataclass
class Playback:
    """A recording played through the glove: the same samples at the same instants, events as marks."""

    recording: LoadedRecording

    def __post_init__(self) -> None:
        self.hand = self.recording.hand
        self._whole = {
            s.name: b for b in self.recording.samples.values() for s in by_strip(b.stream)
        }
        self.streams = tuple(
            replace(s, clock="base")
            for b in self.recording.samples.values()
            for s in by_strip(b.stream)
        )
        self.mounting, self.plate = self.recording.mounting, self.recording.plate
        starts = [b.t[0] for b in self.recording.samples.values() if len(b.t)]
        self._first = float(min(starts))
        self.duration = self.recording.duration

    def samples(self, stream: Stream, start: float, stop: float) -> Block:
        whole = self._whole[stream.name]
        part = whole.between(start + self._first, stop + self._first)
        rows = [whole.stream.sensors.index(s) for s in stream.sensors]
        axes = np.concatenate(
            [np.arange(whole.values.shape[2])[whole.stream.axes(q)] for q in stream.quantities]
        )
        return Block(stream, part.t - self._first, part.values[:, rows][:, :, axes])

    def cue(self, task: str, details: Mapping[str, str], t: float) -> bool:
        return False

    def marks(self, start: float, stop: float) -> list[Event]:
        return [
            Event(e.onset - self._first, e.duration, e.trial_type, e.details)
            for e in self.recording.events
            if start <= e.onset - self._first < stop
        ]


def by_strip(stream: Stream) -> list[Stream]:
    """A stream of many sensors split as a glove's strips are: one a finger, one for every other point; other than inertial quantities apart."""
    groups: dict[str, list[str]] = {}
    for sensor in stream.sensors:
        alone = sensor not in SEGMENT and sensor not in TRUNK_MAGNETOMETERS
        groups.setdefault(sensor if alone else sensor.split("_")[0], []).append(sensor)
    kinds: list[tuple[str, tuple[str, ...]]] = [("", (GYR, ACC))] if stream.inertial else []
    kinds += [
        (f"_{q}", (q,)) for q in stream.quantities if not (stream.inertial and q in (GYR, ACC))
    ]
    return [
        Stream(
            name.removesuffix(suffix) + suffix,
            tuple(points),
            quantities,
            stream.rate,
            stream.clock,
            stream.full_scale,
        )
        for name, points in groups.items()
        for suffix, quantities in kinds
    ]


def _random_walk(
    level: Array, drift: float, rate: float, n: int, rng: np.random.Generator
) -> Array:
    """How a zero walks on from `level` (sensors, 3) in n samples (n, sensors, 3); `drift` in its unit a root of a second."""
    return np.asarray(
        level + np.cumsum(drift / np.sqrt(rate) * rng.normal(size=(n, *level.shape)), axis=0)
    )


def layout(
    strips: Sequence[str], rate: float, forearm_rate: float | None = None
) -> tuple[Stream, ...]:
    """Streams of a glove with the base unit and the named strips (fingers, `forearm`, `force`, `torque`, `trunk`), gyroscope and accelerometer at `rate` Hz."""
    known = {"hand": ("hand",), "forearm": ("forearm",)} | {
        f: tuple(s for s in SEGMENTS if s.startswith(f + "_"))
        for f in ("thumb", "index", "middle", "ring", "little")
    }
    felt = tuple(f"{f}_tip_force" for f in ("thumb", "index"))
    unknown = [name for name in strips if name not in (*known, *MORE)]
    if unknown:
        raise InputError(
            "device.unknown_strip",
            unknown=unknown[0],
            names=", ".join(n for n in (*known, *MORE) if n != "hand"),
        )
    if "force" in strips and not {"thumb", "index"} <= set(strips):
        raise InputError("device.force_strip_alone")
    if "torque" in strips and "force" not in strips:
        raise InputError("device.torque_without_force")
    scale = {GYR: np.radians(2000.0), ACC: 16 * GRAVITY}
    wanted = ["hand", *(name for name in known if name in strips and name != "hand")]
    scales = {FORCE: ForceErrors().limit} | (
        {TORQUE: ForceErrors().torque_limit} if "torque" in strips else {}
    )
    slow = (
        [Stream("force", felt, tuple(scales), FORCE_RATE, "base", scales)]
        if "force" in strips
        else []
    )
    inertial = (
        Stream(
            n,
            known[n],
            (GYR, ACC),
            forearm_rate or rate if n == "forearm" else rate,
            "forearm" if n == "forearm" else "base",
            scale,
        )
        for n in wanted
    )
    on_trunk = trunk.streams(TrunkGlove()) if TRUNK in strips else ()
    return (*inertial, *slow, *on_trunk)


def _performance(
    task: str, details: Mapping[str, str], geometry: HandGeometry, rng: np.random.Generator
) -> tuple[Performance, float]:
    """What a cue asks for, and how long after that it begins (s); a pose is held, everything else ends relaxed."""
    if (
        task in functional_calibration.STEPS
    ):  # not quite carefully; the step itself begins when the countdown is over
        step = functional_calibration.STEPS[task](
            geometry, rng, functional_calibration.Carelessness()
        )
        return step, max(BRIDGE, float(details.get("lead", 0.0)) - functional_calibration.LEAD)
    if task == "initial_pose":
        return task_performance.initial_pose(geometry, HOLD), BRIDGE
    if task in HELD:
        return HELD[task](geometry, rng, 0.0), max(BRIDGE, float(details.get("lead", 0.0)) - FRAME)
    if task in TOUCHES:
        return TOUCHES[task](geometry, rng), max(BRIDGE, float(details.get("lead", 0.0)))
    if task == FREE:
        begins = max(BRIDGE, float(details.get("lead", 0.0)) - FRAME)
        return guided_movements.free(
            geometry, rng, float(details.get("duration", 40.0)) + BEYOND
        ), begins
    if task == "wiggle" and details.get("finger") in FINGERS:
        return task_performance.wiggle(geometry, (details["finger"],)), max(
            BRIDGE, float(details.get("lead", 0.0))
        )
    if task in task_performance.TIMED and "duration" in details:
        return task_performance.TIMED[task](geometry, duration=float(details["duration"])), BRIDGE
    if task in task_performance.IN_STEP and "lead" in details:
        return task_performance.IN_STEP[task](
            geometry, lead=max(0.5, float(details["lead"]) - BRIDGE)
        ), BRIDGE
    return task_performance.TASKS[task](geometry), BRIDGE


def _join_motions(first: Motion, second: Motion) -> Motion:
    spline = first.spline
    return Motion(
        type(spline)(
            np.concatenate([spline.c, second.spline.c], axis=1),
            np.concatenate([spline.x, second.spline.x[1:]]),
        )
    )
