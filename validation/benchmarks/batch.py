"""The methods in batch: times real time over a minute and peak memory over ten."""

import multiprocessing
import tempfile
from functools import partial
from typing import Any

import numpy as np
from vqf import VQF

from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.finger_ekf.pose_error import pose_inference
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import METHODS
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation.magnetic_field import homogeneous
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.benchmarks import Metric, costs
from handscope.validation.benchmarks.costs import time_of_work

VQF_ALONE = "VQF alone (yardstick)"

SENSORS = tuple(s for s in SEGMENTS if s != "forearm")
MINUTE = ("initial_pose", "rom_fist", "rom_spread", "tapping", "rest")
SPEED_TARGETS = {"b": 500.0, "m1": 500.0, "m2": 1000.0, "ekf": 300.0}
FAST = 200.0  # Hz, the thesis' rate
FAST_TARGETS = {"ekf": 50.0}
MEMORY_TARGET = 200.0  # MB for ten minutes


def measure() -> list[Metric]:
    """Each method on one minute, by processor time; memory on one and ten minutes in processes of their own."""
    recording = recording_of(MINUTE)
    alone = times_real_time_of_vqf(recording.samples["imu"])
    found = [Metric(VQF_ALONE, alone, "x real time", None, "higher")]
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
    one, _ = _memory(1, "m2")
    for name in ("m2", "ekf"):
        ten, own = _memory(10, name)
        found.append(Metric(f"{name} memory of 10 min", ten, "MB", MEMORY_TARGET, "lower"))
        found.append(Metric(f"{name} own memory of 10 min", own, "MB", None, "lower"))
        if name == "m2":
            found.append(Metric("m2 memory growth", (ten - one) / 9, "MB per min", None, "lower"))
    return found


def _speed(name: str, recording: Simulated) -> float:
    """Times real time."""
    seconds = time_of_work(partial(_process_as_new, METHODS[name], recording))
    return float(recording.truth.t[-1]) / seconds


def _process_as_new(method: Any, recording: Simulated) -> None:
    """Without what is kept of a recording that was processed before."""
    pose_inference.posterior.cache_clear()
    process(method, method.Params(), recording)


def times_real_time_of_vqf(block: Block) -> float:
    """Times real time of the library's filter alone, sensor after sensor: how fast the machine is at this hour."""
    gyr, acc = (np.moveaxis(block.of(q), 1, 0).copy() for q in (GYR, ACC))

    def fuse() -> None:
        for turning, pushed in zip(gyr, acc):
            VQF(1.0 / block.stream.rate).updateBatch(turning, pushed)

    return float(block.t[-1] - block.t[0]) / time_of_work(fuse)


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


def _memory(minutes: int, method: str) -> tuple[float, float]:
    """Peak resident memory in MB of a process that only loads and processes a recording of so many minutes, and its own of that (costs.py)."""
    recording = recording_of(MINUTE + MINUTE[1:] * (minutes - 1))
    block = recording.samples["imu"]
    with tempfile.TemporaryDirectory() as folder:
        np.save(f"{folder}/t.npy", block.t)
        np.save(f"{folder}/values.npy", block.values)
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            return pool.apply(
                costs.memory_of_processing, (folder, block.stream, recording.events, method)
            )
