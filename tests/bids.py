"""A small Motion-BIDS recording as files in memory, to be written, changed and broken by tests."""

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.data.samples import FORCE, MAG, TORQUE, Block, Event, Stream
from handscope.estimators.numerics import quaternions as quat
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from tests.simulated import in_strips, loaded

Files = dict[str, bytes]
BASE = "sub-01/motion/sub-01_task-hand"
N = 30
PLATE = Plate(
    {"trunk_mag_1": (0.0, 0.0, 0.0), "trunk_mag_2": (0.0, -0.1, 0.0)},
    (0.0, 0.0, 0.32),
    (0.005, 0.03, 0.0),
    49.8e-6,
    1.19,
)


def recording() -> LoadedRecording:
    """Two strips of different rates, a magnetometer and a force sensor with six axes; a missing sample and events with details."""
    rng, strips = np.random.default_rng(7), in_strips("left").samples
    index, forearm = (
        Block(strips[n].stream, strips[n].t[:N] + 0.1, strips[n].values[:N].copy())
        for n in ("index", "forearm")
    )
    hand = Block(strips["hand"].stream, strips["hand"].t[:N], strips["hand"].values[:N].copy())
    index.values[3, 1] = np.nan
    index.values[4, 0, 2] = np.nan
    mag = Block(
        Stream("mag", ("hand", "index_distal"), (MAG,), 20.0),
        np.arange(8) / 20,
        rng.normal(size=(8, 2, 3)) * 5e-5,
    )
    force = Block(
        Stream("force", ("thumb_tip_force",), (FORCE, TORQUE), 12.0),
        np.arange(5) / 12,
        rng.normal(size=(5, 1, 6)),
    )
    force.values[2, 0, 4] = np.nan
    pose = {
        "thumb_cmc_flexion_deg": 0.0,
        "thumb_cmc_deviation_deg": -45.0,
        "thumb_cmc_pronation_deg": 60.0,
    }
    events = (
        Event(0.05, 0.1, "initial_pose", pose),
        Event(0.15, 0.1, "task", {"task_name": "rom", "note": None}),
        Event(0.2, 0.0, "annotation", {"note": "a\ttab, a line\nbreak\x0b and ü"}),
    )
    array = Block(
        Stream("array", ("trunk_mag_1", "trunk_mag_2"), (MAG,), 75.0),
        np.arange(9) / 75,
        rng.normal(size=(9, 2, 3)) * 5e-5,
    )
    samples = {
        "hand": hand,
        "index": index,
        "forearm": forearm,
        "mag": mag,
        "force": force,
        "array": array,
    }
    mounting = {"index_distal": quat.exp(np.array([0.1, 0.2, 0.3])), "hand": quat.IDENTITY}
    return replace(
        loaded(in_strips("left")), samples=samples, events=events, mounting=mounting, plate=PLATE
    )


def dataset(source: LoadedRecording | None = None) -> Files:
    return {
        name: bytes(data) for name, data in writer.tree(source or recording(), "01", "hand").items()
    }


def folder(files: Mapping[str, bytes], place: Path) -> Path:
    for name, data in files.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(data)
    return place


def packed(
    files: Mapping[str, bytes], change: Callable[[zipfile.ZipInfo], None] = lambda entry: None
) -> bytes:
    """A zip; `change` may set what a malicious zip would."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name)
            change(entry)
            archive.writestr(entry, data, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def with_sidecar(files: Files, system: str, **changes: Any) -> Files:
    """Entries of a motion.json replaced; None takes one out."""
    name = f"{BASE}_tracksys-{system}_motion.json"
    table = {**json.loads(files[name]), **changes}
    return files | {name: json.dumps({k: v for k, v in table.items() if v is not None}).encode()}


def with_text(files: Files, suffix: str, change: Callable[[str], str]) -> Files:
    """The file BASE + suffix with its text changed; the change must change something."""
    name = BASE + suffix
    before = files[name].decode()
    after = change(before)
    assert after != before
    return files | {name: after.encode()}


def with_line(files: Files, suffix: str, number: int, change: Callable[[str], str]) -> Files:
    """The same for one line, counted from 1."""

    def lines(text: str) -> str:
        parts = text.split("\n")
        parts[number - 1] = change(parts[number - 1])
        return "\n".join(parts)

    return with_text(files, suffix, lines)


def without(files: Files, *suffixes: str) -> Files:
    gone = {BASE + s for s in suffixes}
    assert gone <= set(files)
    return {name: data for name, data in files.items() if name not in gone}
