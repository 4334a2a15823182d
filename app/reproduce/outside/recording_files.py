"""A pinch as Motion-BIDS files, written from the standard alone."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from app.reproduce.outside.force_sensors import COUNT, channel
from app.reproduce.outside.hand import SEGMENTS, Values
from app.reproduce.outside.pinch import INERTIAL, Pinch

FINGERS = ("thumb", "index")


def written(folder: Path, pinch: Pinch, hand: Mapping[str, object], forces: tuple[Values, Values], setups: Mapping[str, object]) -> None:
    """Into a folder: inertial sensors, force sensors (times, newtons), events. With `setups` forces are written as counts of what these calibrate."""
    task = "squeeze" if pinch.held.mass is None else "lift"
    motion = folder / "sub-01" / "motion"
    motion.mkdir(parents=True)
    said = {"Name": "a pinch", "BIDSVersion": "1.9.0", "DatasetType": "raw"}
    (folder / "dataset_description.json").write_text(json.dumps(said))
    stem = f"{motion}/sub-01_task-{task}"
    sidecar = {"TaskName": task, "MeasuredHand": "left" if pinch.hand.sign > 0 else "right"}
    columns = [
        f"{s}_{what}_{axis}\t{axis}\t{kind}\t{s}\t{unit}"
        for s in SEGMENTS
        for what, kind, unit in (("gyro", "GYRO", "rad/s"), ("acc", "ACCEL", "m/s^2"))
        for axis in "xyz"
    ]
    rows = pinch.inertial.reshape(len(pinch.rows), -1)
    _system(stem, "imu", pinch.t[pinch.rows], rows, columns, {**sidecar, "SamplingFrequency": INERTIAL, "HandGeometry": hand})
    t, felt = forces
    unit = "count" if setups else "N"
    columns = [f"{channel(f, axis)}\t{axis}\tMISC\t{f}_tip_force\t{unit}" for f in FINGERS for axis in "xyz"]
    rate = 1 / float(np.median(np.diff(t)))
    more = {"ForceSetup": setups} if setups else {}
    values = felt.reshape(len(t), -1) / (COUNT if setups else 1.0)
    _system(stem, "force", t, values, columns, {**sidecar, "SamplingFrequency": rate, **more})
    onset, end = pinch.task
    Path(f"{stem}_events.tsv").write_text(
        f"onset\tduration\ttrial_type\ttask_name\n0.3\t3.6\tinitial_pose\tn/a\n{onset:.3f}\t{end - onset:.3f}\ttask\t{task}\n"
    )


def _system(stem: str, name: str, t: Values, values: Values, columns: Sequence[str], sidecar: Mapping[str, object]) -> None:
    stem = f"{stem}_tracksys-{name}"
    head = "name\tcomponent\ttype\ttracked_point\tunits\nlatency\tn/a\tLATENCY\tn/a\ts\n"
    Path(f"{stem}_channels.tsv").write_text(head + "".join(f"{column}\n" for column in columns))
    np.savetxt(f"{stem}_motion.tsv", np.column_stack([t, values]), delimiter="\t", fmt="%.9g")
    Path(f"{stem}_motion.json").write_text(json.dumps({"TrackingSystemName": name, **sidecar}))
