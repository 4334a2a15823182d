"""Files for OpenSim: joint angles (.mot), segment orientations (.sto) and a model of this hand (.osim).

The .mot names the model's coordinates (`index_pip_flexion`), so the model moves by it as it stands. Orientations are in OpenSim's ground, y up.
"""

import json

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import ANGLES, JOINTS, SEGMENT
from handscope.estimators.messages.sentence import codes_of, phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.sessions.exports.measured import Exported, Measured, Origin
from handscope.sessions.exports.opensim_model import model
from handscope.sessions.exports.skeleton import (
    Y_UP,
    fill,
    fill_rotations,
    in_continuous_signs,
    skeleton,
)
from handscope.sessions.tables_io.trajectory_table import measured_segments

OF_DRAWINGS = frozenset({"export.wrist_neutral", "export.finger_left_out"})  # there are no bones


def write(measured: Measured) -> Exported:
    """The three files of a folder."""
    moved, origin = measured.movement, measured.origin
    notices = [n for n in skeleton(measured).notices if not codes_of(n) & OF_DRAWINGS]
    names, angles = _angles(moved)
    absent = [
        f"{joint.name}_{ANGLES[a]}"
        for joint in JOINTS
        for a in joint.dofs
        if f"{joint.name}_{ANGLES[a]}" not in names
    ]
    if absent:
        notices.append(phrase("export.not_in_motion", names=", ".join(absent)))
    head = ["handscope", "version=1", f"nRows={len(moved)}", f"nColumns={len(names) + 1}"]
    motion = [*head, "inDegrees=yes", *_facts(origin), "endheader", "\t".join(["time", *names])]
    motion += _rows(moved.t, [[f"{v:.6f}" for v in row] for row in np.degrees(angles).tolist()])
    return Exported(
        {
            "motion.mot": _text(motion),
            "orientations.sto": _text(_orientations(moved, origin)),
            "hand.osim": model(measured.geometry, origin),
        },
        tuple(notices),
    )


def _angles(moved: Trajectory) -> tuple[list[str], Array]:
    """Names and values (n, columns) rad of every freedom that was measured, without gaps."""
    freedoms = [(j, joint, a) for j, joint in enumerate(JOINTS) for a in joint.dofs]
    known = [(j, joint, a) for j, joint, a in freedoms if np.isfinite(moved.angles[:, j, a]).any()]
    names = [f"{joint.name}_{ANGLES[a]}" for _, joint, a in known]
    columns = [moved.angles[:, j, a] for j, _, a in known]
    return names, fill(np.column_stack(columns)) if columns else np.empty((len(moved), 0))


def _orientations(moved: Trajectory, origin: Origin) -> list[str]:
    segments = measured_segments(moved)
    head = [f"DataRate={_rate(moved.t):.6f}", "DataType=Quaternion", "version=3"]
    head += ["OpenSimVersion=4.4", *_facts(origin), "endheader", "\t".join(["time", *segments])]
    turned = [
        in_continuous_signs(
            quat.multiply(
                np.broadcast_to(Y_UP, (len(moved), 4)),
                fill_rotations(moved.q_GS[:, SEGMENT[segment]]),
            )
        ).tolist()
        for segment in segments
    ]
    cells = [[",".join(f"{v:.9f}" for v in q) for q in row] for row in zip(*turned)]
    return [*head, *_rows(moved.t, cells)]


def _facts(origin: Origin) -> list[str]:
    """Where it came from, as `key=value` lines of the header."""
    return [
        f"{key}={json.dumps(value, default=str) if not isinstance(value, str) else value}"
        for key, value in origin.table().items()
    ]


def _rows(t: Array, cells: list[list[str]]) -> list[str]:
    return ["\t".join([f"{time:.6f}", *row]) for time, row in zip(t.tolist(), cells)]


def _text(lines: list[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()


def _rate(t: Array) -> float:
    return 1.0 / float(np.median(np.diff(t))) if len(t) > 1 else 100.0
