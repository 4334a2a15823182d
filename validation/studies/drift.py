"""How far `m2` and `ekf` drift in an hour: angles and fingertips against time, the hand moving freely, with and without pauses.

The recording is simulated, processed and compared piece by piece, so that the memory stays that of a minute.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from handscope.app.report.units import DEG
from handscope.estimators.data import trajectory
from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import IS_DOF, JOINT, SEGMENTS
from handscope.estimators.methods import METHODS, m2
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.simulation import kinematics, sensors
from handscope.estimators.simulation.movements import guided_movements, task_performance
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.person import Person, draw_person
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors, SensorSet
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.accuracy import angle_difference
from handscope.validation.reproduce.experiments import RATE
from handscope.validation.reproduce.figures import Line, lines
from handscope.validation.reproduce.finding import Finding, Row, Spread, Table, spread

SEEDS = 8  # at most: an hour takes minutes to compute
PIECE, PAUSE = 40.0, 10.0  # s of free movement, and of rest between two of them
CM = 100.0
MINUTES = (1, 2, 5, 10, 20, 30, 45, 60)  # rows of the table
STREAM = Stream("imu", SEGMENTS, (GYR, ACC), RATE, "imu")
VARIANTS: Mapping[str, tuple[str, dict[str, Any]]] = {  # method and its options
    "ekf": ("ekf", {}),
    "m2": ("m2", {}),
    "m2, rest_turn=0.03": ("m2", {"rest_turn": 0.03}),
}
PAUSES = {"pauses": True, "no pause": False}
KINDS = tuple(f"{method}, {pauses}" for method, pauses in product(VARIANTS, PAUSES))
FIELDS = {  # of Course, by the words of a column
    "angles deg": "angles",
    "tips cm": "tips",
    "thumb's base deg": "base",
    "other joints deg": "others",
}
QUANTITIES = tuple(FIELDS)


@dataclass(frozen=True)
class Trial:
    """One person who moves for so many minutes, with pauses or without."""

    seed: int
    pauses: str  # of PAUSES
    minutes: int


@dataclass(frozen=True)
class Course:
    """RMSE minute by minute (minutes,): of all joint angles in deg, of the five tips in cm, of the thumb's base alone and of all other joints in deg."""

    angles: Array
    tips: Array
    base: Array
    others: Array


@dataclass(frozen=True)
class Worn:
    """One person with sensors on."""

    person: Person
    sensors: SensorSet
    rng: np.random.Generator


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    return [
        Trial(seed, pauses, wanted.minutes)
        for pauses, seed in product(PAUSES, range(min(wanted.seeds, SEEDS)))
    ]


def measure(trial: Trial) -> Mapping[str, Course]:
    """Simulate, process by every method and compare, piece by piece."""
    of_person, of_motion, of_sensors = np.random.default_rng(trial.seed).spawn(3)
    person = draw_person("left", of_person)
    worn = Worn(
        person, sensors.mount_sensors(SEGMENTS, person.true, SensorErrors(), of_sensors), of_sensors
    )
    sums = {name: np.zeros((trial.minutes, len(FIELDS))) for name in VARIANTS}
    count = {name: np.zeros(trial.minutes) for name in VARIANTS}
    performances = _performances(60.0 * trial.minutes, PAUSES[trial.pauses], person, of_motion)
    for name, estimate, truth in _pieces(worn, performances):
        minute = (estimate.t / 60).astype(int)
        kept = minute < trial.minutes
        for k, squares in enumerate(_squares(estimate, truth)):
            sums[name][:, k] += np.bincount(minute[kept], squares[kept], trial.minutes)
        count[name] += np.bincount(minute[kept], minlength=trial.minutes)
    return {
        f"{name}, {trial.pauses}": _course(np.sqrt(sums[name] / count[name][:, None]))
        for name in VARIANTS
    }


def _course(rmse: Array) -> Course:
    """Of root mean squares (minutes, 4) in rad and m."""
    return Course(DEG * rmse[:, 0], CM * rmse[:, 1], DEG * rmse[:, 2], DEG * rmse[:, 3])


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Mapping[str, Course]]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    courses: Mapping[str, list[Course]] = {
        kind: [courses[kind] for _, courses in results if kind in courses] for kind in KINDS
    }
    tables = [
        _table("RMSE against time since the initial pose", QUANTITIES[:2], courses, wanted.minutes),
        _table("RMSE of angles by joint", QUANTITIES[2:], courses, wanted.minutes),
    ]
    t = np.arange(0.5, wanted.minutes, dtype=float)
    panels = [
        [_line(kind, t, [getattr(c, what) for c in of]) for kind, of in courses.items()]
        for what in ("angles", "tips")
    ]
    titles = (
        "RMSE of all joint angles in deg over minutes",
        "RMSE of the five fingertips in cm over minutes",
    )
    figures = {"reproduce-drift.svg": lines(panels, titles, (0.0, None))}
    return Finding(
        "drift",
        "An hour without magnetometers",
        _setting(wanted),
        tuple(tables),
        remarks=_remarks(tables[0].rows),
        figures=figures,
    )


def _performances(
    duration: float, pauses: bool, person: Person, rng: np.random.Generator
) -> Iterator[Performance]:
    """The initial pose, then free movement until the time is over."""
    pose = task_performance.initial_pose(person.true)
    yield pose
    length = pose.motion.duration
    while length < duration:
        parts = [
            guided_movements.free(person.true, rng, PIECE),
            *([task_performance.rest(person.true, PAUSE)] if pauses else []),
        ]
        yield from parts
        length += sum(part.motion.duration for part in parts)


def _pieces(
    worn: Worn, performances: Iterator[Performance]
) -> Iterator[tuple[str, Trajectory, Trajectory]]:
    """Method, its estimate, and the truth at the same instants, as the methods give them out."""
    methods = {
        name: (METHODS[method], METHODS[method].Params(**options))
        for name, (method, options) in VARIANTS.items()
    }
    begin, states, pending = 0.0, dict[str, Any](), trajectory.empty("left")
    for performance in performances:
        block, truth = _record(worn, performance, begin)
        begin += performance.motion.duration
        if not states:
            pose = Simulated(
                "left",
                worn.person.declared,
                {STREAM.name: block},
                performance.events,
                truth,
                worn.sensors,
            )
            for name, (method, params) in methods.items():
                calibration = calibrate(params, pose)[0][0]
                states[name] = method.start(params, calibration, (STREAM,))
            block = block.between(calibration.t, np.inf)
        pending = trajectory.join([pending, truth], "left")
        for part in block.parts(1024):
            for name, (method, params) in methods.items():
                states[name], estimate = method.step(params, states[name], part)
                if len(estimate):
                    known = pending.between(estimate.t[0] - 1e-6, estimate.t[-1] + 1e-6)
                    yield name, estimate, known
        pending = pending.between(begin - PIECE, np.inf)


def _record(worn: Worn, performance: Performance, begin: float) -> tuple[Block, Trajectory]:
    """Samples and truth of one performance that begins at `begin` s."""
    first, last = (
        int(np.ceil(x * RATE - 1e-9)) for x in (begin, begin + performance.motion.duration)
    )
    t = np.arange(first, last) / RATE
    k = replace(kinematics.compute_kinematics(performance.motion, worn.person.true, t - begin), t=t)
    return Block(
        STREAM, t, sensors.simulate_inertial(worn.sensors, k, RATE, worn.rng)
    ), kinematics.true_trajectory(k, "left")


def _squares(estimate: Trajectory, truth: Trajectory) -> tuple[Array, ...]:
    """Mean squared error (n,) of all freedoms, of the five tips, of the thumb's base and of the other joints."""
    assert len(estimate) == len(truth), "an instant without a truth"
    angle = angle_difference(estimate.angles, truth.angles)
    of_base = np.zeros_like(IS_DOF)
    of_base[JOINT["thumb_cmc"]] = IS_DOF[JOINT["thumb_cmc"]]
    tip = np.linalg.norm(estimate.tips - truth.tips, axis=-1)
    base, others = angle[:, of_base], angle[:, IS_DOF & ~of_base]
    return (
        (angle[:, IS_DOF] ** 2).mean(axis=1),
        (tip**2).mean(axis=1),
        (base**2).mean(axis=1),
        (others**2).mean(axis=1),
    )


def _table(
    title: str, quantities: Sequence[str], courses: Mapping[str, list[Course]], minutes: int
) -> Table:
    """One row a minute of MINUTES, and the first ten and sixty together."""
    columns = tuple(f"{name}, {kind}" for name in quantities for kind in courses)
    spans = [(f"minute {m}", m - 1, m) for m in MINUTES if m <= minutes]
    spans += [(f"first {m} min", 0, m) for m in (10, 60) if m <= minutes]
    rows = tuple(_row(name, quantities, courses, first, last) for name, first, last in spans)
    return Table(title, columns, rows, head="time")


def _row(
    name: str,
    quantities: Sequence[str],
    courses: Mapping[str, list[Course]],
    first: int,
    last: int,
) -> Row:
    def over(field: str, kind: str) -> Spread:
        return spread(
            float(np.sqrt((getattr(c, field)[first:last] ** 2).mean())) for c in courses[kind]
        )

    return Row(
        name,
        {f"{what}, {kind}": over(FIELDS[what], kind) for what in quantities for kind in courses},
    )


def _line(name: str, t: Array, values: Sequence[Array]) -> Line:
    """The mean over the seeds, and from the least to the largest."""
    return Line(name, t, np.mean(values, axis=0), np.min(values, axis=0), np.max(values, axis=0))


def _remarks(rows: Sequence[Row]) -> tuple[str, ...]:
    walk = SensorErrors().gyr_bias_walk
    turned = {m: walk * np.sqrt((60.0 * m) ** 3 / 3) for m in (10, 60)}
    why = (
        f"Why: gravity tells nothing of a turn about the vertical. A bias that walks by {walk:g} deg/s/sqrt(s) and that nothing corrects turns a heading "
        f"by {turned[10]:.0f} deg (SD) in 10 and {turned[60]:.0f} deg in 60 minutes. A sensor at rest shows its whole bias, and the fusion learns it anew; "
        "one that moves shows only the part that tilts it. Then the joints hold the headings together as far as they can: hinges do, the thumb's base does not. There "
        "`ekf` compares the accelerations that hand and thumb feel at their joint (decision 0025); with `m2` rest the hand, or repeat the pose."
    )
    rest = (
        "How far rest is trusted matters, too: while the hand holds still and fingers move, the skin turns the hand's sensor by a degree per second or "
        f"less. The fusion takes that for rest (below `rest_gyr`, {m2.Params().rest_gyr:g} deg/s) and for a bias that shows. It is therefore trusted to "
        f"`rest_turn`, {m2.Params().rest_turn:g} deg/s; compare the package's own 0.03 on the same people and movements."
    )
    first, minutes = rows[0], [row for row in rows if row.name.startswith("minute")]
    last = minutes[-1]
    remarks = (
        f"{c}: {first.ours[c].mean:.2f} in the first minute, {last.ours[c].mean:.2f} in {last.name}."
        for c in first.ours
    )
    return (*remarks, why, rest)


def _setting(wanted: Wanted) -> tuple[str, ...]:
    walked = SensorErrors().gyr_bias_walk * np.sqrt(3600.0)
    return (
        f"Seeds: {min(wanted.seeds, SEEDS)}. {wanted.minutes} simulated minutes each; methods with their defaults as they run live, one initial pose at the start "
        f"and none after it (held exactly: the offset that a missed pose leaves is no drift). All joints move from one random posture to another while the "
        f"whole hand moves about; with a pause of {PAUSE:g} s every {PIECE:g} s, or without. In an hour a gyroscope's bias walks by {walked:.3f} deg/s (SD).",
        "Error sizes as listed under `Error sizes`, but for the pose. Drawn: the mean over the seeds, and from the least to the largest.",
    )
