"""Binary glTF 2.0: the hand's skin on its bones, animated; metres, y up, seconds.

Source  Khronos Group, glTF 2.0 specification, 3.7 (skins) and 3.11 (animations)
"""

import json
import struct
from typing import Any

import numpy as np

from handscope.app.exports.skeleton import (
    UPRIGHT,
    bones,
    known_angles,
    root_orientation,
    tip_offsets,
)
from handscope.app.results.export_content import Content
from handscope.app.scene import palette
from handscope.app.scene.mesh import bones as skin_bones
from handscope.app.scene.mesh.hand_mesh import hand_mesh
from handscope.app.scene.mesh.skinned_mesh import SkinnedMesh, only_bones, vertex_normals
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import CHAINS, FINGERS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array, Indices

FLOAT, USHORT, UINT = 5126, 5123, 5125  # component types
HALVES = tuple(name for name in skin_bones.BONES if name.endswith("_half"))
FRAMES = 60.0  # a second at most: what a screen shows


def write(content: Content) -> bytes:
    """The file: nodes by segment name, `index_tip` and its like at the fingertips, one animation."""
    scene = _Scene(content)
    scene.add_skins()
    scene.animate()
    return scene.packed()


class _Scene:
    """A glTF document under construction: its JSON and its one buffer."""

    def __init__(self, content: Content) -> None:
        self.content, self.buffer = content, bytearray()
        self.accessors: list[dict[str, Any]] = []
        self.views: list[dict[str, Any]] = []
        self.meshes: list[dict[str, Any]] = []
        self.samplers: list[dict[str, Any]] = []
        self.channels: list[dict[str, Any]] = []
        self.nodes: list[dict[str, Any]] = [{"name": "forearm"}]
        self.tree = bones(content.geometry)
        for bone in self.tree:
            self._add_node(bone.name, bone.parent, bone.offset)
        for name in HALVES:  # helpers of the skin: placed and turned in the hand's frame
            self._add_node(name, "hand", np.zeros(3))
        for tip, (segment, place) in tip_offsets(content.geometry).items():
            self._add_node(tip, segment, place)
        self.place = {node["name"]: k for k, node in enumerate(self.nodes)}

    def _add_node(self, name: str, parent: str, offset: Array) -> None:
        self.nodes.append({"name": name, "translation": [float(v) for v in offset]})
        at = next(n for n in self.nodes if n["name"] == parent)
        at.setdefault("children", []).append(len(self.nodes) - 1)

    def add(self, values: Array | Indices, kind: str, component: int, bounds: bool = False) -> int:
        """An accessor over values (n, ...); its number."""
        types = {FLOAT: np.float32, USHORT: np.uint16, UINT: np.uint32}
        data = np.ascontiguousarray(values, types[component])
        self.views.append({"buffer": 0, "byteOffset": len(self.buffer), "byteLength": data.nbytes})
        self.buffer += data.tobytes() + b"\0" * (-data.nbytes % 4)
        limits = (
            {
                "min": np.atleast_1d(data.min(axis=0)).tolist(),
                "max": np.atleast_1d(data.max(axis=0)).tolist(),
            }
            if bounds
            else {}
        )
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": component,
                "count": len(data),
                "type": kind,
                **limits,
            }
        )
        return len(self.accessors) - 1

    def add_skins(self) -> None:
        """A mesh a part of the hand, all on one skin."""
        names = list(skin_bones.BONES)
        bind = np.tile(np.eye(4), (len(names), 1, 1))
        q, _ = skin_bones.chain(skin_bones.BOUND, self.content.geometry)
        turned = dict(zip((s for f in FINGERS for s in CHAINS[f]), q.reshape(-1, 4)))
        for k, (name, place) in enumerate(zip(names, skin_bones.rest(self.content.geometry))):
            R = quat.matrix(quat.conjugate(turned.get(name, quat.IDENTITY)))
            bind[k, :3, :3], bind[k, :3, 3] = R, -R @ place
        inverse = self.add(bind.transpose(0, 2, 1).reshape(-1, 16), "MAT4", FLOAT)
        self.skin = {"inverseBindMatrices": inverse, "joints": [self.place[n] for n in names]}
        for part, mesh in hand_mesh(self.content.geometry).parts().items():
            paint = 1 if part.endswith("_nail") else 2 if part == "cuff" else 0
            self._add_mesh(part, only_bones(mesh), paint)

    def _add_mesh(self, part: str, mesh: SkinnedMesh, paint: int) -> None:
        weights = np.zeros((len(mesh.vertices), 4))
        joints = np.zeros((len(mesh.vertices), 4), int)
        strongest = np.argsort(-mesh.weights, axis=1)[:, :4]
        numbers = np.array([skin_bones.BONE[name] for name in mesh.bones])
        weights[:, : strongest.shape[1]] = np.take_along_axis(mesh.weights, strongest, axis=1)
        joints[:, : strongest.shape[1]] = np.where(
            weights[:, : strongest.shape[1]] > 0, numbers[strongest], 0
        )
        weights /= weights.sum(axis=1, keepdims=True)
        attributes = {
            "POSITION": self.add(mesh.vertices, "VEC3", FLOAT, bounds=True),
            "NORMAL": self.add(vertex_normals(mesh.vertices, mesh.faces), "VEC3", FLOAT),
            "JOINTS_0": self.add(joints, "VEC4", USHORT),
            "WEIGHTS_0": self.add(weights, "VEC4", FLOAT),
        }
        indices = self.add(mesh.faces.reshape(-1), "SCALAR", UINT)
        primitive = {"attributes": attributes, "indices": indices, "material": paint}
        self.meshes.append({"name": part, "primitives": [primitive]})
        self.nodes.append({"name": f"{part}_skin", "mesh": len(self.meshes) - 1, "skin": 0})

    def animate(self) -> None:
        """Rotations of all nodes over time."""
        moved = self.content.moved
        rate = (len(moved) - 1) / (moved.t[-1] - moved.t[0]) if len(moved) > 1 else 1.0
        rows = np.arange(0, len(moved), max(1, round(rate / FRAMES)))
        angles = known_angles(self.content)[rows]
        times = self.add(moved.t[rows] - moved.t[0], "SCALAR", FLOAT, bounds=True)
        root = quat.multiply(UPRIGHT, root_orientation(moved, known_angles(self.content))[rows])
        q_joint = joint_angles.compose(angles)
        rotations = {"forearm": root, **{b.name: q_joint[:, b.joint] for b in self.tree}}
        turned, placed = skin_bones.pose(angles, self.content.geometry)
        rotations |= {name: turned[:, skin_bones.BONE[name]] for name in HALVES}
        for name, q in rotations.items():
            self._add_channel(name, "rotation", times, _continuous(q)[:, [1, 2, 3, 0]], "VEC4")
        for name in HALVES:
            self._add_channel(name, "translation", times, placed[:, skin_bones.BONE[name]], "VEC3")

    def _add_channel(self, name: str, path: str, times: int, values: Array, kind: str) -> None:
        target = {"node": self.place[name], "path": path}
        self.channels.append({"sampler": len(self.samplers), "target": target})
        output = self.add(values, kind, FLOAT)
        self.samplers.append({"input": times, "output": output, "interpolation": "LINEAR"})

    def packed(self) -> bytes:
        """The document as one binary file."""
        document = {
            "asset": {
                "version": "2.0",
                "generator": self.content.provenance["software"],
                "extras": dict(self.content.provenance),
            },
            "scene": 0,
            "scenes": [{"nodes": [0, *(k for k, n in enumerate(self.nodes) if "mesh" in n)]}],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "skins": [self.skin],
            "materials": [_material(p.colour) for p in (palette.SKIN, palette.NAIL, palette.CUFF)],
            "animations": [
                {"name": "movement", "channels": self.channels, "samplers": self.samplers}
            ],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.buffer)}],
        }
        text = json.dumps(document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self.buffer), b"BIN\0") + bytes(self.buffer)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _continuous(q: Array) -> Array:
    """The same rotations (n, 4), each of the sign nearer to the one before: what is between two of them is then the shorter way."""
    agree = np.sign(np.sum(q[1:] * q[:-1], axis=1))
    return np.asarray(
        q * np.concatenate([[1.0], np.cumprod(np.where(agree == 0, 1.0, agree))])[:, None]
    )


def _material(colour: palette.Colour) -> dict[str, Any]:
    linear = [((c / 255 + 0.055) / 1.055) ** 2.4 for c in colour]  # from sRGB
    return {
        "pbrMetallicRoughness": {
            "baseColorFactor": [*linear, 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.8,
        },
        "doubleSided": True,
    }
