"""What the fingers hold, by a simulator that shares nothing with the program: masses, springs and dampers drawn, sensors as they come and calibrated, faults.

Every trial goes the way of somebody's own recording: its files are written, on request its sensors calibrated by `calibrate-force`, and `assess` gives the figures.
"""

import json
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from handscope.validation.independent.simulator import force_sensors, recording_files
from handscope.validation.independent.simulator.force_sensors import Cuffs
from handscope.validation.independent.simulator.hand import measured
from handscope.validation.independent.simulator.pinch import Held, pinched
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.finding import Finding, Row, Spread, Table, spread

# kg, N/m, N s/m: drawn between these, the first two by their logarithm
MASSES, STIFFNESSES, DAMPINGS = (0.1, 1.0), (200.0, 3000.0), (0.0, 30.0)
# share of the true value, standard deviations: further off without a word is surely wrong
WRONG, SURE = 0.1, 2.5
CALIBRATED = Cuffs(calibrated=True)


USUAL, ANYTHING = Cuffs(), Held()


@dataclass(frozen=True)
class Condition:
    """What is held, but for what is drawn, and by which cuffs it is felt."""

    held: Held = ANYTHING
    cuffs: Cuffs = USUAL


def _cuffs(**wrong: Any) -> Condition:
    return Condition(cuffs=replace(CALIBRATED, **wrong))


def _held(**wrong: Any) -> Condition:
    return Condition(Held(**wrong), CALIBRATED)


BOTH: Mapping[str, Condition] = {
    "12 Hz, as they come": Condition(),
    "100 Hz, as they come": Condition(cuffs=Cuffs(rate=100.0)),
    "12 Hz, calibrated": Condition(cuffs=CALIBRATED),
    "100 Hz, calibrated": _cuffs(rate=100.0),
    "cuffs 5 deg misaligned, as they come": Condition(cuffs=Cuffs(misaligned=5.0)),
    "cuffs 5 deg misaligned, calibrated": _cuffs(misaligned=5.0),
    "gains off by 5 %, cross-axis 5 %, as they come": Condition(
        cuffs=Cuffs(scale=0.05, cross=0.05)
    ),
    "gains off by 10 %, cross-axis 10 %, zero 2 N, calibrated": _cuffs(
        scale=0.1, cross=0.1, offset=2.0
    ),
    "the thumb's gain sank by 15 %": _cuffs(gain=(0.85, 1.0)),
    "both gains sank by 15 %": _cuffs(gain=(0.85, 0.85)),
    "zeros walk by 0.06 N/sqrt(s)": _cuffs(walk=0.06),
    "zeros walk by 0.2 N/sqrt(s)": _cuffs(walk=0.2),
    "the thumb's zero jumps by 0.5 N": _cuffs(jump=0.5),
    "noise of 0.2 N": _cuffs(noise=0.2),
    "limit of 4 N, not told": _cuffs(limit=4.0),
    "saturates softly at 6 N": _cuffs(soft=6.0),
    "low-pass of 5 Hz": _cuffs(low_pass=5.0),
    "50 ms late": _cuffs(late=0.05),
    "a third finger takes a tenth": _held(third=0.1),
    "a third finger takes a fifth": _held(third=0.2),
    "a third finger takes a third": _held(third=0.35),
}
LIFTED: Mapping[str, Condition] = {
    **BOTH,
    "it slips": _held(slips=True),
    "something carries 1 N": _held(support=1.0),
}
SQUEEZED: Mapping[str, Condition] = {
    **BOTH,
    "the stiffness changes by 0.3 of itself": _held(bend=0.3),
    "the stiffness changes by 0.6 of itself": _held(bend=0.6),
    "the stiffness changes by itself": _held(bend=1.0),
}
TASKS = {"lift": LIFTED, "squeeze": SQUEEZED}
QUANTITIES = {"lift": ("lift_mass",), "squeeze": ("squeeze_stiffness", "squeeze_damping")}


@dataclass(frozen=True)
class Trial:
    """One run: task, condition and seed."""

    task: str  # of TASKS
    condition: str
    seed: int


@dataclass(frozen=True)
class ReportedFigure:
    """A figure beside the truth; NaN where it was not given."""

    value: float
    sd: float
    true: float
    has_reason: bool  # the program gives a reason to doubt it

    @property
    def known(self) -> bool:
        return bool(np.isfinite(self.value)) and self.sd > 0

    @property
    def surely_wrong(self) -> bool:
        off = abs(self.value - self.true)
        return (
            self.known and not self.has_reason and off > WRONG * self.true and off > SURE * self.sd
        )


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    return [
        Trial(task, name, seed)
        for task, conditions in TASKS.items()
        for name in conditions
        for seed in range(wanted.seeds)
    ]


def measure(trial: Trial) -> Mapping[str, ReportedFigure]:
    """Figures of one recording by `assess`, by name."""
    with TemporaryDirectory() as folder:
        true = made(trial, Path(folder))
        _run("assess", f"{folder}/recording", "--method", "m2", "--out", f"{folder}/told")
        figures = json.loads(Path(folder, "told", "figures.json").read_text())["figures"]
    by_name = {f["name"]: f for f in figures}
    reason = by_name[QUANTITIES[trial.task][0]]["reason"]
    return {
        name: ReportedFigure(
            _number(by_name[name]["value_si"]),
            _number(by_name[name]["sd_si"]),
            true[name],
            bool(reason),
        )
        for name in QUANTITIES[trial.task]
    }


def made(trial: Trial, folder: Path) -> dict[str, float]:
    """Write the trial's recording and the bench table of its sensors into a folder; returns the truth by the figure's name."""
    condition = TASKS[trial.task][trial.condition]
    of_object, of_hand, of_tape, of_sensors, of_bench, of_readings = np.random.default_rng(
        [trial.seed, len(trial.task)]
    ).spawn(6)
    held = _draw_movement(condition.held, trial.task, of_object)
    pinch = pinched(held, ("left", "right")[trial.seed % 2], of_hand)
    sensors = [
        force_sensors.draw_sensor(condition.cuffs, of_sensors) for _ in recording_files.FINGERS
    ]
    setups: dict[str, object] = {}
    if condition.cuffs.calibrated:
        setup = folder / "setup.json"
        for finger, sensor in zip(recording_files.FINGERS, sensors):
            (folder / "bench.csv").write_text(force_sensors.on_the_bench(sensor, finger, of_bench))
            _run("calibrate-force", f"{folder}/bench.csv", "--finger", finger, "--out", str(setup))
        setups = json.loads(setup.read_text())["ForceSetup"]
    forces = force_sensors.simulate_readings(pinch, condition.cuffs, sensors, of_readings)
    recording_files.written(
        folder / "recording", pinch, measured(pinch.hand, of_tape), forces, setups
    )
    if held.mass is not None:
        return {"lift_mass": held.mass}
    return {"squeeze_stiffness": pinch.stiffness, "squeeze_damping": held.damping}


def _draw_movement(held: Held, task: str, rng: np.random.Generator) -> Held:
    mass, stiffness = (
        float(np.exp(rng.uniform(*np.log(between)))) for between in (MASSES, STIFFNESSES)
    )
    if task == "lift":
        return replace(held, mass=mass)
    return replace(held, stiffness=stiffness, damping=float(rng.uniform(*DAMPINGS)))


def _run(*words: str) -> None:
    """A command of the program."""
    from handscope.app import cli

    with redirect_stdout(StringIO()):
        code = cli.main(list(words))
    assert code == 0, words


def _number(value: float | None) -> float:
    return nan if value is None else value


def finding(
    wanted: Wanted, results: Sequence[tuple[Trial, Mapping[str, ReportedFigure]]]
) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    tables = (
        _table(results, "lift", "lift_mass", "Mass of what is lifted"),
        _table(results, "squeeze", "squeeze_stiffness", "Stiffness of what is squeezed"),
        _table(results, "squeeze", "squeeze_damping", "Its damping, errors in N s/m"),
    )
    return Finding(
        "independent-grasp",
        "What the fingers hold, by an independent simulator",
        _setting(wanted),
        tables,
        (),
        _remarks(results),
    )


def _table(
    results: Sequence[tuple[Trial, Mapping[str, ReportedFigure]]],
    task: str,
    quantity: str,
    title: str,
) -> Table:
    relative = quantity != "squeeze_damping"
    unit = "%" if relative else "N s/m"
    columns = (
        "something said, %",
        "told, %",
        f"error, {unit}",
        f"sd told, {unit}",
        "normalised error squared",
        "surely wrong, %",
    )
    rows = []
    for condition in TASKS[task]:
        of_row = [
            found[quantity]
            for trial, found in results
            if (trial.task, trial.condition) == (task, condition)
        ]
        rows.append(Row(condition, _figures(of_row, columns, relative)))
    return Table(title, columns if relative else columns[:-1], tuple(rows), head="", digits=1)


def _figures(
    each: Sequence[ReportedFigure], columns: Sequence[str], relative: bool
) -> dict[str, Spread]:
    """Statistics by column; no errors where no figure was given."""
    figures = {
        columns[0]: share([one.has_reason for one in each]),
        columns[1]: share([one.known for one in each]),
    }
    if relative:
        figures[columns[5]] = share([one.surely_wrong for one in each])
    if known := [one for one in each if one.known]:
        scale = np.array([100 / one.true if relative else 1.0 for one in known])
        off, sd = (
            np.array(values)
            for values in ([one.value - one.true for one in known], [one.sd for one in known])
        )
        mean_sd, squared = float((scale * sd).mean()), float(((off / sd) ** 2).mean())
        figures |= {
            columns[2]: spread(scale * off),
            columns[3]: _one(mean_sd),
            columns[4]: _one(squared),
        }
    return figures


def share(those: Sequence[bool]) -> Spread:
    """As one number, in percent."""
    return _one(100 * float(np.mean(those)))


def _one(value: float) -> Spread:
    return Spread(value, 0.0, value, 1)


def _setting(wanted: Wanted) -> tuple[str, ...]:
    return (
        f"{wanted.seeds} trials a row: `handscope reproduce independent-grasp --seeds {wanted.seeds}`. A simulator of a pinch that shares no code with the program (`validation/independent/simulator`: hands, movement, forces, sensors and the files' text written with numpy and scipy alone), "
        "left and right hands in turn. Masses of 0.1 to 1 kg, springs of 0.2 to 3 N/mm, dampers of 0 to 30 N s/m drawn for every trial; the recordings are Motion-BIDS folders, the figures those of `handscope assess --method m2`.",
        "Lengths of the hand measured to 2 %, joints on the palm to 1 mm, every freedom of the initial pose missed by up to 2.5 deg, inertial sensors 6 deg misaligned with noise and biases of MEMS. "
        "Force sensors as they come: gains 2 %, cross-axis 1 %, 1 deg an axis on the cuff, a zero of 0.2 N that walks by 0.02 N/sqrt(s), noise 0.05 N. Calibrated: thirteen rows of two weights on a bench, "
        "directions by the cuff's accelerometer, through `handscope calibrate-force`; the recording then has raw counts. What is wrong in the other rows is wrong with calibrated sensors at 12 Hz, and nobody tells the program of it.",
        "Of a spring that bends the true stiffness is the slope of the straight line through force and closing. Surely wrong: told without a word, off by more than 10 % and by more than 2.5 of the standard deviations that it is told with.",
    )


def _remarks(results: Sequence[tuple[Trial, Mapping[str, ReportedFigure]]]) -> tuple[str, ...]:
    """Over all conditions: how much is confident and wrong."""
    all_reported = [(trial.condition, found[QUANTITIES[trial.task][0]]) for trial, found in results]
    wrong = [condition for condition, one in all_reported if one.surely_wrong]
    where = ", ".join(f"{name} ({wrong.count(name)})" for name in dict.fromkeys(wrong))
    return (
        f"Surely wrong: {len(wrong)} of {len(all_reported)} masses and stiffnesses{f': {where}' if where else ''}.",
    )
