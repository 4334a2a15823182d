"""Sensors checked against each other (estimators/fault_detection/neighbours): which faults are found from which size on, and how often an intact recording is suspected.

Recordings are simulated ones of ours, after an initial pose, and freely moved hands of the simulator that shares nothing with the program; faults are put into their samples.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import permutations, product

import numpy as np

from handscope.estimators.alignment.initial_pose import nominal_mounting
from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.samples import GYR, Block, Recording
from handscope.estimators.errors import InputError
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.fault_detection.neighbours import check_neighbours as neighbours
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, IS_DOF, SEGMENTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.methods import m2
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import process
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.recording_checks import check
from handscope.estimators.simulation import experiments
from handscope.estimators.simulation.experiments import Experiment
from handscope.estimators.simulation.movements import task_performance as tasks
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.scenario import InertialGlove, Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.estimators.simulation.transmission import WIRED, Transmission
from handscope.sessions.files.recording import LoadedRecording
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator import free_movement
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.accuracy import angle_difference
from handscope.validation.reproduce.finding import Finding, Row, Table, Verdict, spread

COSTLY = 1.4  # times the clean error of angles
LIMIT = 1 / 200  # false alarms in a recording
QUICK = ("tapping", "range of motion", "freely moved")
SEEDS = 3  # people of a kind at most; a kind takes a minute a person


@dataclass(frozen=True)
class Kind:
    """Somebody does something with sensors on."""

    tasks: tuple[str, ...] = ()  # of simulation.tasks.TASKS
    experiment: str = ""  # of simulation.experiments.EXPERIMENTS, instead
    outside: Mapping[str, float] | None = None  # of free_movement.Setup, instead
    missing: tuple[str, ...] = ()  # segments without a sensor
    errors: SensorErrors = field(default_factory=SensorErrors)
    link: Transmission = WIRED
    finger: str = "index"  # whose sensors are spoilt


KINDS: Mapping[str, Kind] = {
    "tapping": Kind(("tapping",)),
    "range of motion": Kind(("rom",)),
    "freely moved": Kind(outside={}),
    "single fingers": Kind(("finger_independence",)),
    "fist and flat": Kind(("rom_fist",)),
    "open and close": Kind(("open_close",)),
    "tremor": Kind(("tremor_posture",)),
    "stiff fingers": Kind(("rom_mcp",)),
    "amputated": Kind(
        ("rom", "tapping"),
        missing=("index_middle", "index_distal", "little_distal"),
        finger="middle",
    ),
    "fast": Kind(experiment="open_close 116/min"),
    "fast circles": Kind(experiment="brisk circles"),
    "12 % lost": Kind(("rom_fist", "reach"), link=Transmission(lost=0.12)),
    "resting": Kind(("rest",)),
    "reaching": Kind(("reach",)),
    "object held": Kind(experiment="P4 F1-F2"),
    "wrist": Kind(("rom_wrist",)),
    "forearm turned": Kind(("pronation_supination",)),
    "twice the skin": Kind(("rom",), errors=SensorErrors(skin_angle=4.0, skin_shift=2.0)),
    "slow and free": Kind(experiment="free"),
    "freely and slowly moved": Kind(outside={"pace": 0.5}),
    "freely moved, twice the skin": Kind(outside={"skin": 2.0}),
}


@dataclass(frozen=True)
class Made:
    """A recording as it is declared, with its samples."""

    recording: Recording
    blocks: tuple[Block, ...]
    finger: str
    # (n,) s, when the samples were taken, where their times tell otherwise
    instants: Array | None = None

    def spoilt(self, change: Callable[[Block], Block]) -> "Made":
        return replace(self, blocks=tuple(change(b) for b in self.blocks))

    def declared(self) -> LoadedRecording:
        r = self.recording
        return LoadedRecording(
            r.hand, r.geometry, r.mounting, {b.stream.name: b for b in self.blocks}, r.events
        )


Fault = Callable[[Made, float], Made]


@dataclass(frozen=True)
class Trial:
    """One run: kind, seed and faults."""

    kind: str
    seed: int
    faults: bool


@dataclass(frozen=True)
class Result:
    """Codes of the findings in the intact recording; for each fault and size whether it was found, and what it costs in clean errors (NaN: not known)."""

    clean: tuple[str, ...]
    found: Mapping[tuple[str, float], tuple[bool, float]]


def exchange(pairs: Sequence[tuple[str, ...]], made: Made) -> Made:
    """Sensors in each other's place, each mounted there as that place's own is: strips of a glove are alike, whereas a simulator may mount every sensor otherwise."""
    places = [place for pair in pairs for place in permutations(pair)]
    q_BS = {s: np.asarray(made.recording.mounting.get(s, quat.IDENTITY)) for p in pairs for s in p}
    turn = {
        (at, of): quat.matrix(quat.multiply(quat.conjugate(q_BS[at]), q_BS[of]))
        for at, of in places
    }

    def change(block: Block) -> Block:
        values, names = block.values.copy(), block.stream.sensors
        for at, of in places:
            if at in names and of in names:
                vectors = block.values[:, names.index(of)].reshape(len(block.t), -1, 3)
                turned = vectors @ turn[at, of].T
                values[:, names.index(at)] = turned.reshape(len(block.t), -1)
        return replace(block, values=values)

    return made.spoilt(change)


def delayed(
    sensors: Sequence[str], late: float, start: float = -np.inf
) -> Callable[[Block], Block]:
    """Readings that come `late` s too late from `start` s on."""

    def change(block: Block) -> Block:
        values = block.values.copy()
        for name in set(sensors) & set(block.stream.sensors):
            k = block.stream.sensors.index(name)
            there = np.isfinite(values[:, k]).all(axis=1)
            shifted = np.stack(
                [np.interp(block.t - late, block.t[there], c[there]) for c in block.values[:, k].T],
                axis=1,
            )
            later = there & (block.t >= start)
            values[later, k] = shifted[later]
        return replace(block, values=values)

    return change


def slipped(
    sensor: str, turn: Array, start: float, seconds: float = 0.0
) -> Callable[[Block], Block]:
    """A sensor that turns by `turn` (3,) rad in its own frame at `start` s: within no time, which no gyroscope measures, or within some seconds, which its own does."""

    def change(block: Block) -> Block:
        if sensor not in block.stream.sensors:
            return block
        values, k = block.values.copy(), block.stream.sensors.index(sensor)
        u = np.clip((block.t - start) / seconds, 0.0, 1.0) if seconds else 1.0 * (block.t >= start)
        R = quat.matrix(quat.exp((u**2 * (3 - 2 * u))[:, None] * turn))
        vectors = values[:, k].reshape(len(u), -1, 3) @ R
        if seconds:
            gyr = block.stream.axes(GYR).start // 3
            vectors[:, gyr] += (6 * u * (1 - u) / seconds)[:, None] * turn
        values[:, k] = vectors.reshape(len(u), -1)
        return replace(block, values=values)

    return change


def _half(made: Made) -> float:
    first, last = (float(f(b.t[k] for b in made.blocks)) for f, k in ((min, 0), (max, -1)))
    poses = [e.end for e in made.recording.events if e.trial_type == "initial_pose"]
    return 0.5 * (max([first, *poses]) + last)


def slip(made: Made, degrees: float, sensor: str, start: float, seconds: float = 0.0) -> Made:
    """A recording in which a sensor turns about its joint's axis at `start` s, within some seconds."""
    q_BS = nominal_mounting([sensor], made.recording.mounting)[sensor]
    # the joint's, in the sensor
    axis = quat.rotate(quat.conjugate(q_BS), np.array([0.0, 0.0, 1.0]))
    return made.spoilt(slipped(sensor, np.radians(degrees) * axis, start, seconds))


def _slip(made: Made, degrees: float, phalanx: int) -> Made:
    return slip(made, degrees, CHAINS[made.finger][phalanx], _half(made))


def _with_geometry(made: Made, hand: Hand, geometry: HandGeometry) -> Made:
    r = made.recording
    declared = LoadedRecording(
        hand, geometry, r.mounting, {b.stream.name: b for b in made.blocks}, r.events
    )
    return replace(made, recording=declared)


def _other_places(geometry: HandGeometry) -> dict[str, tuple[float, float, float]]:
    return {j: (-p[0], -p[1], -p[2]) for j, p in geometry.joint_positions.items()}


def _other_hand(made: Made, _: float) -> Made:
    g, hand = made.recording.geometry, "right" if made.recording.hand == "left" else "left"
    return _with_geometry(made, hand, replace(g, hand=hand, joint_positions=_other_places(g)))  # type: ignore[arg-type]


def _next(finger: str) -> str:
    return FINGERS[FINGERS.index(finger) % 4 + 1]


FAULTS: Mapping[str, tuple[tuple[float, ...], Fault, str, str]] = {  # sizes, how, code, unit
    "middle and distal exchanged": (
        (1,),
        lambda m, _: exchange([CHAINS[m.finger][1:]], m),
        "sensors.",
        "",
    ),
    "proximal and middle exchanged": (
        (1,),
        lambda m, _: exchange([CHAINS[m.finger][:2]], m),
        "sensors.",
        "",
    ),
    "distal ones of two fingers exchanged": (
        (1,),
        lambda m, _: exchange([(CHAINS[m.finger][2], CHAINS[_next(m.finger)][2])], m),
        "sensors.",
        "",
    ),
    "two fingers exchanged": (
        (1,),
        lambda m, _: exchange(list(zip(CHAINS[m.finger], CHAINS[_next(m.finger)])), m),
        "fingers.",
        "",
    ),
    "one sensor late": (
        (0.05, 0.1, 0.2),
        lambda m, s: m.spoilt(delayed([CHAINS[m.finger][1]], s)),
        "sensors.",
        "s",
    ),
    "one sensor late, second half": (
        (0.1, 0.2),
        lambda m, s: m.spoilt(delayed([CHAINS[m.finger][1]], s, _half(m))),
        "sensors.",
        "s",
    ),
    "a strip late": (
        (0.05, 0.1, 0.2),
        lambda m, s: m.spoilt(delayed(CHAINS[m.finger], s)),
        "sensors.",
        "s",
    ),
    "proximal slipped": ((6.0, 10.0, 17.0), lambda m, s: _slip(m, s, 0), "sensor.slipped", "deg"),
    "middle slipped": ((6.0, 10.0, 17.0), lambda m, s: _slip(m, s, 1), "sensor.slipped", "deg"),
    "distal slipped": ((10.0, 17.0), lambda m, s: _slip(m, s, 2), "sensor.slipped", "deg"),
    "the other hand": ((1,), _other_hand, "hand.", ""),
    "joint places of the other hand": (
        (1,),
        lambda m, _: _with_geometry(
            m,
            m.recording.hand,
            replace(m.recording.geometry, joint_positions=_other_places(m.recording.geometry)),
        ),
        "geometry.",
        "",
    ),
}


def trials(wanted: Wanted) -> Sequence[Trial]:
    """Every kind; with faults for as many people as `SEEDS`, or as asked for, and intact for all that are asked for."""
    kinds = wanted.experiments or (tuple(KINDS) if wanted.seeds >= SEEDS else QUICK)
    if unknown := [k for k in kinds if k not in KINDS]:
        raise InputError(
            f"there is no kind of recording {unknown[0]!r}; kinds are {', '.join(KINDS)}"
        )
    return [Trial(kind, seed, seed < SEEDS) for kind, seed in product(kinds, range(wanted.seeds))]


def measure(trial: Trial) -> Result:
    """Check a recording without the fault and with it."""
    made = recorded(trial.kind, trial.seed)
    whole = check.suspicions_of(made.declared())  # every check there is
    clean = tuple(s.message.code for s in whole if s.message.severity != "info")
    if not trial.faults:
        return Result(clean, {})
    own, found = _error(made, made), {}
    for name, (sizes, spoil, code, _) in FAULTS.items():
        for size in (
            sizes
            if set(CHAINS[made.finger]) <= {s for b in made.blocks for s in b.stream.sensors}
            else ()
        ):
            spoilt = spoil(made, size)
            codes = [s.message.code for s in suspicions_of(spoilt)]
            found[name, size] = any(c.startswith(code) for c in codes), _error(made, spoilt) / own
    return Result(clean, found)


def suspicions_of(made: Made) -> list[Suspicion]:
    """What the checks say, with the calibration that the samples give."""
    r = made.declared()
    try:
        calibrations = (
            calibrate(m2.Params(), r)[0]
            if any(e.trial_type == "initial_pose" for e in r.events)
            else []
        )
    except InputError:
        calibrations = []
    return neighbours.check(made.blocks, r.hand, r.geometry, r.mounting, calibrations, r.events)


def _error(clean: Made, spoilt: Made) -> float:
    """Root mean square error of m2's angles, rad; NaN where the truth or the pose is not known, or the recording is refused."""
    if not isinstance(clean.recording, Simulated):
        return float("nan")
    truth = clean.recording.truth
    try:
        moved = process(m2, m2.Params(), spoilt.declared()).trajectory
    except InputError:
        return float("nan")
    rows = np.clip(np.searchsorted(moved.t, truth.t - 1e-6), 0, len(moved.t) - 1)
    off = angle_difference(moved.angles[rows], truth.angles)
    return float(np.sqrt(np.nanmean(off[:, IS_DOF] ** 2)))


def recorded(name: str, seed: int) -> Made:
    """An intact recording of a kind."""
    kind = KINDS[name]
    if kind.outside is not None:
        return _outside(kind, seed)
    rng = np.random.default_rng([seed, list(KINDS).index(name), 32])

    def perform(geometry: HandGeometry, of_motion: np.random.Generator) -> tuple[Performance, ...]:
        if kind.experiment:
            return experiments.EXPERIMENTS[kind.experiment].perform(geometry, of_motion)
        return tasks.initial_pose(geometry), *(tasks.TASKS[task](geometry) for task in kind.tasks)

    segments = [s for s in SEGMENTS if s not in kind.missing]
    made = experiments.record_experiment(
        Experiment(name, (), perform),
        rng,
        kind.errors,
        None,
        "left",
        person=experiments.PersonErrors(pose_deg=2.5),
        glove=InertialGlove(segments=segments, link=kind.link),
    )
    return Made(made, tuple(made.blocks()), kind.finger)


def _outside(kind: Kind, seed: int) -> Made:
    """Somebody's freely moved hand, as a glove sends it whose sensors are all mounted alike: axes turned to those of their segments."""
    setup = free_movement.Setup(seed, fingers=FINGERS, duration=40.0, **kind.outside)  # type: ignore[arg-type]
    read, _ = write_and_load(setup)
    blocks = tuple(_rotate_readings(b, read.mounting) for b in whole_streams(list(read.blocks())))
    samples = {b.stream.name: b for b in blocks}
    return Made(
        LoadedRecording(read.hand, read.geometry, {}, samples, read.events), blocks, kind.finger
    )


def _rotate_readings(block: Block, mounting: Mapping[str, Array]) -> Block:
    R = quat.matrix(
        np.array([quat.normalize(np.asarray(mounting[s], float)) for s in block.stream.sensors])
    )
    n, sensors, columns = block.values.shape
    values = np.einsum(
        "sij,nsqj->nsqi", R, block.values.reshape(n, sensors, columns // 3, 3)
    ).reshape(n, sensors, columns)
    return replace(block, values=values)


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Result]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    kinds = list(dict.fromkeys(t.kind for t, _ in results))
    alarms = {k: [100.0 * bool(r.clean) for t, r in results if t.kind == k] for k in kinds}
    every = [a for each in alarms.values() for a in each]
    false = Table(
        "False alarms",
        ("%",),
        tuple(Row(k, {"%": spread(a)}) for k, a in alarms.items()),
        over="recordings",
    )
    share = 100.0 * LIMIT
    verdict = Verdict(
        "intact recordings with a suspicion", float(np.mean(every)), share, "%", "asked for"
    )
    remarks = [f"{t.kind}, seed {t.seed}: {', '.join(r.clean)}." for t, r in results if r.clean]
    silent = [
        f"{_with_size(name, size)}, {t.kind}, seed {t.seed}: {cost:.1f} times the clean error and no word."
        for t, r in results
        for (name, size), (found, cost) in r.found.items()
        if not found and cost > COSTLY
    ]
    return Finding(
        "crosschecks",
        "Sensors checked against each other",
        (
            f"{len(every)} intact recordings of {len(kinds)} kinds, put through every check; {sum(t.faults for t, _ in results)} of them with faults put in, one at a time.",
        ),
        (false, _sizes(results), *_shares(results)),
        (verdict,),
        (
            *remarks,
            f"{len(silent)} faults cost more than {COSTLY} times the clean error without a word.",
            *silent,
        ),
    )


def _sizes(results: Sequence[tuple[Trial, Result]]) -> Table:
    """Share found of each fault and size, of all recordings and of those in which it costs something."""
    rows = []
    for name, (sizes, _, _, _) in FAULTS.items():
        for size in sizes:
            seen = [r.found[name, size] for _, r in results if (name, size) in r.found]
            costly = [100.0 * found for found, cost in seen if cost > COSTLY]
            if seen:
                columns = {"all": spread(100.0 * found for found, _ in seen)} | (
                    {"costly": spread(costly)} if costly else {}
                )
                rows.append(Row(_with_size(name, size), columns))
    return Table("Found, % of recordings", ("all", "costly"), tuple(rows), over="recordings")


def _with_size(name: str, size: float) -> str:
    """A fault as rows and remarks name it; some have no size."""
    return f"{name} {size:g} {FAULTS[name][3]}".removesuffix(" 1 ")


def _shares(results: Sequence[tuple[Trial, Result]]) -> list[Table]:
    """Size from which on a fault is found with 50 and with 95 % probability, of freely moved hands, between the sizes that were tried."""
    rows = []
    for name, (sizes, _, _, unit) in FAULTS.items():
        shares = [
            [
                float(r.found[name, s][0])
                for t, r in results
                if (name, s) in r.found and "freely" in t.kind
            ]
            for s in sizes
        ]
        if len(sizes) > 1 and all(shares):
            x, y = (
                np.array([0.0, *sizes]),
                np.maximum.accumulate([0.0, *(float(np.mean(s)) for s in shares)]),
            )
            reached = {
                f"{level:.0%}": spread([float(np.interp(level, y, x))])
                for level in (0.5, 0.95)
                if y[-1] >= level
            }
            rows.append(Row(f"{name}, {unit}", reached))
    return (
        [
            Table(
                "Size found with 50 % and 95 % probability, freely moved",
                ("50%", "95%"),
                tuple(rows),
                digits=3,
            )
        ]
        if rows
        else []
    )
