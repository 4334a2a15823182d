"""OpenSim: joint angles (.mot), segment orientations (.sto) and a model of this hand (.osim), all that forward kinematics needs.

Source  OpenSim 4 documents: "Storage (.sto) files", "Motion (.mot) files", CustomJoint and SpatialTransform; the ground is WCS
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

import numpy as np

from handscope.app.exports.skeleton import Bone, bones, tip_offsets
from handscope.app.results.export_content import Content
from handscope.estimators.hand.anatomy import (
    ANGLES,
    DEVIATION,
    FLEXION,
    IS_DOF,
    JOINTS,
    LIMITS,
    PRONATION,
    SEGMENT,
)
from handscope.estimators.numerics.typing import Array
from handscope.sessions.tables_io.trajectory_table import measured_segments

AXES = {FLEXION: "0 0 1", DEVIATION: "1 0 0", PRONATION: "0 1 0"}  # z, then x', then y''
MASS = 0.01  # kg, of every segment: kinematics need one, dynamics need a real one


def write(content: Content) -> Mapping[str, bytes]:
    """The three files by name."""
    return {
        "motion.mot": _motion(content),
        "orientations.sto": _orientations(content),
        "hand.osim": _model(content),
    }


def _table(head: Sequence[str], names: Sequence[str], rows: Sequence[str]) -> bytes:
    return ("\n".join([*head, "endheader", "\t".join(names), *rows]) + "\n").encode()


def _motion(content: Content) -> bytes:
    columns, t = content.angle_columns(), content.moved.t
    values = np.degrees([content.moved.angles[:, j, a] for _, j, a in columns]).T
    head = [
        "Coordinates",
        *(f"{k}={v}" for k, v in content.provenance.items()),
        "version=1",
        f"nRows={len(t)}",
        f"nColumns={1 + len(columns)}",
        "inDegrees=yes",
    ]
    rows = ["\t".join(f"{v:.8g}" for v in (t_k, *row)) for t_k, row in zip(t, values)]
    return _table(head, ["time", *(name for name, _, _ in columns)], rows)


def _orientations(content: Content) -> bytes:
    segments, moved = measured_segments(content.moved), content.moved
    q = moved.q_GS[:, [SEGMENT[s] for s in segments]]
    rate = (len(moved) - 1) / (moved.t[-1] - moved.t[0]) if len(moved) > 1 else 0.0
    head = [
        f"DataRate={rate:.6f}",
        "DataType=Quaternion",
        *(f"{k}={v}" for k, v in content.provenance.items()),
        "version=3",
        "OpenSimVersion=4.6",
    ]
    rows = [
        "\t".join([f"{t_k:.8g}", *(",".join(f"{c:.9g}" for c in one) for one in row)])
        for t_k, row in zip(moved.t, q)
    ]
    return _table(head, ["time", *segments], rows)


def _model(content: Content) -> bytes:
    document = ET.Element("OpenSimDocument", Version="40000")
    model = ET.SubElement(document, "Model", name=f"{content.hand}_hand")
    _text(model, "credits", "; ".join(f"{k} {v}" for k, v in content.provenance.items() if v))
    ET.SubElement(model, "Ground", name="ground")
    skeleton = [Bone("forearm", "ground", np.zeros(3), -1), *bones(content.geometry)]
    _bodies(model, skeleton)
    joints = ET.SubElement(ET.SubElement(model, "JointSet", name="jointset"), "objects")
    for bone in skeleton:
        _weld(joints, bone) if bone.joint < 0 else _joint(joints, bone)
    _markers(model, content)
    ET.indent(document)
    text: bytes = ET.tostring(document, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"


def _text(parent: ET.Element, tag: str, words: str) -> None:
    ET.SubElement(parent, tag).text = words


def _objects(model: ET.Element, kind: str) -> ET.Element:
    return ET.SubElement(ET.SubElement(model, kind, name=kind.lower()), "objects")


def _bodies(model: ET.Element, skeleton: Sequence[Bone]) -> None:
    parent = _objects(model, "BodySet")
    for bone in skeleton:
        body = ET.SubElement(parent, "Body", name=bone.name)
        _text(body, "mass", f"{MASS}")
        _text(body, "mass_center", "0 0 0")
        _text(body, "inertia", "1e-6 1e-6 1e-6 0 0 0")


def _frames(joint: ET.Element, bone: Bone) -> None:
    path = "/ground" if bone.parent == "ground" else f"/bodyset/{bone.parent}"
    _text(joint, "socket_parent_frame", f"{bone.parent}_offset")
    _text(joint, "socket_child_frame", f"{bone.name}_offset")
    frames = ET.SubElement(joint, "frames")
    for name, socket, place in (
        (bone.parent, path, bone.offset),
        (bone.name, f"/bodyset/{bone.name}", np.zeros(3)),
    ):
        frame = ET.SubElement(frames, "PhysicalOffsetFrame", name=f"{name}_offset")
        _text(frame, "socket_parent", socket)
        _text(frame, "translation", _numbers(place))
        _text(frame, "orientation", "0 0 0")


def _weld(joints: ET.Element, bone: Bone) -> None:
    _frames(ET.SubElement(joints, "WeldJoint", name=f"{bone.name}_weld"), bone)


def _joint(joints: ET.Element, bone: Bone) -> None:
    name, free = JOINTS[bone.joint].name, JOINTS[bone.joint].dofs
    joint = ET.SubElement(joints, "CustomJoint", name=name)
    _frames(joint, bone)
    coordinates = ET.SubElement(joint, "coordinates")
    for a in free:
        coordinate = ET.SubElement(coordinates, "Coordinate", name=f"{name}_{ANGLES[a]}")
        _text(coordinate, "default_value", "0")
        _text(coordinate, "range", _numbers(LIMITS[bone.joint, a]))
        _text(coordinate, "clamped", "false")
    transform = ET.SubElement(joint, "SpatialTransform")
    for k, a in enumerate(AXES):
        axis = ET.SubElement(transform, "TransformAxis", name=f"rotation{k + 1}")
        _text(axis, "coordinates", f"{name}_{ANGLES[a]}" if IS_DOF[bone.joint, a] else "")
        _text(axis, "axis", AXES[a])
        _function(axis, bool(IS_DOF[bone.joint, a]))
    for k, direction in enumerate(("1 0 0", "0 1 0", "0 0 1")):
        axis = ET.SubElement(transform, "TransformAxis", name=f"translation{k + 1}")
        _text(axis, "coordinates", "")
        _text(axis, "axis", direction)
        _function(axis, False)


def _function(axis: ET.Element, moves: bool) -> None:
    if moves:
        _text(ET.SubElement(axis, "LinearFunction", name="function"), "coefficients", "1 0")
    else:
        _text(ET.SubElement(axis, "Constant", name="function"), "value", "0")


def _markers(model: ET.Element, content: Content) -> None:
    parent = _objects(model, "MarkerSet")
    for tip, (segment, place) in tip_offsets(content.geometry).items():
        marker = ET.SubElement(parent, "Marker", name=tip)
        _text(marker, "socket_parent_frame", f"/bodyset/{segment}")
        _text(marker, "location", _numbers(place))


def _numbers(values: Array) -> str:
    return " ".join(f"{v:.9g}" for v in values)
