"""A cohort of one-minute recordings processed by `m2` on one process and on two: what share of the second is used. Starting them counts.

The recordings are copies of one that is simulated, each with a name and a result of its own: every one is read, processed and written.
"""

import tempfile
import time
from pathlib import Path

import numpy as np

from handscope.app.exporting import cohort
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from handscope.validation.benchmarks import Metric

RECORDINGS = 200
MINUTE = ("initial_pose", "rom_fist", "rom_spread", "tapping", "rest")


def measure() -> list[Metric]:
    """Seconds on one process and on two, and the parallel efficiency."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = _recordings(folder)
        alone, both = (_seconds(paths, folder / f"by-{workers}", workers) for workers in (1, 2))
    return [
        Metric(f"{RECORDINGS} recordings, one process", alone, "s", None, "lower"),
        Metric(f"{RECORDINGS} recordings, two processes", both, "s", None, "lower"),
        Metric("parallel efficiency", 100 * alone / (2 * both), "%", 90.0, "higher"),
    ]


def _recordings(folder: Path) -> list[Path]:
    made = simulate(MINUTE, "left", sized("left"), np.random.default_rng(1), SensorErrors())
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


def _seconds(paths: list[Path], out: Path, workers: int) -> float:
    works = [cohort.Work(path.stem, str(path), str(out), "m2", {}, None) for path in paths]
    began = time.perf_counter()
    outcomes = cohort.all_of(works, workers, None, lambda share: None)
    took = time.perf_counter() - began
    if failed := [outcome for outcome in outcomes if outcome.state != "done"]:
        raise RuntimeError(f"{failed[0].name}: {failed[0].message}")
    return took
