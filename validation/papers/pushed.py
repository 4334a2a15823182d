"""How far what remains of Table 6's errors can be pushed: the pose alone, the inclination in which the sensors agree, a functional calibration.

The same people do Table 6's movements after the steps of a functional calibration; the first two variants leave the steps aside.
"""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.experiments import TABLE6
from handscope.validation.papers.table6 import errors_of
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.experiments import (
    POSE_ERROR,
    Trial,
    at_the_truths_instants,
    calibrating,
    chosen,
    simulated_setting,
)
from handscope.validation.reproduce.finding import Finding, Row, Table, spread

VARIANTS = {
    "pose alone": m2.Params(functional=False),
    "common inclination": m2.Params(functional=False, alignment="common"),
    "after the steps": m2.Params(),
}
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
    recording, finger = calibrating(trial), TABLE6[trial.experiment].fingers[0]
    found = {}
    for variant, params in VARIANTS.items():
        found[variant] = errors_of(
            *at_the_truths_instants(recording, process(m2, params, recording).trajectory), finger
        )
    return found


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Errors]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    titles = (
        ("RMSE of the fingertip, cm", 2),
        ("RMSE of the moved finger's joint angles, deg", 1),
        ("RMSE of all joint angles, deg", 1),
    )
    tables = tuple(
        Table(title, tuple(VARIANTS), _rows(results, k), head="experiment", digits=digits)
        for k, (title, digits) in enumerate(titles)
    )
    mean = {
        v: [float(np.mean([found[v][k] for _, found in results])) for k in range(3)]
        for v in VARIANTS
    }
    remarks = (
        *(
            f"{v}: fingertip {a:.2f} cm, the finger's angles {b:.2f} deg, all angles {c:.2f} deg on average."
            for v, (a, b, c) in mean.items()
        ),
        "Where flexion is zero, and where the wrist is neutral, only a still posture can tell: what the pose misses there stays in every variant. "
        "Lengths stay as they are told; measured ones, or a self-calibration, are what can be gained on top.",
    )
    setting = (
        f"Table 6's movements of the same people after a functional calibration done not quite carefully (every posture off by up to {POSE_ERROR:g} deg).",
        *simulated_setting(False),
    )
    return Finding("pushed", "How far the rest can be pushed", setting, tables, remarks=remarks)


def _rows(results: Sequence[tuple[Trial, Errors]], k: int) -> tuple[Row, ...]:
    names = dict.fromkeys(trial.experiment for trial, _ in results)
    return tuple(
        Row(
            name,
            {
                v: spread(found[v][k] for trial, found in results if trial.experiment == name)
                for v in VARIANTS
            },
        )
        for name in names
    )
