"""Fingertip and joint angles against the truth while one finger moves in a homogeneous field: Salchow-Hoemmen 2019, Table 6."""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from handscope.app.report.units import DEG
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import FINGER_JOINTS, JOINT
from handscope.estimators.simulation.experiments import TABLE6
from handscope.validation.papers import published
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.accuracy import angle_errors, rms, tip_rmse
from handscope.validation.reproduce.experiments import (
    VARIANTS,
    Trial,
    chosen,
    estimated,
    performed,
    simulated_setting,
)
from handscope.validation.reproduce.finding import Finding, Row, Table, Verdict, spread, standing

TIP_TARGET, ANGLE_TARGET = 0.8, 2.6  # cm, deg on average over the table
CM = 100.0
PAPER = "Salchow-Hoemmen 2019, Table 6, subject 1"
# by variant: tip in cm; finger's angles, all angles in deg
Errors = Mapping[str, tuple[float, float, float]]


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    return [
        Trial(name, seed)
        for name, seed in product(chosen(wanted.experiments, TABLE6), range(wanted.seeds))
    ]


def measure(trial: Trial) -> Errors:
    """RMSE of the moved finger's tip, of its joint angles and of all joint angles."""
    recording, finger = performed(trial), TABLE6[trial.experiment].fingers[0]
    return {variant: errors_of(*estimated(recording, variant), finger) for variant in VARIANTS}


def errors_of(estimate: Trajectory, truth: Trajectory, finger: str) -> tuple[float, float, float]:
    """RMSE of the finger's tip in cm, of its joint angles and of all joint angles in deg."""
    of_finger, of_all = (
        rms(angle_errors(estimate, truth, joints))
        for joints in (FINGER_JOINTS[finger], tuple(JOINT))
    )
    return CM * tip_rmse(estimate, truth, [finger]), DEG * of_finger, DEG * of_all


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Errors]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    tips = Table(
        "RMSE of the fingertip in the wrist frame, cm",
        tuple(VARIANTS),
        _rows(results, 0),
        "m2",
        "experiment",
    )
    angles = Table(
        "RMSE of the moved finger's joint angles, deg",
        tuple(VARIANTS),
        _rows(results, 1),
        head="experiment",
        digits=1,
    )
    everywhere = Table(
        "RMSE of all joint angles, deg",
        tuple(VARIANTS),
        _rows(results, 2),
        head="experiment",
        digits=1,
    )
    mean = [float(np.mean([found["m2"][k] for _, found in results])) for k in range(3)]
    verdicts = (
        Verdict("m2, fingertip, mean over the table", mean[0], TIP_TARGET, "cm", "our target"),
        Verdict(
            "m2, joint angles of the moved finger, mean over the table",
            mean[1],
            ANGLE_TARGET,
            "deg",
            "our target",
        ),
        Verdict(
            "m2, all joint angles, mean over the table", mean[2], ANGLE_TARGET, "deg", "our target"
        ),
    )
    setting = (
        f"Beside ours: {PAPER}. `m2 heading` is the paper's variant (alignment=heading), `m2` ours.",
        *simulated_setting(False),
    )
    remarks = (f"m2: {standing(tips, 'our mean is')}", _paper_variant(tips))
    return Finding(
        "table6",
        "One finger moves, homogeneous field (Table 6)",
        setting,
        (tips, angles, everywhere),
        verdicts,
        remarks,
    )


def _paper_variant(tips: Table) -> str:
    met = [row.name for row in tips.rows if row.ours["m2 heading"].mean <= row.theirs["m2 heading"]]
    return f"m2 with alignment=heading, the paper's own variant: at or below the paper's in {len(met)} of {len(tips.rows)} rows."


def _rows(results: Sequence[tuple[Trial, Errors]], k: int) -> tuple[Row, ...]:
    """A row an experiment; the paper's figures beside the tips' only."""
    rows = []
    for name in dict.fromkeys(trial.experiment for trial, _ in results):
        found = [errors for trial, errors in results if trial.experiment == name]
        ours = {variant: spread(errors[variant][k] for errors in found) for variant in VARIANTS}
        rows.append(Row(name, ours, _theirs(name) if k == 0 else {}))
    return tuple(rows)


def _theirs(name: str) -> dict[str, float]:
    return {variant: published.TABLE6[name][method] for variant, (method, _) in VARIANTS.items()}
