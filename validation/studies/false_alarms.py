"""How often the checks speak of a recording that is right: every check that `handscope info` runs, over many kinds of movement, people and gloves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import beta

from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.samples import Block
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.recording_checks.check import suspicions_of
from handscope.sessions.files.recording import LoadedRecording
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator import daily_movements, free_movement
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.finding import Finding, Row, Table, Verdict, spread
from handscope.validation.studies import crosschecks

# but for skin that is behind by an angle, which a joint that trembles turns several times as far as itself
LAWS = [law for law in free_movement.LAWS if law != "lagging"]
OUTSIDE: Mapping[str, str] = {f"outside: {name}": name for name in daily_movements.MOVEMENTS}
KINDS = (*crosschecks.KINDS, *OUTSIDE)
LIMIT = 1 / 200  # recordings with an alarm
LEVEL = 0.95  # of the bound
FIRST_SEED = 17000  # of people whom no rule has seen
SECONDS = 24.0
POSE_SD = np.radians(3.0)  # of each freedom, that somebody's initial pose misses
LOST = 0.06  # of the samples of every third person, in bursts as a radio loses them
LONGEST_BURST = 5  # samples
SLOW = 50.0  # Hz, of every fifth person's glove
UNCALIBRATED = (
    5.0  # times the usual bias, as gyroscopes have that nobody calibrated, of every seventh
)


@dataclass(frozen=True)
class Trial:
    """One run: kind and person."""

    kind: str
    seed: int


@dataclass(frozen=True)
class Answer:
    """Codes of what is said of a recording: of faults, and as questions about the person."""

    alarms: tuple[str, ...]
    questions: tuple[str, ...]


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs: person after person, each in every kind."""
    kinds = wanted.experiments or KINDS
    if unknown := [k for k in kinds if k not in KINDS]:
        raise InputError(
            f"there is no kind of recording {unknown[0]!r}; kinds are {', '.join(KINDS)}"
        )
    return [Trial(kind, FIRST_SEED + seed) for seed in range(wanted.seeds) for kind in kinds]


def measure(trial: Trial) -> Answer:
    """Put one recording through every check."""
    answers = suspicions_of(_record(trial))
    questions = [s.message.code for s in answers if s.message.severity == "info"]
    return Answer(
        tuple(s.message.code for s in answers if s.message.severity != "info"), tuple(questions)
    )


def _record(trial: Trial) -> LoadedRecording:
    if trial.kind in OUTSIDE:
        return _outside(OUTSIDE[trial.kind], trial.seed)
    return crosschecks.recorded(trial.kind, trial.seed).declared()


def _outside(movement: str, seed: int) -> LoadedRecording:
    """By the simulator that shares no line with the estimators, through files; either hand, some samples lost, some gloves slow."""
    hand = "left" if seed % 2 else "right"
    setup = free_movement.Setup(
        1000 + seed,
        hand=hand,
        fingers=FINGERS,
        duration=SECONDS,
        rate=SLOW if seed % 5 == 4 else 100.0,
        law=LAWS[seed % len(LAWS)],
        means=seed // 2 % 2 == 0,
        biased=UNCALIBRATED if seed % 7 == 3 else 1.0,
        missed=POSE_SD,
    )
    read, _ = write_and_load(setup, daily_movements.movement(movement, setup))
    blocks = whole_streams(list(read.blocks()))
    if seed % 3 == 2:
        rng = np.random.default_rng([seed, 32])
        blocks = [_with_bursts(b, rng) for b in blocks]
    samples = {b.stream.name: b for b in blocks}
    return LoadedRecording(read.hand, read.geometry, read.mounting, samples, read.events)


def _with_bursts(block: Block, rng: np.random.Generator) -> Block:
    """A stream of which a radio loses LOST of the samples, one to LONGEST_BURST in a row."""
    values, row = block.values.copy(), 0
    while True:
        row += int(rng.geometric(2 * LOST / (1 + LONGEST_BURST)))
        if row >= len(values):
            return replace(block, values=values)
        long = int(rng.integers(1, LONGEST_BURST + 1))
        values[row : row + long] = np.nan
        row += long


def at_most(count: int, of: int) -> float:
    """Share of recordings below which the true one lies with LEVEL. (Clopper & Pearson 1934, Biometrika 26:404)"""
    return 1.0 if count == of else float(beta.ppf(LEVEL, count + 1, of - count))


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Answer]]) -> Finding:
    """The table by kind, with what was said."""
    kinds = list(dict.fromkeys(t.kind for t, _ in results))
    rows = []
    for kind in kinds:
        answers = [s for t, s in results if t.kind == kind]
        columns = {
            "recordings": len(answers),
            "with an alarm": sum(bool(s.alarms) for s in answers),
            "with a question": sum(bool(s.questions) for s in answers),
        }
        rows.append(Row(kind, {name: spread([value]) for name, value in columns.items()}))
    n, alarms = len(results), sum(bool(s.alarms) for _, s in results)
    asked = sum(bool(s.questions) for _, s in results)
    table = Table(
        "Recordings without a fault",
        ("recordings", "with an alarm", "with a question"),
        tuple(rows),
        head="movement",
        digits=0,
    )
    remarks = [
        f"{alarms} of {n} recordings with an alarm: with 95 % fewer than 1 in {1 / at_most(alarms, n):.0f} have one.",
        f"{asked} of {n} with a question about the person: with 95 % fewer than 1 in {1 / at_most(asked, n):.0f}.",
        *(
            f"{t.kind}, person {t.seed}: {', '.join((*s.alarms, *s.questions))}."
            for t, s in results
            if s.alarms or s.questions
        ),
    ]
    return Finding(
        "false-alarms",
        "What the checks say of recordings that are right",
        (
            f"{n} recordings of {len(kinds)} kinds, put through every check: by estimators/simulation (kinds of crosschecks) and, where it says outside, by"
            " validation/independent/simulator, which shares no line with it, through files, an initial pose missed by 3 deg a freedom, either hand, 6 % of the samples"
            " lost for every third person, one to five in a row as a radio loses them; 50 Hz for every fifth; gyroscopes' biases are five times as large for every seventh; skin follows the joints by a law in turn (in proportion, growing, levelling, behind by a time),"
            " rates are those of an instant for one half of the people, means since the sample before for the other.",
        ),
        (table,),
        (
            Verdict(
                "recordings with an alarm, upper 95 % bound",
                100.0 * at_most(alarms, n),
                100.0 * LIMIT,
                "%",
                "target of the checks",
            ),
        ),
        tuple(remarks),
        simulated=False,
    )
