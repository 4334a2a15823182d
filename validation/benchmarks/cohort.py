"""A cohort of one-minute recordings processed by `m2` on one process and on two: what share of the second is used. Starting them counts.

The recordings are copies of one that is simulated, each with a name and a result of its own: every one is read, processed and written.
"""

import shutil
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from handscope.app.exporting import cohort
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.batch import VQF_ALONE, times_real_time_of_vqf
from handscope.validation.benchmarks.costs import time_of_work

RECORDINGS = 200
MINUTE = ("initial_pose", "rom_fist", "rom_spread", "tapping", "rest")


def measure() -> list[Metric]:
    """Processor time of one recording in a process that has done others; seconds on one process and on two, and the parallel efficiency."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        made = simulate(MINUTE, "left", sized("left"), np.random.default_rng(1), SensorErrors())
        paths = _recordings(made, folder)
        block = next(iter(made.samples.values()))
        fused = float(block.t[-1] - block.t[0]) / times_real_time_of_vqf(block)
        one = time_of_work(partial(_process, paths[0], folder / "again"))
        alone, both = (_seconds(paths, folder / f"by-{workers}", workers) for workers in (1, 2))
    return [
        Metric(VQF_ALONE, fused, "CPU s", None, "lower"),
        Metric("one recording", one, "CPU s", 0.2, "lower"),
        Metric(f"{RECORDINGS} recordings, one process", alone, "s", None, "lower"),
        Metric(f"{RECORDINGS} recordings, two processes", both, "s", None, "lower"),
        Metric("parallel efficiency", 100 * alone / (2 * both), "%", 90.0, "higher"),
    ]


def _recordings(made: Simulated, folder: Path) -> list[Path]:
    recording = LoadedRecording(
        made.hand,
        made.geometry,
        made.mounting,
        made.samples,
        made.events,
        source={"device": "simulated"},
    )
    packed = writer.pack(writer.tree(recording, "01", "minute"))
    paths = [folder / f"{k:03d}.zip" for k in range(RECORDINGS)]
    for path in paths:
        path.write_bytes(packed)
    return paths


def _process(path: Path, out: Path) -> None:
    shutil.rmtree(out, ignore_errors=True)
    _require_done([cohort.one(_work(path, out))])


def _work(path: Path, out: Path) -> cohort.Work:
    return cohort.Work(path.stem, str(path), str(out), "m2", {}, None)


def _require_done(outcomes: Sequence[cohort.Outcome]) -> None:
    if failed := [outcome for outcome in outcomes if outcome.state != "done"]:
        raise RuntimeError(f"{failed[0].name}: {failed[0].message}")


def _seconds(paths: list[Path], out: Path, workers: int) -> float:
    began = time.perf_counter()
    outcomes = cohort.all_of(
        [_work(path, out) for path in paths], workers, None, lambda share: None
    )
    took = time.perf_counter() - began
    _require_done(outcomes)
    return took
