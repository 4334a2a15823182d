"""A model of one person's hand for OpenSim 4: bodies, joints with their ranges, a marker at every fingertip. No muscles.

In      a sized hand
Out     XML; the forearm's frame is the wrist frame WCS, each body's frame has the segment's axes and lies at its proximal joint
Source  joints turn about z, x', y'' as docs/conventions.md has them; ranges are those of estimators/hand/anatomy.py
Limits  masses are token values (inverse dynamics would be wrong): the model is for kinematics
"""

import json
from collections.abc import Sequence
from xml.etree import ElementTree as ET

import numpy as np

from handscope.estimators.hand.anatomy import ANGLES, CHAINS, FINGERS, JOINT, JOINTS, Hand, Joint
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.sessions.exports.measured import Origin

AXES = ("0 0 1", "1 0 0", "0 1 0")  # of flexion, deviation, pronation
MASS, INERTIA = 0.01, "1e-06 1e-06 1e-06 0 0 0"  # kg, kg m^2
RADIUS = 0.007  # m, of what is drawn
PALM_DOWN = {"left": (0.0, 0.0, np.pi / 2), "right": (0.0, 0.0, -np.pi / 2)}  # dorsal is up


def model(geometry: HandGeometry, origin: Origin) -> bytes:
    """The .osim file."""
    root = ET.Element("OpenSimDocument", Version="40000")
    hand_model = ET.SubElement(root, "Model", name=f"handscope_{geometry.hand}_hand")
    _text(hand_model, "credits", json.dumps(origin.table(), default=str))
    _text(hand_model, "publications", "frames after Wu 2005 and Salchow-Hoemmen 2019, 2.2.2")
    _text(hand_model, "length_units", "meters")
    _text(hand_model, "force_units", "N")
    _text(hand_model, "gravity", "0 -9.80665 0")
    bodies = _objects(hand_model, "BodySet")
    joints = _objects(hand_model, "JointSet")
    markers = _objects(hand_model, "MarkerSet")
    _body(bodies, "forearm", None)
    _weld(joints, geometry.hand)
    _body(bodies, "hand", None)
    _joint(joints, JOINTS[JOINT["wrist"]], np.zeros(3))
    for f, finger in enumerate(FINGERS):
        places = [geometry.roots()[f], *geometry.chain_offsets()[f]]
        chain = [joint for segment in CHAINS[finger] for joint in JOINTS if joint.child == segment]
        for k, joint in enumerate(chain):
            _body(bodies, joint.child, places[k + 1])
            _joint(joints, joint, places[k])
        marker = ET.SubElement(markers, "Marker", name=f"{finger}_tip")
        _text(marker, "socket_parent_frame", f"/bodyset/{CHAINS[finger][-1]}")
        _text(marker, "location", _vector(places[3]))
        _text(marker, "fixed", "true")
    ET.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root) + b"\n"


def _body(bodies: ET.Element, name: str, end: Array | None) -> None:
    """A segment; with the place of its distal end also something to see."""
    body = ET.SubElement(bodies, "Body", name=name)
    if end is not None:
        components = ET.SubElement(body, "components")
        frame = ET.SubElement(components, "PhysicalOffsetFrame", name=f"{name}_middle")
        drawn = ET.SubElement(ET.SubElement(frame, "attached_geometry"), "Cylinder")
        drawn.set("name", f"{name}_drawn")
        _text(drawn, "socket_frame", "..")
        _text(drawn, "radius", f"{RADIUS}")
        _text(drawn, "half_height", f"{np.linalg.norm(end) / 2:.9f}")
        _text(frame, "socket_parent", "..")
        _text(frame, "translation", _vector(end / 2))
        _text(frame, "orientation", "0 0 0")
    _text(body, "mass", f"{MASS}")
    _text(body, "mass_center", "0 0 0")
    _text(body, "inertia", INERTIA)


def _weld(joints: ET.Element, hand: Hand) -> None:
    """The forearm on the ground, palm down."""
    weld = ET.SubElement(joints, "WeldJoint", name="ground_forearm")
    _frames(weld, ("ground", "/ground", np.zeros(3)), "forearm", PALM_DOWN[hand])


def _joint(joints: ET.Element, joint: Joint, place: Array) -> None:
    made = ET.SubElement(joints, "CustomJoint", name=joint.name)
    _frames(made, (joint.parent, f"/bodyset/{joint.parent}", place), joint.child)
    coordinates = ET.SubElement(made, "coordinates")
    for a in joint.dofs:
        coordinate = ET.SubElement(coordinates, "Coordinate", name=f"{joint.name}_{ANGLES[a]}")
        low, high = np.radians(joint.limits[a])
        _text(coordinate, "default_value", "0")
        _text(coordinate, "range", f"{low:.9f} {high:.9f}")
        _text(coordinate, "clamped", "false")
    transform = ET.SubElement(made, "SpatialTransform")
    for a, axis in enumerate(AXES):
        one = ET.SubElement(transform, "TransformAxis", name=f"rotation{a + 1}")
        free = a in joint.dofs
        _text(one, "coordinates", f"{joint.name}_{ANGLES[a]}" if free else "")
        _text(one, "axis", axis)
        _function(one, "LinearFunction" if free else "Constant")
    for a, axis in enumerate(("1 0 0", "0 1 0", "0 0 1")):
        one = ET.SubElement(transform, "TransformAxis", name=f"translation{a + 1}")
        _text(one, "coordinates", "")
        _text(one, "axis", axis)
        _function(one, "Constant")


def _function(axis: ET.Element, kind: str) -> None:
    function = ET.SubElement(axis, kind, name="function")
    if kind == "LinearFunction":
        _text(function, "coefficients", "1 0")
    else:
        _text(function, "value", "0")


def _frames(
    joint: ET.Element,
    parent: tuple[str, str, Array],
    child: str,
    orientation: Sequence[float] = (0.0, 0.0, 0.0),
) -> None:
    """The joint's two frames: at a place of the parent, and the child's own."""
    name, path, place = parent
    _text(joint, "socket_parent_frame", f"{name}_offset")
    _text(joint, "socket_child_frame", f"{child}_offset")
    frames = ET.SubElement(joint, "frames")
    for label, where, at, turned in (
        (name, path, place, orientation),
        (child, f"/bodyset/{child}", np.zeros(3), (0.0, 0.0, 0.0)),
    ):
        frame = ET.SubElement(frames, "PhysicalOffsetFrame", name=f"{label}_offset")
        _text(frame, "socket_parent", where)
        _text(frame, "translation", _vector(at))
        _text(frame, "orientation", _vector(turned))


def _objects(parent: ET.Element, kind: str) -> ET.Element:
    return ET.SubElement(ET.SubElement(parent, kind), "objects")


def _text(parent: ET.Element, tag: str, words: str) -> None:
    ET.SubElement(parent, tag).text = words


def _vector(values: Sequence[float] | Array) -> str:
    return " ".join(f"{value:.9f}" for value in values)
