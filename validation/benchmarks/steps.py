"""One step of one sample, as a live view takes it when samples come one by one: five fingers (16 sensors) at 200 Hz, m2 and ekf."""

import gc
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from handscope.estimators.data.samples import Block, Recording
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.methods import METHODS
from handscope.estimators.pipeline.method import Method
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.batch import FAST, recording_of

# ms, 99th percentile: updates of the filter come at every 40th sample
TARGETS = {"m2": None, "ekf": 1.0}
STEPS = 2000


def measure() -> list[Metric]:
    """Median and 99th percentile of each method's steps behind its pose."""
    recording, found = recording_of(("initial_pose", "rom_fist"), FAST), []
    for name, target in TARGETS.items():
        method = METHODS[name]
        took = [
            one.took
            for one in one_by_one(
                method, method.Params(), recording, recording.samples["imu"], STEPS
            )
        ]
        found.append(Metric(f"{name} step, median", float(np.median(took)), "ms", None, "lower"))
        found.append(
            Metric(f"{name} step, p99", float(np.percentile(took, 99)), "ms", target, "lower")
        )
    return found


@dataclass(frozen=True)
class Stepped:
    """One sample's step."""

    t: float  # s, of the sample
    took: float  # ms
    given: Trajectory


def one_by_one(
    method: Method[Any, Any], params: Any, recording: Recording, samples: Block, most: int
) -> Iterator[Stepped]:
    """The first `most` samples behind the pose, stepped one after the other."""
    calibration = calibrate(params, recording)[0][0]
    behind = samples.between(calibration.t, np.inf)
    state = method.start(params, calibration, recording.streams)
    gc.collect()
    gc.freeze()  # as the server does once it is loaded
    for sample in Block(behind.stream, behind.t[:most], behind.values[:most]).parts(1):
        began = time.perf_counter()
        state, given = method.step(params, state, sample)
        yield Stepped(float(sample.t[0]), 1e3 * (time.perf_counter() - began), given)
