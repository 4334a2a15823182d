"""A pinch as Motion-BIDS files, written from the standard alone."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from handscope.validation.independent.simulator.force_sensors import COUNT, channel
from handscope.validation.independent.simulator.hand import SEGMENTS, Values
from handscope.validation.independent.simulator.motion_files import axes, write_system
from handscope.validation.independent.simulator.pinch import INERTIAL, Pinch

FINGERS = ("thumb", "index")


def written(
    folder: Path,
    pinch: Pinch,
    hand: Mapping[str, object],
    forces: tuple[Values, Values],
    setups: Mapping[str, object],
) -> None:
    """Into a folder: inertial sensors, force sensors (times, newtons), events. With `setups` forces are written as counts of what these calibrate."""
    task = "squeeze" if pinch.held.mass is None else "lift"
    motion = folder / "sub-01" / "motion"
    motion.mkdir(parents=True)
    description = {"Name": "a pinch", "BIDSVersion": "1.9.0", "DatasetType": "raw"}
    (folder / "dataset_description.json").write_text(json.dumps(description))
    stem = f"{motion}/sub-01_task-{task}"
    sidecar = {"TaskName": task, "MeasuredHand": "left" if pinch.hand.sign > 0 else "right"}
    columns = [
        column
        for s in SEGMENTS
        for column in (*axes(s, "gyro", "GYRO", "rad/s"), *axes(s, "acc", "ACCEL", "m/s^2"))
    ]
    rows = pinch.inertial.reshape(len(pinch.rows), -1)
    write_system(
        stem,
        "imu",
        pinch.t[pinch.rows],
        rows,
        columns,
        {**sidecar, "SamplingFrequency": INERTIAL, "HandGeometry": hand},
    )
    t, felt = forces
    unit = "count" if setups else "N"
    columns = [
        (channel(f, axis), axis, "MISC", f"{f}_tip_force", unit) for f in FINGERS for axis in "xyz"
    ]
    rate = 1 / float(np.median(np.diff(t)))
    more = {"ForceSetup": setups} if setups else {}
    values = felt.reshape(len(t), -1) / (COUNT if setups else 1.0)
    write_system(stem, "force", t, values, columns, {**sidecar, "SamplingFrequency": rate, **more})
    onset, end = pinch.task
    Path(f"{stem}_events.tsv").write_text(
        f"onset\tduration\ttrial_type\ttask_name\n0.3\t3.6\tinitial_pose\tn/a\n{onset:.3f}\t{end - onset:.3f}\ttask\t{task}\n"
    )
