"""Whether `ekf`'s standard deviations are as large as its errors: with its defaults, joints giving as measured ones or not at all, and told how small the
simulated errors are."""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from handscope.estimators.data.options import describe
from handscope.estimators.hand.anatomy import IS_DOF
from handscope.estimators.methods import ekf
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation import joint_compliance
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.accuracy import angle_difference, nees
from handscope.validation.reproduce.experiments import (
    Trial,
    at_the_truths_instants,
    performed,
    simulated_setting,
)
from handscope.validation.reproduce.finding import Finding, Row, Spread, Table, spread

EXPERIMENTS = ("AF-F2", "tapping", "free")
NOISE = SensorErrors().gyr_noise
SIMULATED_SIZES = ekf.Params(
    gyr_noise=NOISE,
    bias_sd=0.001,  # nobody turns in the pose
    creeping=0.02,
    dimension_noise=0.5,
)
SIZES: Mapping[
    str, tuple[ekf.Params, float]
] = {  # what the method is told, and deg by which joints give
    "joints give": (ekf.Params(), joint_compliance.AS_MEASURED),
    "exact hinges": (ekf.Params(), 0.0),
    "as simulated": (SIMULATED_SIZES, 0.0),
}
SIMULATED_OPTIONS = ("gyr_noise", "bias_sd", "creeping", "dimension_noise")
COLUMNS = tuple(f"{what}, {sizes}" for what in ("angles", "tips") for sizes in SIZES)


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    return [Trial(name, seed) for name, seed in product(EXPERIMENTS, range(wanted.seeds))]


def measure(trial: Trial) -> Mapping[str, float]:
    """Squared errors over their variances, by column: means over all freedoms or tips and all instants of the task."""
    recordings, found = (
        {give: performed(trial, give=give) for give in {give for _, give in SIZES.values()}},
        {},
    )
    for name, (params, give) in SIZES.items():
        recording = recordings[give]
        estimate, truth = at_the_truths_instants(
            recording, process(ekf, params, recording).trajectory
        )
        assert estimate.angles_sd is not None and estimate.tips_sd is not None, (
            "ekf tells its standard deviations"
        )
        error = angle_difference(estimate.angles, truth.angles)
        found[f"angles, {name}"] = nees(error[:, IS_DOF], estimate.angles_sd[:, IS_DOF])
        found[f"tips, {name}"] = nees(estimate.tips - truth.tips, estimate.tips_sd)
    return found


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Mapping[str, float]]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""

    def of(experiments: Sequence[str], column: str) -> Spread:
        return spread(found[column] for trial, found in results if trial.experiment in experiments)

    kinds = {**{name: (name,) for name in EXPERIMENTS}, "all": EXPERIMENTS}
    rows = tuple(
        Row(name, {column: of(experiments, column) for column in COLUMNS})
        for name, experiments in kinds.items()
    )
    table = Table(
        "Normalised error squared (1 = as sure as it says, less = too careful)",
        COLUMNS,
        rows,
        over="people",
    )
    remarks = tuple(f"{column}: {bounds(rows[-1].ours[column])}." for column in COLUMNS)
    return Finding(
        "honesty",
        "How honest the standard deviations of `ekf` are",
        _setting(),
        (table,),
        remarks=remarks,
    )


def bounds(s: Spread) -> str:
    """The mean with its 95 % bounds over people, and what that makes of the standard deviations."""
    half = 1.96 * s.sd / np.sqrt(s.count)
    text = (
        "as large as the errors"
        if abs(s.mean - 1) <= half
        else f"{abs(s.mean**-0.5 - 1):.0%} too {'large' if s.mean < 1 else 'small'}"
    )
    return f"{s.mean:.2f} ± {half:.2f} (95 %), standard deviations {text}"


def _setting() -> tuple[str, ...]:
    sizes = (
        f"`{d.name}` {getattr(SIMULATED_SIZES, d.name):g} instead of {d.default:g} {d.unit}"
        for d in describe(ekf.Params)
        if d.name in SIMULATED_OPTIONS
    )
    return (
        f"Method ekf, over the task. `joints give`: about each axis that is no freedom of a finger's joint by {joint_compliance.AS_MEASURED:g} deg (RMS) as it bends, the "
        "figure measured on a joint (Hess et al. 2013: estimators/simulation/joint_compliance.py), the method with its defaults; `exact hinges`: the same where no joint "
        f"gives, as in all other simulations here; `as simulated`: exact hinges, and {', '.join(sizes)}. The noise is the simulator's, in whose pose nobody turns; "
        "the other two were chosen on other people, where errors and standard deviations agreed. The defaults are what makers of sensors and real "
        "recordings say (decision 0009), until a recording itself tells its noise, how its biases scatter in the pose and how its sensors creep at rest.",
        *simulated_setting(False),
    )
