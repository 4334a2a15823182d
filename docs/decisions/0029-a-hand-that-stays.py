"""How far `ekf` drifts in ten minutes in which a hand trembles, or rests, in one place, or moves slowly.

Run     python docs/decisions/0029-a-hand-that-stays.py [SEEDS], from the repository; half a minute of one core a seed and line
Out     first minute -> last: mean error of the wrist's deviation (root mean square over people) with its standard deviation, of the thumb's base and of all angles,
        deg, and normalised errors squared of wrist, base and all
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data import trajectory
from handscope.estimators.data.samples import ACC, GYR, Block, Event, Stream
from handscope.estimators.hand.anatomy import FINGERS, IS_DOF, JOINT, SEGMENTS
from handscope.estimators.methods import ekf
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation import kinematics, sensors
from handscope.estimators.simulation.motion import COORDINATES, Motion, move_through
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.person import Person, draw_person
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.reproduce.accuracy import angle_difference, nees

STREAM = Stream("imu", SEGMENTS, (GYR, ACC), 60.0, "imu")
EASE, PART = 2.0, 60.0  # s in which sines begin and end; s simulated at once
TREMBLES = {  # how much each coordinate trembles, and creeps, against the others
    "forearm_pronation": 1.0, "forearm_flexion": 0.3, "forearm_deviation": 0.3, "wrist_flexion": 1.0, "wrist_deviation": 0.5,
    "thumb_cmc_flexion": 1.0, "thumb_cmc_deviation": 0.7, "thumb_mcp_flexion": 0.5, **{f"{f}_mcp_flexion": 0.8 for f in FINGERS[1:]},
}  # fmt: skip
COLUMNS = [COORDINATES[name] for name in TREMBLES]


@dataclass(frozen=True)
class Kind:
    """What is done; sizes in deg."""

    minutes: int = 10
    tremor: float = 0.0  # amplitude, 4 to 6 Hz, waxing and waning
    creeps: float = 0.0  # standard deviation of each coordinate, sines of 20 s to 10 min
    sways: float = 0.0  # the same, 0.1 to 0.9 Hz
    slow: tuple[str, ...] = ()  # coordinates that move slowly
    extent: float = 0.0
    hz: float = 0.0
    posture: str = "fist"


SLOW = Kind(4, tremor=1.0, posture="relaxed")
KINDS: Mapping[str, Kind] = {
    "lies and trembles": Kind(tremor=1.5, creeps=0.3),
    "lies and trembles, does not creep": Kind(tremor=1.5),
    "lies still": Kind(creeps=0.3),
    "lies still, does not creep": Kind(),
    "held up": Kind(tremor=0.7, creeps=0.5, sways=0.5),
    "trembles while the thumb moves": replace(
        SLOW, slow=("thumb_cmc_flexion", "thumb_cmc_deviation"), extent=5.0, hz=0.05
    ),
    "wrist's deviation, 2 deg at 0.05 Hz": replace(
        SLOW, slow=("wrist_deviation",), extent=2.0, hz=0.05
    ),
    "wrist, 10 deg at 0.1 Hz": replace(
        SLOW, slow=("wrist_flexion", "wrist_deviation"), extent=10.0, hz=0.1
    ),
    "pronation, 40 deg at 0.05 Hz": replace(
        SLOW, slow=("forearm_pronation",), extent=40.0, hz=0.05
    ),
    "about the vertical, 10 deg at 0.05 Hz": replace(
        SLOW, slow=("forearm_flexion",), extent=10.0, hz=0.05
    ),
}


@dataclass(frozen=True)
class Added(Motion):
    """A motion to whose coordinates sines are added, begun and ended smoothly."""

    columns: Sequence[int]
    w: Array  # (columns, sines) rad/s
    phase: Array  # (columns, sines) rad
    size: Array  # (columns, sines) rad

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        x, dx, ddx = super().at(t)
        u = np.clip(np.minimum(t, self.duration - t) / EASE, 0.0, 1.0)
        sign = np.where((u > 0) & (u < 1), np.sign(self.duration / 2 - t), 0.0) / EASE
        s, ds, dds = (
            u**3 * (10 - 15 * u + 6 * u**2),
            30 * u**2 * (1 - u) ** 2 * sign,
            60 * u * (1 - u) * (1 - 2 * u) * sign**2,
        )
        for c, w, phase, size in zip(self.columns, self.w, self.phase, self.size):
            turned = w * t[:, None] + phase
            y, dy, ddy = (
                (size * v).sum(axis=1)
                for v in (np.sin(turned), w * np.cos(turned), -(w**2) * np.sin(turned))
            )
            x[:, c] += s * y
            dx[:, c] += ds * y + s * dy
            ddx[:, c] += dds * y + 2 * ds * dy + s * ddy
        return x, dx, ddx


def added(kind: Kind, posture: Array, duration: float, rng: np.random.Generator) -> Added:
    n, one = len(COLUMNS), np.ones((len(COLUMNS), 1))
    share = np.array(list(TREMBLES.values())) * rng.uniform(0.5, 1.2, n)
    hz = rng.uniform(4, 6) + rng.uniform(-0.2, 0.2, 7)
    late = rng.uniform(-1.5, 1.5, (n, 1)) + rng.normal(0, 0.5, (n, 7))
    parts = [
        (one * hz, rng.uniform(0, 2 * np.pi, 7) + late, kind.tremor * share[:, None] / np.sqrt(7))
    ]
    for sd, low, high, k in ((kind.creeps, 1 / 600, 0.05, 8), (kind.sways, 0.1, 0.9, 6)):
        f = np.exp(rng.uniform(np.log(low), np.log(high), (n, k)))
        parts.append((f, rng.uniform(0, 2 * np.pi, (n, k)), one * sd * np.sqrt(2 / k)))
    moved = np.array([name in kind.slow for name in TREMBLES])
    parts.append((one * kind.hz, rng.uniform(0, 2 * np.pi, (n, 1)), kind.extent * moved[:, None]))
    f, phase, size = (
        np.concatenate([np.broadcast_to(p[i], p[1].shape) for p in parts], axis=1) for i in range(3)
    )
    held = move_through([(0.0, posture), (duration, posture)])
    return Added(held.spline, COLUMNS, 2 * np.pi * f, phase, np.radians(size))


def performances(kind: Kind, person: Person, rng: np.random.Generator) -> Iterator[Performance]:
    pose = task_performance.initial_pose(person.true)
    yield pose
    relaxed = task_performance.relaxed()
    posture = task_performance.fist() if kind.posture == "fist" else relaxed
    yield Performance(move_through([(0.0, relaxed), (2.0, posture)]), ())
    duration = 60.0 * kind.minutes - pose.motion.duration - 2.0
    yield Performance(added(kind, posture, duration, rng), ())


def recorded(kind: Kind, seed: int) -> Simulated:
    of_person, of_motion, of_sensors = np.random.default_rng([seed, 77]).spawn(3)
    person = draw_person("left", of_person)
    worn = sensors.mount_sensors(SEGMENTS, person.true, SensorErrors(), of_sensors)
    blocks, truths, begin = [], [], 0.0
    events: tuple[Event, ...] = ()
    for performance in performances(kind, person, of_motion):
        end = begin + performance.motion.duration
        whole = np.arange(np.ceil(begin * STREAM.rate - 1e-9), np.ceil(end * STREAM.rate - 1e-9))
        for rows in np.array_split(whole, max(1, round((end - begin) / PART))):
            t = rows / STREAM.rate
            moved = kinematics.compute_kinematics(performance.motion, person.true, t - begin)
            k = replace(moved, t=t)
            blocks.append(sensors.simulate_inertial(worn, k, STREAM.rate, of_sensors))
            truths.append(kinematics.true_trajectory(k, "left"))
        events, begin = events or performance.events, end
    truth = trajectory.join(truths, "left")
    samples = {STREAM.name: Block(STREAM, truth.t, np.concatenate(blocks))}
    return Simulated("left", person.declared, samples, events, truth, worn)


def judged(recording: Simulated) -> Array:
    """Of the first and the last minute (2, 7): what is printed, root mean squares squared."""
    moved, truth = process(ekf, ekf.Params(), recording).trajectory, recording.truth
    assert moved.angles_sd is not None
    at = np.clip(np.searchsorted(truth.t, moved.t - 1e-6), 0, len(truth.t) - 1)
    off = np.where(IS_DOF, angle_difference(moved.angles, truth.angles[at]), np.nan)
    minute, wrist, base = (moved.t // 60).astype(int), JOINT["wrist"], JOINT["thumb_cmc"]
    found = []
    for m in (0, minute.max()):
        e, sd = off[minute == m], moved.angles_sd[minute == m]
        sizes = (e[:, wrist, 1].mean(), sd[:, wrist, 1].mean())
        squares = [*np.square(sizes), np.nanmean(e[:, base] ** 2), np.nanmean(e**2)]
        honest = [nees(e[:, wrist], sd[:, wrist]), nees(e[:, base], sd[:, base]), nees(e, sd)]
        found.append([*np.degrees(np.degrees(squares)), *honest])
    return np.array(found)


def main() -> None:
    seeds = [int(x) for x in sys.argv[1:]] or [1, 2, 3, 4]
    for name, kind in KINDS.items():
        of_all = np.mean([judged(recorded(kind, seed)) for seed in seeds], axis=0)
        of_all[:, :4] = np.sqrt(of_all[:, :4])
        parts = (" -> ".join(f"{x:.2f}" for x in column) for column in of_all.T)
        names = ("deviation", "its sd", "base", "angles", "NEES wrist", "base", "all")
        print(f"{name}: {', '.join(f'{n} {p}' for n, p in zip(names, parts))}", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
