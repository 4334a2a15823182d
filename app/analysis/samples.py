"""Small simulated recordings with their truth, made from seeds: `handscope.samples`, `handscope samples`.

Nobody was measured. The files are dedicated to the public domain (CC0 1.0), each says so, and is smaller than 2 MB.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from handscope.app.version import software_version
from handscope.estimators.data.samples import GYR, Block
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.person import draw_person
from handscope.estimators.simulation.scenario import InertialGlove, Simulated, simulate_performances
from handscope.estimators.simulation.sensors import PRESETS
from handscope.estimators.simulation.transmission import LINKS
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from handscope.sessions.motion_bids.truth import truth_files
from handscope.sessions.tables_io.writing import save_file

LICENCE = "CC0"  # of dataset_description.json, as BIDS abbreviates it
LARGEST = 2_000_000  # bytes
BROKEN = ("ring_distal", 10.0)  # sensor, s from which one of its gyroscope's axes reads nothing
TAPPING_HAND = ("hand", *(s for s in SEGMENTS if s.startswith(("thumb", "index"))))
Perform = Callable[[HandGeometry], tuple[Performance, ...]]


@dataclass(frozen=True)
class Sample:
    """What one of them is made from."""

    title: str
    hand: Hand
    seed: int
    perform: Perform  # after the initial pose
    segments: tuple[str, ...] = SEGMENTS
    rate: float = 100.0  # Hz
    link: str = "wired"
    broken: bool = False


def _tapping(rate: float, opening: float) -> Perform:
    """Taps a second, deg of opening."""
    return lambda hand: (task_performance.tapping(hand, 10.0, rate, opening),)


def _fist_and_wrist(hand: HandGeometry) -> tuple[Performance, ...]:
    return (
        task_performance.fist_and_stretch(hand, 2),
        task_performance.TASKS["rom_wrist"](hand),
    )


def _assessment(hand: HandGeometry) -> tuple[Performance, ...]:
    return (
        *_fist_and_wrist(hand),
        task_performance.open_close(hand, 8.0),
        task_performance.tapping(hand, 8.0),
        task_performance.tremor(hand, "tremor_rest", 8.0),
    )


SAMPLES: Mapping[str, Sample] = {
    "tapping_fast": Sample("finger tapping, fast and wide", "right", 101, _tapping(3.2, 40.0), TAPPING_HAND),
    "tapping_slow": Sample("finger tapping, slow", "left", 102, _tapping(1.4, 35.0), TAPPING_HAND),
    "tapping_small": Sample("finger tapping, small", "right", 103, _tapping(2.4, 14.0), TAPPING_HAND),
    "assessment": Sample("fist, wrist, open and close, tapping, tremor at rest", "right", 104, _assessment, rate=30.0),
    "faults": Sample(
        "fist and wrist; samples are lost, and an axis of a gyroscope stops",
        "left",
        105,
        _fist_and_wrist,
        rate=50.0,
        link="wireless",
        broken=True,
    ),
}  # fmt: skip


def make(name: str, folder: str | PathLike[str] = ".") -> Path:
    """Write a small simulated recording with its truth, as FOLDER/NAME.zip (Motion-BIDS).

    Parameters
    ----------
    name
        One of `SAMPLES`.
    folder
        Where it is written; it must exist.

    Returns
    -------
    Path
        Of the file.

    Raises
    ------
    InputError
        For another name, and where there is no such folder.

    Notes
    -----
    Simulated as docs/accuracy.md says; nobody was measured.

    Examples
    --------
    >>> import handscope as hs
    >>> sorted(hs.samples.SAMPLES)
    ['assessment', 'faults', 'tapping_fast', 'tapping_slow', 'tapping_small']
    """
    if name not in SAMPLES:
        raise InputError("analysis.unknown_sample", name=name, samples=", ".join(SAMPLES))
    target = Path(folder) / f"{name}.zip"
    if not target.parent.is_dir():
        raise InputError("analysis.folder_missing", parent=str(target.parent))
    chosen = SAMPLES[name]
    made = _simulate(chosen)
    recording = LoadedRecording(
        made.hand,
        made.geometry,
        made.mounting,
        made.samples,
        made.events,
        source={
            "device": "simulated",
            "software": software_version(),
            "sample": chosen.title,
            "licence": "CC0-1.0",
        },
    )
    label = name.replace("_", "")
    files = dict(writer.tree(recording, "simulated", label, software=software_version()))
    files |= _description(chosen)
    files |= truth_files(made.truth, recording, "simulated", label, software_version())
    save_file(writer.pack(files), target)
    return target


def _description(sample: Sample) -> dict[str, bytes]:
    """The files of the data set that say what it is and under which licence."""
    described = {
        "Name": f"Handscope sample: {sample.title}",
        "BIDSVersion": writer.BIDS_VERSION,
        "DatasetType": "raw",
        "License": LICENCE,
    }
    words = f"Simulated by Handscope from seed {sample.seed}: {sample.title}. Nobody was measured. The truth is in derivatives/truth. Licence: CC0 1.0.\n"
    return {"dataset_description.json": writer.pretty(described), "README": words.encode()}


def _simulate(sample: Sample) -> Simulated:
    of_person, of_sensors = np.random.default_rng(sample.seed).spawn(2)
    person = draw_person(sample.hand, of_person)
    done = (task_performance.initial_pose(person.true), *sample.perform(person.true))
    made = simulate_performances(
        done,
        sample.hand,
        person.true,
        of_sensors,
        PRESETS["MPU-9250"],
        glove=InertialGlove(rate=sample.rate, segments=sample.segments, link=LINKS[sample.link]),
        known=person.declared,
    )
    if not sample.broken:
        return made
    return replace(made, samples={n: _without_axis(b) for n, b in made.samples.items()})


def _without_axis(block: Block) -> Block:
    """The broken sensor's gyroscope reads nothing about its first axis from some instant on."""
    sensor, since = BROKEN
    values = block.values.copy()
    values[block.t >= since, block.stream.sensors.index(sensor), block.stream.axes(GYR).start] = 0.0
    return replace(block, values=values)
