"""A whole simulated recording: a person does tasks one after the other with sensors on; the truth is kept beside the samples."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from estimators import trajectory
from estimators.errors import InputError
from estimators.hand_anatomy import SEGMENTS, Hand
from estimators.hand_geometry import HandGeometry
from estimators.quaternions import Array
from estimators.samples import ACC, GYR, MAG, Block, Event, Stream, join
from estimators.simulation import kinematics, sensors, tasks
from estimators.simulation.magnetic_field import MagneticField, homogeneous
from estimators.simulation.sensors import SensorErrors, SensorSet
from estimators.simulation.tasks import Performance
from estimators.trajectory import Trajectory


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

    @property
    def streams(self) -> tuple[Stream, ...]:
        return tuple(b.stream for b in self.samples.values())

    def blocks(self) -> Iterator[Block]:
        yield from self.samples.values()


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
) -> Simulated:
    """The tasks in order, each from and to the relaxed posture; the forearm's sensor in a stream of its own where its rate is given."""
    unknown = [name for name in task_names if name not in tasks.TASKS]
    if unknown:
        raise InputError(f"there is no task {unknown[0]!r} to simulate; tasks are {', '.join(tasks.TASKS)}")
    performances = [tasks.TASKS[name](geometry) for name in task_names]
    return performed(performances, hand, geometry, rng, errors, segments, rate, forearm_rate, field)


def performed(
    performances: Sequence[Performance],
    hand: Hand,
    geometry: HandGeometry,
    rng: np.random.Generator,
    errors: SensorErrors,
    segments: Sequence[str] = SEGMENTS,
    rate: float = 100.0,
    forearm_rate: float | None = None,
    field: MagneticField | None = None,
    mag_rate: float = 100.0,
    known: HandGeometry | None = None,
) -> Simulated:
    """The same of performances already made up; with a `field` magnetometers in a stream of their own, `known` is the geometry that a method is given."""
    worn = sensors.mounted(segments, geometry, errors, rng)
    scale = {GYR: float(np.radians(errors.gyr_range)), ACC: errors.acc_range * sensors.GRAVITY}
    apart = ("forearm",) if forearm_rate is not None and "forearm" in segments else ()
    plans = [Stream("imu", tuple(s for s in segments if s not in apart), (GYR, ACC), rate, "imu", scale)]
    plans += [Stream("forearm", apart, (GYR, ACC), forearm_rate or rate, "forearm", scale)] if apart else []
    plans += [Stream("mag", tuple(segments), (MAG,), mag_rate, "imu", {MAG: errors.mag_range * 1e-6})] if field is not None else []
    fastest = max((p for p in plans if p.inertial), key=lambda p: (p.rate, p.name == "imu"))
    parts: dict[str, list[Block]] = {p.name: [] for p in plans}
    truths, events, begin = [], [], 0.0
    for performance in performances:
        end = begin + performance.motion.duration
        for stream in plans:
            t = np.arange(int(np.ceil(begin * stream.rate - 1e-9)), int(np.ceil(end * stream.rate - 1e-9))) / stream.rate
            k = replace(kinematics.of_motion(performance.motion, geometry, t - begin), t=t)
            rows = [worn.segments.index(s) for s in stream.sensors]
            read = (
                sensors.inertial(worn, k, stream.rate, rng) if stream.inertial else sensors.magnetic(worn, k, field or homogeneous(), rng)
            )
            parts[stream.name].append(Block(stream, t, read[:, rows]))
            if stream is fastest:
                truths.append(kinematics.truth(k, hand))
        events += [Event(e.onset + begin, e.duration, e.trial_type, e.details) for e in performance.events]
        begin = end
    samples = {name: join(blocks) for name, blocks in parts.items()}
    return Simulated(hand, known or geometry, samples, tuple(events), trajectory.join(truths, hand), worn)
