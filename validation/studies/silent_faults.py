"""Everyday mistakes that cost much: of those that a recording's angles suffer from, how many go without a word.

Recordings are of the simulator that shares no line with the program, through files, from an initial pose on that is missed; one fault each is put into their samples or into
what is declared of them. Whether a fault is costly is asked of the finger that it is in.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, IS_DOF, JOINT, JOINTS
from handscope.estimators.methods import ekf, m2
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import process
from handscope.estimators.recording_checks.check import suspicions_of, untested_of
from handscope.sessions.files.recording import LoadedRecording
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator import daily_movements, free_movement
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.accuracy import angle_difference
from handscope.validation.reproduce.finding import Finding, Row, Table, Verdict, spread
from handscope.validation.studies import crosschecks, injected_faults
from handscope.validation.studies.crosschecks import COSTLY, Made
from handscope.validation.studies.injected_faults import exchanged_axes, negated_axis

FIRST_SEED = 6600  # of people whom no other study asks, and no rule has seen
SECONDS = 24.0
POSE_SD = np.radians(3.0)  # of each freedom, that somebody's initial pose misses
# s that a slip takes: of none no gyroscope sees it
WITHIN = {"": 0.0, " within 0.2 s": 0.2, " within 0.02 s": 0.02}
METHODS = {"m2": m2, "ekf": ekf}
STRAIGHT: Mapping[str, float] = {}
OF_GYROSCOPES = ("one axis' sign", "one gyroscope", "one in rad/s", "gain", "two axes exchanged")


@dataclass(frozen=True)
class Trial:
    """One recording: movement and person; every fault is put into it in turn."""

    movement: str
    seed: int


@dataclass(frozen=True)
class Case:
    """What became of one recording with one fault."""

    codes: tuple[str, ...]  # of what is found in it and not in the recording without the fault
    costs: Mapping[str, float]  # times the error without the fault, by method; NaN: refused
    is_untested: bool = False  # whether the recording with the fault says that its movement cannot test the sensor, the strip, or the fingers, for it

    @property
    def is_costly(self) -> bool:
        return any(cost > COSTLY for cost in self.costs.values())


@dataclass(frozen=True)
class Choice:
    """Where in a recording a fault is put."""

    finger: str
    phalanx: int
    axis: int
    half: float  # s

    @property
    def sensor(self) -> str:
        return CHAINS[self.finger][self.phalanx]


Fault = Callable[[Made, Choice], Made]


def _gyroscopes(
    M: Array, made: Made, sensors: Sequence[str] | None, start: float = -np.inf
) -> Made:
    """Rates of some sensors (None: of all) by a matrix, from an instant on."""
    return _by_matrix(GYR, M, made, sensors, start)


def _by_matrix(
    quantity: str, M: Array, made: Made, sensors: Sequence[str] | None, start: float = -np.inf
) -> Made:
    def change(block: Block) -> Block:
        values, axes = block.values.copy(), block.stream.axes(quantity)
        for k, name in enumerate(block.stream.sensors):
            if sensors is None or name in sensors:
                rows = block.t >= start
                values[rows, k, axes] = values[rows, k, axes] @ M.T
        return replace(block, values=values)

    return made.spoilt(change)


def _change_clock_rate(made: Made, percent: float) -> Made:
    """A recording whose times run too fast."""
    return replace(
        made,
        blocks=tuple(injected_faults.change_clock_rate(list(made.blocks), percent)),
        instants=made.blocks[0].t,
    )


def _without_rows(made: Made, seconds: float) -> Made:
    (named,) = injected_faults.drop_rows(
        [
            replace(b, values=np.broadcast_to(b.t[:, None, None], b.values.shape))
            for b in made.blocks
        ],
        seconds,
    )
    blocks = tuple(injected_faults.drop_rows(list(made.blocks), seconds))
    return replace(made, blocks=blocks, instants=named.values[:, 0, 0])


def _other_hand(made: Made) -> Made:
    return crosschecks.FAULTS["the other hand"][1](made, 1.0)


def _neighbour(finger: str, by: int) -> str:
    others = [f for f in FINGERS if f != "thumb"]
    return others[(others.index(finger) + by) % len(others)]


def _whole_fingers(c: Choice, by: int) -> list[tuple[str, ...]]:
    return list(zip(CHAINS[c.finger], CHAINS[_neighbour(c.finger, by)]))


def _slip(angle: float, seconds: float) -> Fault:
    """A sensor that turns by so many deg half way."""
    return lambda m, c: crosschecks.slip(m, angle, c.sensor, c.half, seconds)


FAULTS: Mapping[str, tuple[Fault, bool]] = {  # and whether all of the hand is at fault
    "one axis' sign": (lambda m, c: _gyroscopes(negated_axis(c.axis), m, [c.sensor]), False),
    "one axis' sign, second half": (
        lambda m, c: _gyroscopes(negated_axis(c.axis), m, [c.sensor], c.half),
        False,
    ),
    "one gyroscope negated": (lambda m, c: _gyroscopes(-np.eye(3), m, [c.sensor]), False),
    "one gyroscope negated, second half": (
        lambda m, c: _gyroscopes(-np.eye(3), m, [c.sensor], c.half),
        False,
    ),
    "all gyroscopes negated": (lambda m, c: _gyroscopes(-np.eye(3), m, None), True),
    "one axis of all gyroscopes": (lambda m, c: _gyroscopes(negated_axis(c.axis), m, None), True),
    "all in rad/s, told as deg/s": (lambda m, c: _gyroscopes(np.radians(np.eye(3)), m, None), True),
    "one in rad/s, told as deg/s": (
        lambda m, c: _gyroscopes(np.radians(np.eye(3)), m, [c.sensor]),
        False,
    ),
    "gain 1.3": (lambda m, c: _gyroscopes(1.3 * np.eye(3), m, [c.sensor]), False),
    "gain 1.15": (lambda m, c: _gyroscopes(1.15 * np.eye(3), m, [c.sensor]), False),
    "gain 1.3, second half": (
        lambda m, c: _gyroscopes(1.3 * np.eye(3), m, [c.sensor], c.half),
        False,
    ),
    "two axes exchanged": (lambda m, c: _gyroscopes(exchanged_axes(c.axis), m, [c.sensor]), False),
    "two axes exchanged, second half": (
        lambda m, c: _gyroscopes(exchanged_axes(c.axis), m, [c.sensor], c.half),
        False,
    ),
    "middle and distal exchanged": (
        lambda m, c: crosschecks.exchange([CHAINS[c.finger][1:]], m),
        False,
    ),
    "proximal and middle exchanged": (
        lambda m, c: crosschecks.exchange([CHAINS[c.finger][:2]], m),
        False,
    ),
    "fingers exchanged, neighbours": (
        lambda m, c: crosschecks.exchange(_whole_fingers(c, 1), m),
        False,
    ),
    "fingers exchanged, one between": (
        lambda m, c: crosschecks.exchange(_whole_fingers(c, 2), m),
        False,
    ),
    "sensor late 0.2 s": (lambda m, c: m.spoilt(crosschecks.delayed([c.sensor], 0.2)), False),
    "sensor late 0.1 s": (lambda m, c: m.spoilt(crosschecks.delayed([c.sensor], 0.1)), False),
    "sensor late 0.2 s, second half": (
        lambda m, c: m.spoilt(crosschecks.delayed([c.sensor], 0.2, c.half)),
        False,
    ),
    "strip late 0.2 s": (lambda m, c: m.spoilt(crosschecks.delayed(CHAINS[c.finger], 0.2)), False),
    "strip late 0.1 s": (lambda m, c: m.spoilt(crosschecks.delayed(CHAINS[c.finger], 0.1)), False),
    "strip late 0.2 s, second half": (
        lambda m, c: m.spoilt(crosschecks.delayed(CHAINS[c.finger], 0.2, c.half)),
        False,
    ),
    **{
        f"slipped {angle:g} deg{within}": (_slip(angle, seconds), False)
        for within, seconds in WITHIN.items()
        for angle in (17.0, 8.5)
    },
    "the other hand": (lambda m, c: _other_hand(m), True),
    "rate 100 told as 50": (lambda m, c: _change_clock_rate(m, 100.0), True),
    "rate 100 told as 90": (lambda m, c: _change_clock_rate(m, 100.0 / 9.0), True),
    "1.5 s of rows dropped": (
        lambda m, c: _without_rows(m, 1.5),
        True,
    ),
    "all frozen 1.5 s": (
        lambda m, c: replace(m, blocks=tuple(injected_faults.freeze_samples(list(m.blocks), 1.5))),
        True,
    ),
    "one strip frozen 1.5 s": (
        lambda m, c: replace(
            m,
            blocks=tuple(
                injected_faults.freeze_samples(list(m.blocks), 1.5, sensors=CHAINS[c.finger])
            ),
        ),
        False,
    ),
    "all accelerometers negated": (lambda m, c: _by_matrix(ACC, -np.eye(3), m, None), True),
    "all accelerometers in g": (lambda m, c: _by_matrix(ACC, np.eye(3) / GRAVITY, m, None), True),
    "one accelerometer in g": (
        lambda m, c: _by_matrix(ACC, np.eye(3) / GRAVITY, m, [c.sensor]),
        False,
    ),
}

BENT: Mapping[str, Mapping[str, float]] = {  # deg of flexion in the initial pose, by level
    "PIP bent by 30 deg in the pose": {"pip": 30.0},
    "fingers curled by 15 deg a joint in the pose": {"mcp": 15.0, "pip": 15.0, "dip": 15.0},
}


def trials(wanted: Wanted) -> Sequence[Trial]:
    """Person after person, each in every movement."""
    movements = wanted.experiments or tuple(daily_movements.MOVEMENTS)
    if unknown := [m for m in movements if m not in daily_movements.MOVEMENTS]:
        raise InputError(
            f"there is no movement {unknown[0]!r}; movements are {', '.join(daily_movements.MOVEMENTS)}"
        )
    return [Trial(m, FIRST_SEED + seed) for seed in range(wanted.seeds) for m in movements]


def measure(trial: Trial) -> dict[str, Case]:
    """Every fault in one recording."""
    made, truth = recorded(trial.movement, trial.seed)
    choice = _choice(trial, made)
    known = _codes(made)
    clean = {m: _errors(made, truth, m) for m in METHODS}
    found = {}
    for name, (spoil, is_whole) in FAULTS.items():
        spoilt = spoil(made, choice)
        fingers = list(FINGERS) if is_whole else _affected_fingers(choice.finger, name)
        costs = {m: _cost(_errors(spoilt, truth, m), clean[m], fingers) for m in METHODS}
        untested = _is_untested(spoilt, choice, name)
        found[name] = Case(tuple(sorted(_codes(spoilt) - known)), costs, untested)
    for name, levels in BENT.items():
        fingers = list(FINGERS[1:]) if len(levels) > 1 else [choice.finger]
        bent = {f"{f}_{level}": np.radians(deg) for f in fingers for level, deg in levels.items()}
        other, its_truth = recorded(trial.movement, trial.seed, bent)
        costs = {m: _cost(_errors(other, its_truth, m), clean[m], fingers) for m in METHODS}
        found[name] = Case(tuple(sorted(_codes(other) - known)), costs)
    return found


def _is_untested(made: Made, choice: Choice, name: str) -> bool:
    """Whether the recording says that its movement is too little to test what is at fault."""
    if not name.startswith((*OF_GYROSCOPES, "strip late", "fingers", "slipped")):
        return False
    declared = made.declared()
    untested = untested_of(declared, suspicions_of(declared))
    if name.startswith("strip late"):
        return choice.finger in untested.strips
    if name.startswith("fingers"):
        return {*_affected_fingers(choice.finger, name)} <= {*untested.fingers}
    return choice.sensor in (untested.turns if name.startswith("slipped") else untested.gyroscopes)


def _affected_fingers(finger: str, name: str) -> list[str]:
    """The fingers that a fault is in."""
    if not name.startswith("fingers"):
        return [finger]
    return [finger, _neighbour(finger, 2 if name.endswith("between") else 1)]


def _cost(
    off: Mapping[str, float] | None, clean: Mapping[str, float] | None, fingers: Sequence[str]
) -> float:
    """The largest of the fingers' errors in times of that without the fault; NaN where a recording is refused."""
    if off is None or clean is None:
        return float("nan")
    return max(off[f] / clean[f] for f in fingers)


def recorded(
    movement: str, seed: int, bent: Mapping[str, float] = STRAIGHT
) -> tuple[Made, free_movement.Truth]:
    """A recording by the outside simulator, as its file is read, and what is true of it; `bent`: flexion (rad) of joints in its pose."""
    setup = free_movement.Setup(
        seed,
        hand="left" if seed % 2 else "right",
        fingers=FINGERS,
        duration=SECONDS,
        missed=float(POSE_SD),
        bent=bent,
    )
    read, truth = write_and_load(setup, daily_movements.movement(movement, setup))
    blocks = tuple(whole_streams(list(read.blocks())))
    samples = {b.stream.name: b for b in blocks}
    loaded = LoadedRecording(read.hand, read.geometry, read.mounting, samples, read.events)
    return Made(loaded, blocks, "index"), truth


def _choice(trial: Trial, made: Made) -> Choice:
    rng = np.random.default_rng([trial.seed, list(daily_movements.MOVEMENTS).index(trial.movement)])
    finger = FINGERS[int(rng.integers(1, 5))]
    return Choice(finger, int(rng.integers(3)), int(rng.integers(3)), 0.5 * (4.0 + SECONDS))


def _codes(made: Made) -> set[str]:
    """What the checks say of a recording, and what its calibration warns of."""
    declared = made.declared()
    try:
        warnings = {m.partition(":")[0] for m in process(m2, m2.Params(), declared).warnings}
    except InputError as refused:
        warnings = {f"refused: {refused}"}
    return {s.message.code for s in suspicions_of(declared)} | warnings


def _errors(made: Made, truth: free_movement.Truth, method: str) -> dict[str, float] | None:
    """Root mean square error of a finger's angles, rad; None where the recording is refused."""
    module = METHODS[method]
    try:
        moved = process(module, module.Params(), made.declared()).trajectory
    except InputError:
        return None
    (block,) = made.blocks
    instants = np.asarray(made.instants if made.instants is not None else block.t)
    of_sample = np.clip(np.searchsorted(block.t, moved.t - 1e-6), 0, len(block.t) - 1)
    rows = np.clip(np.searchsorted(truth.t, instants[of_sample] - 1e-6), 0, len(truth.t) - 1)
    after = truth.t[rows] > free_movement.BEGUN
    found = {}
    for finger, chain in CHAINS.items():
        own = [j.name for j in JOINTS if j.child in chain]
        off = np.array(
            [angle_difference(moved.angles[:, JOINT[j]], truth.angles[j][rows])[after] for j in own]
        )
        is_dof = np.array([IS_DOF[JOINT[j]] for j in own])
        found[finger] = float(np.sqrt(np.nanmean(np.moveaxis(off, 1, 2)[is_dof] ** 2)))
    return found


def finding(wanted: Wanted, results: Sequence[tuple[Trial, dict[str, Case]]]) -> Finding:
    """Of each fault, how often it costs much, and how often it then goes without a word."""
    rows, silent, unsaid = [], [], 0
    for name in (*FAULTS, *BENT):
        costly = [(t, r[name]) for t, r in results if r[name].is_costly]
        without = [(t, c) for t, c in costly if not c.codes]
        untested = sum(c.is_untested for _, c in without)
        unsaid += len(without) - untested
        worst = max((float(np.nanmax([*c.costs.values()])) for _, c in without), default=0.0)
        rows.append(
            Row(
                name,
                {
                    "recordings": spread([len(results)]),
                    "costly": spread([len(costly)]),
                    "without a word": spread([len(without)]),
                    "of these, told as untested": spread([untested]),
                    "worst of these": spread([worst]),
                },
            )
        )
        silent += [
            f"{name}, {t.movement}, person {t.seed}: "
            + ", ".join(f"{m} {cost:.1f}" for m, cost in c.costs.items())
            + " times the clean error and no word"
            + (", but told as untested." if c.is_untested else ".")
            for t, c in without
        ]
    costly_ones = sum(c.is_costly for _, r in results for c in r.values())
    return Finding(
        "silent-faults",
        "Faults that cost much and go without a word",
        (
            f"{len(results)} recordings of {len({t.movement for t, _ in results})} movements by validation/independent/simulator, an initial pose missed by 3 deg a freedom,"
            f" either hand; {len(FAULTS) + len(BENT)} faults in each. Exchanged sensors are mounted as those whose places they take, as the strips of one glove are. Costly: the finger's error by m2 or by ekf is more than {COSTLY} times that without the fault."
            " A word: any code, of a check or a warning, that is not there without the fault; whether it names the right sensor or cause is not asked."
            " Told as untested: the recording with the fault lists the sensor's gyroscope, the strip, or the fingers, among those that its movement is too little to test. It would do so without the"
            " fault, too, as information that lowers no grade, so that it does not count as a word about the fault.",
        ),
        (
            Table(
                "Faults",
                (
                    "recordings",
                    "costly",
                    "without a word",
                    "of these, told as untested",
                    "worst of these",
                ),
                tuple(rows),
                head="fault",
                digits=1,
            ),
        ),
        (
            Verdict(
                "costly faults without a word", float(len(silent)), 0.0, "", "target of the checks"
            ),
        ),
        (
            f"{len(silent)} of {costly_ones} costly faults without a word; {unsaid} of them neither found nor told as untested.",
            *silent,
        ),
        simulated=False,
    )
