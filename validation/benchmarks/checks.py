"""The checks of a recording: processor time of a minute beside that of the estimate, and beside that of the tracker while a session runs."""

import time
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from itertools import pairwise

import numpy as np

from handscope.app.live.sensor_checks import SHARE, SensorChecks
from handscope.app.live.tracking import Tracking
from handscope.estimators.alignment.initial_pose import pose_of
from handscope.estimators.fault_detection.check import check_recording
from handscope.estimators.methods import METHODS
from handscope.estimators.pipeline.process import process, whole_of
from handscope.estimators.recording_checks.check import calibrations_of, suspicions_of
from handscope.estimators.simulation.scenario import Simulated
from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.batch import MINUTE, recording_of
from handscope.validation.benchmarks.costs import time_of_work

TICK = 0.1  # s between two blocks of the live session
REPEATED = 3  # times that a check is measured: the least counts


def measure() -> list[Metric]:
    """In batch on one minute; live as fast as a glove sends it."""
    recording = recording_of(MINUTE)
    minutes = float(recording.truth.t[-1]) / 60.0
    known = calibrations_of(recording)

    def per_minute(work: Callable[[], object]) -> float:
        return time_of_work(work) / minutes

    readings = per_minute(lambda: check_recording(whole_of(recording), recording, known))
    every = per_minute(lambda: suspicions_of(recording, known))
    found = [
        Metric("checks of the readings", readings, "s a minute", None, "lower"),
        Metric("every check", every, "s a minute", None, "lower"),
    ]
    for name in ("m2", "ekf"):
        own = per_minute(partial(process, METHODS[name], METHODS[name].Params(), recording))
        found.append(Metric(f"every check beside {name}", every / own, "x", 1.0, "lower"))
    spent, cost = _live(recording)
    found += [
        Metric("the tracker by ekf, live", spent / minutes, "s a minute", None, "lower"),
        Metric("a check of 15 s, live", cost, "s", None, "lower"),
        Metric(
            "checks that 5 % pays for", SHARE * spent / minutes / cost, "a minute", None, "higher"
        ),
    ]
    return found


def _live(recording: Simulated) -> tuple[float, float]:
    """Processor time (s) of the tracker by `ekf` over the recording, and of a check of what came last."""
    method, pose = METHODS["ekf"], pose_of(recording.events[0])
    blocks = list(recording.blocks())
    end = max(float(b.t[-1]) for b in blocks)
    with Tracking(method, method.Params(), "left", recording.geometry, lambda _: None) as tracking:
        checks = SensorChecks(tracking, "left", recording.geometry, lambda: None, nullcontext())
        began = time.monotonic()
        for start, stop in pairwise(np.arange(0.0, end + TICK, TICK)):
            time.sleep(max(0.0, began + stop - time.monotonic()))
            tracking.feed([b.between(start, stop) for b in blocks])
            if tracking.calibration is None and stop > pose.end + 1.0:
                tracking.calibrate(pose)
        spent = tracking.spent
        cost = min(_check_anew(checks, recording) for _ in range(REPEATED))
    return spent, cost


def _check_anew(checks: SensorChecks, recording: Simulated) -> float:
    """Processor time (s) of a check after a task of half a minute."""
    checks.restart()
    return checks.check(recording.mounting)[1]
