"""What starting costs: a server to its first page, and commands, beside importing numpy and scipy in the same run."""

import tempfile
import time
import urllib.request
from pathlib import Path

import numpy as np

from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from handscope.sessions.table_import.column_map import ColumnMap, MappedSensor
from handscope.sessions.table_import.convert import write_native
from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.costs import time_of_python
from handscope.validation.benchmarks.server_under_test import Client, server

IMPORTS = "import numpy, scipy.special"
TASKS = ("initial_pose", "rom_fist", "tapping", "rest")  # 40 s


def measure() -> list[Metric]:
    """Seconds until the patients page and its data are there; processor time of commands."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        return [
            Metric("start to first page", _first_page(folder / "data"), "s", 5.0, "lower"),
            *_commands(folder),
        ]


def _first_page(data: Path) -> float:
    data.mkdir()
    began = time.monotonic()
    with server(data) as (address, _):
        client = Client(address)
        with urllib.request.urlopen(
            urllib.request.Request(client.base + "/", headers={"Cookie": client.cookie})
        ) as page:
            page.read()
        client.call("GET", "/api/patients")
        return time.monotonic() - began


def _commands(folder: Path) -> list[Metric]:
    made = simulate(TASKS, "left", sized("left"), np.random.default_rng(1), SensorErrors())
    _write(made, folder)
    handscope = ("-m", "handscope.app.cli")
    process = (*handscope, "process", "--method", "m2", "--out", str(folder))
    wanted = (
        (f"{IMPORTS} (yardstick)", ("-c", IMPORTS), None),
        ("handscope --help", (*handscope, "--help"), 0.15),
        ("handscope process --help", (*handscope, "process", "--help"), 0.15),
        ("process of 40 s, native", (*process, str(folder / "r.mcap")), 1.0),
        ("process of 40 s, Motion-BIDS", (*process, str(folder / "r.zip")), 1.5),
    )
    return [
        Metric(name, time_of_python(words), "CPU s", target, "lower")
        for name, words, target in wanted
    ]


def _write(made: Simulated, folder: Path) -> None:
    """The recording in both formats."""
    recording = LoadedRecording(
        made.hand, made.geometry, made.mounting, made.samples, made.events, source={}
    )
    (folder / "r.zip").write_bytes(writer.pack(writer.tree(recording, "01", "start")))
    sensors = {p: MappedSensor({}) for block in made.samples.values() for p in block.stream.sensors}
    columns = ColumnMap(made.hand, sensors)
    write_native(list(made.samples.values()), columns, made.events, folder / "r.mcap", {})
