"""A skeleton with joint rotations for animation programs: BioVision Hierarchy, metres, y up.

Channels turn about z, x', y'' in this order: our flexion, deviation, pronation. The format has no place for what it rests on; that lies beside it.
"""

import json

import numpy as np

from handscope.estimators.hand.anatomy import CHAINS, FINGER_JOINTS, FINGERS, JOINT
from handscope.estimators.hand.joint_angles import decompose
from handscope.estimators.numerics.typing import Array
from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.exports.skeleton import Skeleton, rate, skeleton

ROTATION = "Zrotation Xrotation Yrotation"


def write(measured: Measured) -> Exported:
    """The hierarchy and its motion; what it rests on as JSON beside it."""
    bones = skeleton(measured, evenly=True)
    columns = [np.zeros((len(bones.t), 3)), np.degrees(decompose(bones.q_WF))]
    joints = ["wrist", *(j for f in bones.fingers for j in FINGER_JOINTS[f])]
    columns += [np.degrees(bones.angles[:, JOINT[joint]]) for joint in joints]
    rows = np.concatenate(columns, axis=1)
    head = [
        "HIERARCHY",
        *_hierarchy(bones),
        "MOTION",
        f"Frames: {len(rows)}",
        f"Frame Time: {1 / rate(bones.t):.9f}",
    ]
    motion = [" ".join(f"{value:.6f}" for value in row) for row in rows.tolist()]
    about = measured.origin.table() | {"unit": "m", "up": "y", "notices": list(bones.notices)}
    return Exported(
        {
            "": "\n".join([*head, *motion, ""]).encode(),
            ".json": json.dumps(about, indent=1).encode(),
        },
        bones.notices,
    )


def _hierarchy(bones: Skeleton) -> list[str]:
    roots, offsets = bones.geometry.roots(), bones.geometry.chain_offsets()
    lines = ["ROOT forearm", "{", f"  {_offset(np.zeros(3))}"]
    lines += [f"  CHANNELS 6 Xposition Yposition Zposition {ROTATION}", "  JOINT hand", "  {"]
    lines += [f"    {_offset(np.zeros(3))}", f"    CHANNELS 3 {ROTATION}"]
    if not bones.fingers:
        lines += ["    End Site", "    {", f"      {_offset(np.zeros(3))}", "    }"]
    for finger in bones.fingers:
        f = FINGERS.index(finger)
        places = [roots[f], *offsets[f]]
        for k, segment in enumerate(CHAINS[finger]):
            pad = "  " * (k + 2)
            lines += [f"{pad}JOINT {segment}", f"{pad}{{", f"{pad}  {_offset(places[k])}"]
            lines += [f"{pad}  CHANNELS 3 {ROTATION}"]
        pad = "  " * 5
        lines += [f"{pad}End Site", f"{pad}{{", f"{pad}  {_offset(places[3])}", f"{pad}}}"]
        lines += ["  " * (k + 2) + "}" for k in (2, 1, 0)]
    return [*lines, "  }", "}"]


def _offset(place: Array) -> str:
    return "OFFSET " + " ".join(f"{value:.7f}" for value in place)
