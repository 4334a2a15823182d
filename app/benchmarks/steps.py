"""One step of one sample, as a live view takes it when samples come one by one: five fingers (16 sensors) at 200 Hz, m2 and ekf."""

import gc
import time

import numpy as np

from app.benchmarks import Metric
from app.benchmarks.batch import FAST, recording_of
from estimators.methods import METHODS
from estimators.processing import calibrate
from estimators.samples import Block

TARGETS = {"m2": None, "ekf": 1.0}  # ms, 99th percentile: updates of the filter come at every 40th sample
STEPS = 2000


def measure() -> list[Metric]:
    """Median and 99th percentile of each method's steps behind its pose."""
    recording, found = recording_of(("initial_pose", "rom_fist"), FAST), []
    for name, target in TARGETS.items():
        method, params = METHODS[name], METHODS[name].Params()
        calibration = calibrate(params, recording)[0][0]
        samples = recording.samples["imu"].between(calibration.t, np.inf)
        state, took = method.start(params, calibration, recording.streams), []
        gc.collect()
        gc.freeze()  # as the server does once it is loaded
        for sample in Block(samples.stream, samples.t[:STEPS], samples.values[:STEPS]).parts(1):
            began = time.perf_counter()
            state, _ = method.step(params, state, sample)
            took.append(1e3 * (time.perf_counter() - began))
        found.append(Metric(f"{name} step, median", float(np.median(took)), "ms", None, "lower"))
        found.append(Metric(f"{name} step, p99", float(np.percentile(took, 99)), "ms", target, "lower"))
    return found
