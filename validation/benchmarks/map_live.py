"""The experiment map-live beside ekf: how far behind the newest sample the hand is given out, how right it is, what it costs."""

import time

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.methods import EXPERIMENTS, METHODS
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.scenario import Simulated
from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.steps import one_by_one
from handscope.validation.reproduce.accuracy import nees
from handscope.validation.reproduce.experiments import Trial, at_the_truths_instants, performed

MOVEMENT = Trial("free", 0)  # about 45 s, a whole hand
BESIDE = ("ekf", "map-live")
STEPS = 1000  # samples, one by one


def measure() -> list[Metric]:
    """Each of one recording of free movement."""
    made, found = performed(MOVEMENT), []
    for name in BESIDE:
        method = {**METHODS, **EXPERIMENTS}[name]
        params = method.Params()
        steps = list(one_by_one(method, params, made, next(made.blocks()), STEPS))
        late = [1e3 * (step.t - t) for step in steps for t in step.given.t]
        began = time.process_time()
        moved = process(method, params, made).trajectory
        spent = time.process_time() - began
        angles, tips, honest = errors(made, moved)
        found += [
            Metric(
                f"{name}, behind the newest sample, mean", float(np.mean(late)), "ms", None, "lower"
            ),
            Metric(
                f"{name}, step of one sample, p99",
                float(np.percentile([step.took for step in steps], 99)),
                "ms",
                None,
                "lower",
            ),
            Metric(
                f"{name}, processor's time for a second",
                spent / float(made.truth.t[-1]),
                "s",
                None,
                "lower",
            ),
            Metric(f"{name}, angles, RMS error", angles, "deg", None, "lower"),
            Metric(f"{name}, tips, RMS error", tips, "mm", None, "lower"),
            Metric(f"{name}, angles, normalised error squared", honest, "1", None, "lower"),
        ]
    return found


def errors(made: Simulated, moved: Trajectory) -> tuple[float, float, float]:
    """Of all finger angles (deg) and tips (mm) where the experiment is judged; of the angles in their standard deviations, squared."""
    estimate, truth = at_the_truths_instants(made, moved)
    angles, tips = (estimate.angles - truth.angles)[:, 1:], estimate.tips - truth.tips
    honest = np.nan
    if moved.angles_sd is not None:
        sd = moved.angles_sd[np.searchsorted(moved.t, estimate.t - 1e-6)][:, 1:]
        honest = nees(angles, sd)
    return (
        float(np.degrees(np.sqrt(np.nanmean(angles**2)))),
        1e3 * float(np.sqrt(np.nanmean((tips**2).sum(axis=-1)))),
        honest,
    )
