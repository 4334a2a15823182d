"""What every export is made of: a recording, what a method made of it, and where both are from."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from handscope.app.version import software_version
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import ANGLES, FINGERS, IS_DOF, JOINTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures.accuracy import accuracy_of
from handscope.estimators.measures.assessment import TaskResult, assess
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import Processed
from handscope.sessions.files.recording import LoadedRecording


@dataclass(frozen=True)
class Content:
    """One recording processed. Holds no name and no date of birth: nothing that is written from it can tell them."""

    recording: LoadedRecording
    processed: Processed
    method: str
    params: Any

    @property
    def moved(self) -> Trajectory:
        return self.processed.trajectory

    @property
    def hand(self) -> Hand:
        return self.recording.hand

    @property
    def geometry(self) -> HandGeometry:
        return self.processed.calibrations[0].geometry

    @cached_property
    def provenance(self) -> Mapping[str, str]:
        """In words: software, method and its changed options, the recording's hash, whether it was simulated."""
        source = self.recording.source
        device = str(source.get("device", ""))
        return {
            "software": f"Handscope {software_version()}",
            "method": self.method,
            "options": ", ".join(f"{k}={v}" for k, v in _changed_options(self.params).items()),
            "recording_sha256": self.recording.checksum,
            "hand": self.hand,
            "simulated": "yes"
            if "simulat" in device.lower() or "virtual" in device.lower()
            else "no",
        }

    @cached_property
    def tasks(self) -> list[TaskResult]:
        """The measures of all tasks, as `handscope assess` has them."""
        accuracy = accuracy_of(self.method, self.processed.calibrations)
        return assess(self.moved, self.recording.events, self.geometry, accuracy)

    def measured_joints(self) -> list[int]:
        """Joints with an angle at any time, by their place in JOINTS."""
        known = np.isfinite(self.moved.angles).any(axis=0) & IS_DOF
        return [int(j) for j in np.flatnonzero(known.any(axis=1))]

    def missing_joints(self) -> list[str]:
        """Names of the joints that were not measured."""
        measured = set(self.measured_joints())
        return [joint.name for j, joint in enumerate(JOINTS) if j not in measured]

    def measured_fingers(self) -> list[str]:
        """Fingers with a tip at any time."""
        return [f for k, f in enumerate(FINGERS) if np.isfinite(self.moved.tips[:, k, 0]).any()]

    def angle_columns(self) -> list[tuple[str, int, int]]:
        """Name, joint and axis of every freedom that was measured: `index_pip_flexion`."""
        return [
            (f"{JOINTS[j].name}_{ANGLES[a]}", j, a)
            for j in self.measured_joints()
            for a in JOINTS[j].dofs
        ]

    def require_movement(self) -> None:
        """InputError where the method gave nothing to write."""
        if not len(self.moved) or not self.measured_joints():
            raise InputError(
                f"the recording gave no joint angle by {self.method}; there is nothing to export"
            )


def _changed_options(params: Any) -> dict[str, object]:
    """Options that are not at their defaults."""
    return {
        f.name: value for f in fields(params) if (value := getattr(params, f.name)) != f.default
    }


def hold_known(values: Array) -> Array:
    """(n, ...) with gaps filled by the value before, those at the beginning by the first; 0 where nothing is known."""
    flat = values.reshape(len(values), -1).copy()
    rows = np.arange(len(flat))
    for column in flat.T:
        known = np.isfinite(column)
        if known.any():
            newest = np.maximum.accumulate(np.where(known, rows, -1))
            column[:] = column[np.where(newest < 0, np.argmax(known), newest)]
        else:
            column[:] = 0.0
    return flat.reshape(values.shape)
