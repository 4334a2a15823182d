"""What each source of error costs m2: switched off in turn, and alone.

The experiments are Table 6's combined movements of thumb, index and middle finger: the same people and movements in every variant.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

from handscope.app.report.units import DEG
from handscope.estimators.hand.anatomy import FINGER_JOINTS
from handscope.estimators.simulation.experiments import TABLE6
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.accuracy import angle_errors, rms, tip_rmse
from handscope.validation.reproduce.experiments import (
    POSE_ERROR,
    Trial,
    estimated,
    performed,
    simulated_setting,
)
from handscope.validation.reproduce.figures import Bar, bars
from handscope.validation.reproduce.finding import Finding, Row, Spread, Table, spread

EXPERIMENTS = ("AF-F1", "AF-F2", "AF-F3")
CM = 100.0
ALL, NOTHING = "all sources", "no source"


@dataclass(frozen=True)
class Sources:
    """What errs in a trial."""

    errors: SensorErrors = field(default_factory=SensorErrors)
    pose_error: float = POSE_ERROR
    wrist_error: float = POSE_ERROR
    lengths: bool = True


def _without(*names: str) -> Callable[[Sources], Sources]:
    silent: dict[str, Any] = dict.fromkeys(names, 0.0)
    return lambda s: replace(s, errors=replace(s.errors, **silent))


SOURCES: Mapping[str, Callable[[Sources], Sources]] = {
    "misalignment of the sensors": _without("misalignment", "misalignment_width"),
    "initial pose missed by the fingers": lambda s: replace(s, pose_error=0.0),
    "initial pose missed by the wrist": lambda s: replace(s, wrist_error=0.0),
    "soft tissue": _without("skin_angle", "skin_shift"),
    "lengths": lambda s: replace(s, lengths=False),
    "gyroscope noise and bias": _without("gyr_noise", "gyr_bias", "gyr_bias_walk"),
    "accelerometer noise and bias": _without("acc_noise", "acc_bias"),
    "scale and cross-axis": _without("gyr_scale", "acc_scale", "cross_axis"),
}


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    return [Trial(name, seed) for name, seed in product(EXPERIMENTS, range(wanted.seeds))]


def measure(trial: Trial) -> Mapping[str, tuple[float, float]]:
    """RMSE of tip (cm) and the finger's angles (deg) of all variants of one trial, by `SOURCE off` and `SOURCE alone`."""
    finger, found = TABLE6[trial.experiment].fingers[0], {}
    for name, sources in _variants().items():
        estimate, truth = estimated(
            performed(
                trial, sources.errors, sources.pose_error, sources.lengths, sources.wrist_error
            ),
            "m2",
        )
        angle = rms(angle_errors(estimate, truth, FINGER_JOINTS[finger]))
        found[name] = (CM * tip_rmse(estimate, truth, [finger]), DEG * angle)
    return found


def finding(
    wanted: Wanted, results: Sequence[tuple[Trial, Mapping[str, tuple[float, float]]]]
) -> Finding:
    """The tables, ours beside the published ones, with remarks."""

    def over(name: str, k: int) -> Spread:
        return spread(found[name][k] for _, found in results)

    columns = ("tip cm, off", "tip cm, alone", "angles deg, off", "angles deg, alone")
    rows = [
        Row(ALL, {columns[0]: over(f"{NOTHING} off", 0), columns[2]: over(f"{NOTHING} off", 1)})
    ]
    rows += [
        Row(s, {c: over(f"{s} {c.split()[-1]}", c.startswith("angles")) for c in columns})
        for s in SOURCES
    ]
    rows += [
        Row(
            NOTHING,
            {columns[1]: over(f"{NOTHING} alone", 0), columns[3]: over(f"{NOTHING} alone", 1)},
        )
    ]
    table = Table(
        "RMSE of m2 with one source switched off, and with it alone",
        columns,
        tuple(rows),
        head="source",
        over="seeds and experiments",
    )
    drawn = [
        Bar(s, [(over(f"{s} alone", k).mean, over(f"{s} off", k).mean) for k in (0, 1)])
        for s in SOURCES
    ]
    everything = [over(f"{NOTHING} off", k).mean for k in (0, 1)]
    figures = {
        "reproduce-budget.svg": bars(
            drawn, everything, ("RMSE of the fingertip, cm", "RMSE of the joint angles, deg")
        )
    }
    return Finding(
        "budget",
        "What each source of error costs",
        _setting(),
        (table,),
        remarks=_remarks(rows),
        figures=figures,
    )


def _variants() -> dict[str, Sources]:
    """Everything on; each source off; each source alone; nothing on."""
    silent = Sources()
    for silence in SOURCES.values():
        silent = silence(silent)
    variants = {f"{NOTHING} off": Sources(), f"{NOTHING} alone": silent}
    for name, silence in SOURCES.items():
        alone = Sources()
        for other, silence_other in SOURCES.items():
            alone = alone if other == name else silence_other(alone)
        variants |= {f"{name} off": silence(Sources()), f"{name} alone": alone}
    return variants


def _remarks(rows: Sequence[Row]) -> tuple[str, ...]:
    """Which source costs most, by what is left when it is away."""
    sources = [row for row in rows if len(row.ours) == 4]
    remarks = []
    for what, column in (("the fingertip", "tip cm, off"), ("the joint angles", "angles deg, off")):
        best = min(sources, key=lambda row: row.ours[column].mean)
        remarks.append(
            f"For {what}, most is gained without: {best.name} ({rows[0].ours[column].mean:.2f} to {best.ours[column].mean:.2f})."
        )
    return tuple(remarks)


def _setting() -> tuple[str, ...]:
    return (
        f"Experiments {', '.join(EXPERIMENTS)} of Table 6, method m2 with its defaults. `off`: every source but this one; `alone`: only this one. What is "
        "switched off leaves everything else as it was drawn. Squares do not add up exactly: the initial pose fixes misalignment and misses together.",
        *simulated_setting(False),
    )
