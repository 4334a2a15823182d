"""Self-calibration of one finger: time over the recording's length, memory."""

import time

import numpy as np

from app.benchmarks import Metric
from app.benchmarks.peak import high_water
from estimators.methods import BATCH
from estimators.processing import process
from estimators.simulation import artificial_finger
from estimators.simulation.sensors import SensorErrors

LENGTHS = (10.0, 20.0, 40.0)  # s


def measure() -> list[Metric]:
    """Processor's time of the whole method, from samples to angles with standard deviations."""
    method, seconds = BATCH["map"], []
    for length in (LENGTHS[0], *LENGTHS):  # the first translates what is compiled
        made = artificial_finger.recorded(np.random.default_rng(0), SensorErrors(), duration=length)
        began = time.process_time()
        process(method, method.Params(), made)
        seconds.append(time.process_time() - began)
    timed = [
        Metric(f"map, one finger, {length:g} s", took, "s", 20.0 if length == LENGTHS[-1] else None, "lower")
        for length, took in zip(LENGTHS, seconds[1:])
    ]
    growth = seconds[3] / seconds[2]
    return [
        *timed,
        Metric("map, time for 40 s over that for 20 s", growth, "1", 3.0, "lower"),
        Metric("map, peak memory", high_water(), "MB", 2000.0, "lower"),
    ]
