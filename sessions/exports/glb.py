"""The hand in motion for 3-D programs: binary glTF 2.0, metres, y up, a skeleton of bones and the skin of our scene on it.

Nodes: forearm (the wrist frame, turned as it was in the world), hand, a segment each, `<finger>_tip`; half-way bones carry the skin over each joint.
"""

import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from handscope.estimators.hand.anatomy import CHAINS, FINGERS, JOINT, JOINTS
from handscope.estimators.numerics.typing import Array, Indices
from handscope.sessions.exports.measured import Exported, Measured, Skin, SkinPart
from handscope.sessions.exports.skeleton import Skeleton, in_continuous_signs, skeleton

FLOAT, BYTE, INT = 5126, 5121, 5125  # component types
VERTICES, INDICES = 34962, 34963  # buffer targets
FOREARM, HAND = 0, 1  # nodes
STILL = 1e-7  # m: what moves less than this does not move
KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


@dataclass(frozen=True)
class Tracks:
    """What moves, by the node's number: rotations (n, 4), places (n, 3) m."""

    turns: dict[int, Array]
    places: dict[int, Array]


class Binary:
    """Grows the file's one buffer; each array becomes an accessor."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: Array | Indices, kind: int = FLOAT, target: int | None = None) -> int:
        """Number of the accessor of values (n,) or (n, k)."""
        dtype = {FLOAT: np.float32, BYTE: np.uint8, INT: np.uint32}[kind]
        flat = np.ascontiguousarray(values, dtype)
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": flat.nbytes}
        self.views.append(view | ({"target": target} if target else {}))
        self.data += flat.tobytes()
        width = 1 if flat.ndim == 1 else flat.shape[1]
        accessor = {"bufferView": len(self.views) - 1, "componentType": kind, "count": len(flat)}
        if kind == FLOAT and width in (1, 3):
            rows = flat.reshape(len(flat), width)
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self.accessors.append(accessor | {"type": KINDS[width]})
        return len(self.accessors) - 1


def write(measured: Measured) -> Exported:
    """The file; the skin is left out where none is given."""
    bones, binary = skeleton(measured), Binary()
    nodes, tracks = _bones(bones)
    document: dict[str, Any] = {
        "asset": {
            "version": "2.0",
            "generator": f"handscope {measured.origin.software}",
            "extras": {**measured.origin.table(), "notices": list(bones.notices)},
        },
        "scene": 0,
        "scenes": [{"nodes": [FOREARM]}],
        "nodes": nodes,
    }
    if measured.skin is not None:
        skin = measured.skin(bones.geometry, bones.angles)
        _add_skin(document, binary, skin, bones.fingers, tracks)
    document["animations"] = [_animation(binary, bones.t, tracks)]
    document |= {"accessors": binary.accessors, "bufferViews": binary.views}
    binary.data += b"\0" * (-len(binary.data) % 4)
    document["buffers"] = [{"byteLength": len(binary.data)}]
    return Exported({"": _pack_container(document, bytes(binary.data))}, bones.notices)


def _bones(bones: Skeleton) -> tuple[list[dict[str, Any]], Tracks]:
    """Nodes, and how they turn."""
    nodes: list[dict[str, Any]] = [{"name": "forearm", "children": [1]}, {"name": "hand"}]
    rotations = bones.rotations
    turns = {FOREARM: bones.q_WF, HAND: rotations[:, JOINT["wrist"]]}
    roots, offsets = bones.geometry.roots(), bones.geometry.chain_offsets()
    for finger in bones.fingers:
        f = FINGERS.index(finger)
        parent, place = HAND, roots[f]
        for k, segment in enumerate(CHAINS[finger]):
            parent = _child(nodes, parent, segment, place)
            turns[parent] = rotations[:, _joint_of(segment)]
            place = offsets[f, k]
        _child(nodes, parent, f"{finger}_tip", place)
    return nodes, Tracks(turns, {})


def _child(nodes: list[dict[str, Any]], parent: int, name: str, place: Array) -> int:
    nodes.append({"name": name, "translation": [float(x) for x in place]})
    nodes[parent].setdefault("children", []).append(len(nodes) - 1)
    return len(nodes) - 1


def _joint_of(segment: str) -> int:
    return next(j for j, joint in enumerate(JOINTS) if joint.child == segment)


def _add_skin(
    document: dict[str, Any], binary: Binary, skin: Skin, fingers: tuple[str, ...], tracks: Tracks
) -> None:
    """The drawn hand as skinned meshes; its bones hang below the hand's node, each turned and placed by itself."""
    nodes, joints = document["nodes"], []
    for b, name in enumerate(skin.bones):
        joint = _child(nodes, HAND, f"skin_{name}", skin.places[0, b])
        tracks.turns[joint] = skin.turns[:, b]
        if np.ptp(skin.places[:, b], axis=0).max() > STILL:
            tracks.places[joint] = skin.places[:, b]
        joints.append(joint)
    bind = np.tile(np.eye(4), (len(joints), 1, 1))
    bind[:, 3, :3] = -skin.rest  # columns first
    matrices = binary.add(bind.reshape(len(joints), 16))
    document["skins"] = [{"joints": joints, "inverseBindMatrices": matrices}]
    parts = [p for p in skin.parts if not p.finger or p.finger in fingers]
    document["meshes"] = [_mesh(binary, part, k) for k, part in enumerate(parts)]
    document["materials"] = [_material(part) for part in parts]
    for k, part in enumerate(parts):
        nodes.append({"name": part.name, "mesh": k, "skin": 0})
        document["scenes"][0]["nodes"].append(len(nodes) - 1)


def _mesh(binary: Binary, part: SkinPart, material: int) -> dict[str, Any]:
    attributes = {
        "POSITION": binary.add(part.vertices, target=VERTICES),
        "NORMAL": binary.add(part.normals, target=VERTICES),
        "JOINTS_0": binary.add(part.bones, BYTE, VERTICES),
        "WEIGHTS_0": binary.add(part.weights, target=VERTICES),
    }
    indices = binary.add(part.faces.reshape(-1), INT, INDICES)
    primitive = {"attributes": attributes, "indices": indices, "material": material}
    return {"name": part.name, "primitives": [primitive]}


def _material(part: SkinPart) -> dict[str, Any]:
    look = {"baseColorFactor": [*part.colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7}
    return {"name": part.name, "pbrMetallicRoughness": look}


def _animation(binary: Binary, t: Array, tracks: Tracks) -> dict[str, Any]:
    """One animation, a key at every sample, from 0 s on."""
    time = binary.add(t - t[0] if len(t) else t)
    moving = [
        (node, "rotation", in_continuous_signs(q)[:, [1, 2, 3, 0]])
        for node, q in tracks.turns.items()
    ]
    moving += [(node, "translation", place) for node, place in tracks.places.items()]
    samplers = [{"input": time, "output": binary.add(values)} for _, _, values in moving]
    channels = [
        {"sampler": k, "target": {"node": node, "path": path}}
        for k, (node, path, _) in enumerate(moving)
    ]
    return {"name": "movement", "samplers": samplers, "channels": channels}


def _pack_container(document: dict[str, Any], data: bytes) -> bytes:
    """Header and both chunks of the container."""
    text = json.dumps(document, default=str).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(data)
    head = struct.pack("<4sII", b"glTF", 2, total)
    return b"".join(
        [head, struct.pack("<I4s", len(text), b"JSON"), text]
        + [struct.pack("<I4s", len(data), b"BIN\0"), data]
    )
