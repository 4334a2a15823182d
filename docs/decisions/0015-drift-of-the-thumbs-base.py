"""How far `ekf` drifts in ten minutes of movement without a pause, joint by joint, and which of a sensor's errors makes it drift.

Run     python docs/decisions/0015-drift-of-the-thumbs-base.py [SEEDS], from the repository; a minute of one core a seed and row
Out     root mean square errors of all angles (deg) and of the tips (cm), of the thumb's base and of the other joints, in the first and in the tenth minute;
        normalised errors squared; with `shared_bias` and without, and with one kind of sensor errors left out. Movement and people as in `handscope reproduce drift`
"""

import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from handscope.estimators.data import trajectory
from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.hand.anatomy import IS_DOF, JOINT, SEGMENTS
from handscope.estimators.methods import ekf
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation import kinematics, sensors
from handscope.estimators.simulation.movements import guided_movements, task_performance
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.person import Person, draw_person
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.reproduce.accuracy import angle_difference, nees

MINUTES, PIECE, RATE = 10, 40.0, 100.0
STREAM = Stream("imu", SEGMENTS, (GYR, ACC), RATE, "imu")
WITHOUT: Mapping[str, SensorErrors] = {
    "all errors": SensorErrors(),
    "no errors of accelerometers": SensorErrors(acc_bias=0.0, acc_scale=0.0),
    "no scale errors of gyroscopes": SensorErrors(gyr_scale=0.0, cross_axis=0.0),
    "no walk of gyroscope biases": SensorErrors(gyr_bias_walk=0.0),
    "no skin": SensorErrors(skin_angle=0.0, skin_shift=0.0),
}


def recorded(seed: int, errors: SensorErrors) -> Simulated:
    """The pose, held exactly, then free movement without a pause."""
    of_person, of_motion, of_sensors = np.random.default_rng(seed).spawn(3)
    person = draw_person("left", of_person)
    worn = sensors.mount_sensors(SEGMENTS, person.true, errors, of_sensors)
    blocks, truths, events, begin = [], [], (), 0.0
    for performance in _performances(person, of_motion):
        first, last = (
            int(np.ceil(x * RATE - 1e-9)) for x in (begin, begin + performance.motion.duration)
        )
        t = np.arange(first, last) / RATE
        moved = kinematics.compute_kinematics(performance.motion, person.true, t - begin)
        k = replace(moved, t=t)
        blocks.append(sensors.simulate_inertial(worn, k, RATE, of_sensors))
        truths.append(kinematics.true_trajectory(k, "left"))
        events = events or performance.events
        begin += performance.motion.duration
    truth = trajectory.join(truths, "left")
    samples = {STREAM.name: Block(STREAM, truth.t, np.concatenate(blocks))}
    return Simulated("left", person.declared, samples, events, truth, worn)


def _performances(person: Person, rng: np.random.Generator) -> Iterator[Performance]:
    pose = task_performance.initial_pose(person.true)
    yield pose
    length = pose.motion.duration
    while length < 60.0 * MINUTES:
        part = guided_movements.free(person.true, rng, PIECE)
        yield part
        length += part.motion.duration


def judge(recording: Simulated, params: ekf.Params) -> str:
    """Errors of the first and of the last minute in one line."""
    moved, truth = process(ekf, params, recording).trajectory, recording.truth
    assert moved.angles_sd is not None and moved.tips_sd is not None
    at = np.clip(np.searchsorted(truth.t, moved.t - 1e-6), 0, len(truth.t) - 1)
    off = np.where(IS_DOF, np.degrees(angle_difference(moved.angles, truth.angles[at])), np.nan)
    missed, base = 100 * (moved.tips - truth.tips[at]), JOINT["thumb_cmc"]
    lines = []
    for minute in (0, MINUTES - 1):
        rows = np.flatnonzero(moved.t // 60 == minute)
        angles, of_base, others = (
            np.sqrt(np.nanmean(x[rows] ** 2))
            for x in (off, off[:, base], np.delete(off, base, axis=1))
        )
        tips = np.sqrt((missed[rows] ** 2).sum(axis=-1).mean())
        honest = (
            nees(np.radians(off[rows]), moved.angles_sd[rows]),
            nees(missed[rows] / 100, moved.tips_sd[rows]),
        )
        lines.append(
            f"{angles:.2f} deg, {tips:.2f} cm, base {of_base:.2f}, others {others:.2f} deg, NEES {honest[0]:.2f} / {honest[1]:.2f}"
        )
    return " -> ".join(lines)


def main() -> None:
    for seed in [int(x) for x in sys.argv[1:]] or [1, 2, 3, 4]:
        for name, errors in WITHOUT.items():
            recording = recorded(seed, errors)
            for shared in (False, True):
                line = judge(recording, ekf.Params(shared_bias=shared))
                print(f"{seed}, {name}, shared_bias={shared}: {line}", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
