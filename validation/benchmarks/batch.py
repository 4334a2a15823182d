"""The methods in batch: times real time over a minute and peak memory over ten."""

import multiprocessing
import statistics
import tempfile
import time

import numpy as np
from vqf import VQF

from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import METHODS
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.magnetic_field import homogeneous
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.benchmarks import Metric, peak

SENSORS = tuple(s for s in SEGMENTS if s != "forearm")
MINUTE = ("initial_pose", "rom_fist", "rom_spread", "tapping", "rest")
REPEATS = 5
SPEED_TARGETS = {"b": 500.0, "m1": 500.0, "m2": 500.0, "ekf": 50.0}
FAST = 200.0  # Hz, the thesis' rate
FAST_TARGETS = {"ekf": 50.0}
MEMORY_TARGET = 300.0  # MB for ten minutes


def measure() -> list[Metric]:
    """Each method on one minute; memory on one and ten minutes in processes of their own."""
    recording = recording_of(MINUTE)
    found = [
        Metric(
            "VQF alone (yardstick)",
            _yardstick(recording.samples["imu"]),
            "x real time",
            None,
            "higher",
        )
    ]
    found += [
        Metric(
            f"{name} speed", _speed(name, recording), "x real time", SPEED_TARGETS[name], "higher"
        )
        for name in METHODS
    ]
    fast = recording_of(MINUTE, FAST)
    found += [
        Metric(f"{name} speed at 200 Hz", _speed(name, fast), "x real time", target, "higher")
        for name, target in FAST_TARGETS.items()
    ]
    one, ten = _memory(1), _memory(10)
    found.append(Metric("m2 memory of 10 min", ten, "MB", MEMORY_TARGET, "lower"))
    found.append(Metric("m2 memory growth", (ten - one) / 9, "MB per min", None, "lower"))
    return found


def _speed(name: str, recording: Simulated) -> float:
    """Times real time."""
    method, seconds = METHODS[name], []
    for _ in range(REPEATS):
        began = time.perf_counter()
        process(method, method.Params(), recording)
        seconds.append(time.perf_counter() - began)
    return float(recording.truth.t[-1]) / statistics.median(seconds)


def _yardstick(block: Block) -> float:
    """Times real time of the library's filter alone, sensor after sensor: how fast the machine is at this hour."""
    gyr, acc = (np.moveaxis(block.of(q), 1, 0).copy() for q in (GYR, ACC))
    seconds = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        for turning, pushed in zip(gyr, acc):
            VQF(1.0 / block.stream.rate).updateBatch(turning, pushed)
        seconds.append(time.perf_counter() - began)
    return float(block.t[-1] - block.t[0]) / statistics.median(seconds)


def recording_of(tasks: tuple[str, ...], rate: float = 100.0) -> Simulated:
    """A left hand of 16 sensors that does the tasks."""
    return simulate(
        tasks,
        "left",
        sized("left"),
        np.random.default_rng(1),
        SensorErrors(),
        SENSORS,
        rate=rate,
        field=homogeneous(),
    )


def _memory(minutes: int) -> float:
    """Peak resident memory in MB of a process that only loads and processes a recording of so many minutes."""
    recording = recording_of(MINUTE + MINUTE[1:] * (minutes - 1))
    block = recording.samples["imu"]
    with tempfile.TemporaryDirectory() as folder:
        np.save(f"{folder}/t.npy", block.t)
        np.save(f"{folder}/values.npy", block.values)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            return float(pool.apply(peak.of_processing, (folder, block.stream, recording.events)))
