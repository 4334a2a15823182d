"""A whole simulated recording: a person does tasks one after the other with sensors on; the truth is kept beside the samples."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from handscope.estimators.data import trajectory
from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.data.samples import (
    ACC,
    FORCE,
    GYR,
    MAG,
    TORQUE,
    Block,
    Event,
    Stream,
    join,
)
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation import force_sensors, kinematics, sensors, transmission, trunk
from handscope.estimators.simulation.force_sensors import ForceErrors
from handscope.estimators.simulation.kinematics import Kinematics
from handscope.estimators.simulation.magnetic_field import MagneticField, homogeneous
from handscope.estimators.simulation.motion import shift_motion
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.sensors import SensorErrors, SensorSet
from handscope.estimators.simulation.transmission import WIRED, Transmission
from handscope.estimators.simulation.trunk import Carried, TrunkGlove


@dataclass(frozen=True, kw_only=True)
class ForceGlove:
    """Fingertips with force sensors."""

    fingers: tuple[str, ...] = ("thumb", "index")
    rate: float = 12.0  # Hz: Kortier, thesis 6.2.3
    errors: ForceErrors = field(default_factory=ForceErrors)
    six_axes: bool = False  # torques as well


@dataclass(frozen=True)
class Simulated:
    """Satisfies estimators.samples.Recording."""

    hand: Hand
    geometry: HandGeometry
    samples: Mapping[str, Block]
    events: tuple[Event, ...]
    truth: Trajectory
    sensors: SensorSet
    mounting: Mapping[str, Array] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    plate: Plate | None = None

    @property
    def streams(self) -> tuple[Stream, ...]:
        return tuple(b.stream for b in self.samples.values())

    def blocks(self) -> Iterator[Block]:
        yield from self.samples.values()


@dataclass(frozen=True)
class InertialGlove:
    """Which segments wear sensors, how often they are read, and how samples come."""

    segments: Sequence[str] = SEGMENTS
    rate: float = 100.0  # Hz
    forearm_rate: float | None = None  # Hz, in a stream of its own; None: as the others
    mag_rate: float = 100.0  # Hz, where there is a field
    link: Transmission = WIRED


FULL_GLOVE = InertialGlove()  # a sensor on every segment


def simulate(
    task_names: Sequence[str],
    hand: Hand,
    geometry: HandGeometry,
    rng: np.random.Generator,
    errors: SensorErrors,
    segments: Sequence[str] = SEGMENTS,
    rate: float = 100.0,
    forearm_rate: float | None = None,
    field: MagneticField | None = None,
    link: Transmission = WIRED,
) -> Simulated:
    """The tasks in order, each from and to the relaxed posture; the forearm's sensor in a stream of its own where its rate is given."""
    unknown = [name for name in task_names if name not in task_performance.TASKS]
    if unknown:
        raise InputError(
            "simulation.unknown_task",
            unknown=unknown[0],
            tasks=", ".join(task_performance.TASKS),
        )
    performances = [task_performance.TASKS[name](geometry) for name in task_names]
    return simulate_performances(
        performances,
        hand,
        geometry,
        rng,
        errors,
        glove=InertialGlove(rate=rate, segments=segments, forearm_rate=forearm_rate, link=link),
        field=field,
    )


def simulate_performances(
    performances: Sequence[Performance],
    hand: Hand,
    geometry: HandGeometry,
    rng: np.random.Generator,
    errors: SensorErrors,
    glove: InertialGlove = FULL_GLOVE,
    field: MagneticField | None = None,
    known: HandGeometry | None = None,
    force: ForceGlove | None = None,
    on_trunk: TrunkGlove | None = None,
) -> Simulated:
    """The same of performances already made up; with a `field` magnetometers in a stream of their own, `known` is the geometry that a method is given.

    Magnetometers, losses, force sensors and what is worn on the trunk have random streams of their own: the inertial readings are the same with and without them.
    """
    middle = 0.5 * sum(p.motion.duration for p in performances)  # s
    worn = replace(sensors.mount_sensors(glove.segments, geometry, errors, rng), slip_time=middle)
    of_mag, of_link, of_force, of_trunk = rng.spawn(4)
    plans = _plan_streams(glove, errors, has_magnetometers=field is not None)
    fastest = max((p for p in plans if p.inertial), key=lambda p: (p.rate, p.name == "imu"))
    clocks = {
        p.name: transmission.clock_rate(glove.link, of_link) if p.clock == "forearm" else 1.0
        for p in plans
    }
    parts: dict[str, list[Block]] = {p.name: [] for p in plans}
    carried = trunk.draw_carried(on_trunk, of_trunk) if on_trunk is not None else None
    truths, events, begin = [], [], 0.0
    for performance in performances:
        end = begin + performance.motion.duration
        moved: dict[tuple[float, float], kinematics.Kinematics] = {}  # by rate and clock
        for stream in plans:
            clock = clocks[stream.name]
            t = _sampling_instants(begin, end, stream.rate, clock)
            if (stream.rate, clock) not in moved:
                k = kinematics.compute_kinematics(performance.motion, geometry, t / clock - begin)
                moved[stream.rate, clock] = replace(k, t=t)
            k = moved[stream.rate, clock]
            rows = [worn.segments.index(s) for s in stream.sensors]
            if stream.inertial:
                read = sensors.simulate_inertial(worn, k, stream.rate, rng)
            else:
                read = sensors.simulate_magnetic(worn, k, field or homogeneous(), of_mag)
            parts[stream.name].append(Block(stream, t, read[:, rows]))
            if stream is fastest:
                truths.append(_truth(k, hand, performance, begin, worn, carried))
        events += [
            Event(e.onset + begin, e.duration, e.trial_type, e.details) for e in performance.events
        ]
        begin = end
    if force is not None:
        parts["force"] = [_simulate_forces(performances, geometry, worn, force, of_force)]
    if carried is not None:
        parts |= {
            b.stream.name: [b]
            for b in _simulate_trunk(performances, geometry, worn, carried, of_trunk)
        }
    mounting, plate = ({}, None) if carried is None else (carried.mounting, carried.plate)
    samples = {
        name: transmission.transmit(glove.link, join(blocks), of_link)
        for name, blocks in parts.items()
    }
    return Simulated(
        hand,
        known or geometry,
        samples,
        tuple(events),
        trajectory.join(truths, hand),
        worn,
        mounting,
        plate=plate,
    )


def _truth(
    k: Kinematics,
    hand: Hand,
    performance: Performance,
    begin: float,
    worn: SensorSet,
    carried: Carried | None,
) -> Trajectory:
    moved = kinematics.true_trajectory(k, hand)
    return (
        moved
        if carried is None
        else trunk.add_true_position(
            carried, shift_motion(performance.motion, begin), k, worn, moved
        )
    )


def _simulate_forces(
    performances: Sequence[Performance],
    geometry: HandGeometry,
    worn: SensorSet,
    glove: ForceGlove,
    rng: np.random.Generator,
) -> Block:
    """What the force sensors read over all performances; nothing is touched where a performance has no forces."""
    sensors_worn = force_sensors.draw_sensors(glove.fingers, glove.errors, rng)
    scales = {FORCE: glove.errors.limit} | (
        {TORQUE: glove.errors.torque_limit} if glove.six_axes else {}
    )
    stream = Stream(
        "force",
        tuple(f"{f}_tip_force" for f in glove.fingers),
        tuple(scales),
        glove.rate,
        "imu",
        scales,
    )
    starts = np.cumsum([0.0, *(p.motion.duration for p in performances)])
    moved, forces = [], []
    for performance, begin, end in zip(performances, starts, starts[1:]):
        t = _sampling_instants(begin, end, glove.rate, 1.0)
        k = kinematics.compute_kinematics(performance.motion, geometry, t - begin)
        forces.append(
            np.zeros((len(t), 5, 3)) if performance.forces is None else performance.forces(k)
        )
        moved.append(replace(k, t=t))
    whole = kinematics.concatenate(moved)
    exerted, of_torque = np.concatenate(forces), rng.spawn(1)[0]
    read = force_sensors.simulate_forces(sensors_worn, worn, whole, exerted, rng)
    if glove.six_axes:
        six = force_sensors.draw_six_axes(sensors_worn, of_torque)
        read = np.concatenate(
            [
                read,
                force_sensors.simulate_torques(sensors_worn, six, worn, whole, exerted, of_torque),
            ],
            axis=2,
        )
    return Block(stream, whole.t, read)


def _simulate_trunk(
    performances: Sequence[Performance],
    geometry: HandGeometry,
    worn: SensorSet,
    c: Carried,
    rng: np.random.Generator,
) -> list[Block]:
    """What the trunk's sensors read over all performances."""
    starts = np.cumsum([0.0, *(p.motion.duration for p in performances)])
    blocks = []
    for stream in trunk.streams(c.glove):
        parts = []
        for performance, begin, end in zip(performances, starts, starts[1:]):
            t, motion = (
                _sampling_instants(begin, end, stream.rate, 1.0),
                shift_motion(performance.motion, begin),
            )
            if stream.inertial:
                parts.append(Block(stream, t, trunk.simulate_inertial(c, motion, t, rng)))
            else:
                parts.append(
                    Block(
                        stream,
                        t,
                        trunk.simulate_magnetic(
                            c, motion, kinematics.compute_kinematics(motion, geometry, t), worn, rng
                        ),
                    )
                )
        blocks.append(join(parts))
    return blocks


def _plan_streams(
    glove: InertialGlove, errors: SensorErrors, has_magnetometers: bool
) -> list[Stream]:
    """The streams: one by wire, the forearm's own where it has a rate of its own, magnetometers'."""
    scale = {GYR: float(np.radians(errors.gyr_range)), ACC: errors.acc_range * GRAVITY}
    rate, inertial, plans = glove.rate, (GYR, ACC), []
    has_own_stream = glove.forearm_rate is not None and "forearm" in glove.segments
    by_wire = tuple(s for s in glove.segments if not (has_own_stream and s == "forearm"))
    plans.append(Stream("imu", by_wire, inertial, rate, "imu", scale))
    if has_own_stream:
        rate = glove.forearm_rate or rate
        plans.append(Stream("forearm", ("forearm",), inertial, rate, "forearm", scale))
    if has_magnetometers:
        scale = {MAG: errors.mag_range * 1e-6}
        plans.append(Stream("mag", tuple(glove.segments), (MAG,), glove.mag_rate, "imu", scale))
    return plans


def _sampling_instants(begin: float, end: float, rate: float, clock: float) -> Array:
    """When samples are taken from `begin` up to `end` s of true time, by a clock that counts `clock` s in each of them."""
    first, last = (int(np.ceil(true * clock * rate - 1e-9)) for true in (begin, end))
    return np.arange(first, last) / rate
