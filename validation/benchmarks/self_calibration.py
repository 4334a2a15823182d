"""Self-calibration of one finger and of a whole hand: time over the recording's length, memory."""

import time
from collections.abc import Callable

import numpy as np

from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import BATCH
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation import artificial_finger
from handscope.estimators.simulation.movements import free_movement
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.costs import high_water

LENGTHS = (10.0, 20.0, 40.0)  # s
# s of time that 40 s of one finger, and of a whole hand of 16 sensors, may take
FINGER, HAND = 20.0, 20.0
MEMORY = 500.0  # MB


def measure() -> list[Metric]:
    """By the clock and on the processor: the whole method, from samples to angles with standard deviations; fingers are solved two at a time."""
    _seconds(_finger(LENGTHS[0]))  # translates what is compiled
    return [
        *_time("one finger", _finger, LENGTHS, FINGER),
        *_time("whole hand", _hand, LENGTHS[1:], HAND),
        Metric("map, peak memory", high_water(), "MB", MEMORY, "lower"),
    ]


def _time(
    name: str, recorded: Callable[[float], Simulated], lengths: tuple[float, ...], most: float
) -> list[Metric]:
    clock, worked = np.transpose([_seconds(recorded(length)) for length in lengths])
    timed = [
        metric
        for length, waited, processor in zip(lengths, clock, worked)
        for metric in (
            Metric(
                f"map, {name}, {length:g} s",
                float(waited),
                "s",
                most if length == LENGTHS[-1] else None,
                "lower",
            ),
            Metric(
                f"map, {name}, {length:g} s, on the processor", float(processor), "s", None, "lower"
            ),
        )
    ]
    return [
        *timed,
        Metric(
            f"map, {name}, time for 40 s over that for 20 s",
            float(worked[-1] / worked[-2]),
            "1",
            3.0,
            "lower",
        ),
    ]


def _seconds(made: Simulated) -> tuple[float, float]:
    method, began, worked = BATCH["map"], time.perf_counter(), time.process_time()
    process(method, method.Params(), made)
    return time.perf_counter() - began, time.process_time() - worked


def _finger(length: float) -> Simulated:
    return artificial_finger.record_trial(np.random.default_rng(0), SensorErrors(), duration=length)


def _hand(length: float) -> Simulated:
    return free_movement.record_trial(
        np.random.default_rng(0),
        SensorErrors(),
        "left",
        sized("left"),
        sized("left"),
        duration=length,
    )
