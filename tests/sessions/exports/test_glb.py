"""pygltflib and trimesh read the animated hand; its fingertips and its skin are where we have them."""

import io
import struct
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handscope.app.exporting.skin import skin
from handscope.app.scene.mesh import bones
from handscope.app.scene.mesh.hand_mesh import hand_mesh
from handscope.app.scene.mesh.skinned_mesh import only_bones, posed
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.numerics.typing import Array
from handscope.sessions.exports import export
from handscope.sessions.exports.measured import Measured
from handscope.sessions.exports.skeleton import skeleton
from tests.sessions.exports.conftest import instants

pygltflib = pytest.importorskip("pygltflib")
trimesh = pytest.importorskip("trimesh")
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TYPES = {5126: np.float32, 5121: np.uint8, 5125: np.uint32}


class Hand:
    """A file as a viewer reads it."""

    def __init__(self, data: bytes) -> None:
        self.file = pygltflib.GLTF2.load_from_bytes(data)
        self.blob = self.file.binary_blob()
        self.number = {node.name: k for k, node in enumerate(self.file.nodes)}
        self.parent = {
            child: k for k, node in enumerate(self.file.nodes) for child in node.children or ()
        }
        (animation,) = self.file.animations
        self.tracks = {
            (c.target.node, c.target.path): self.array(animation.samplers[c.sampler].output)
            for c in animation.channels
        }
        self.t = self.array(animation.samplers[0].input)

    def array(self, number: int) -> Array:
        accessor = self.file.accessors[number]
        view = self.file.bufferViews[accessor.bufferView]
        width, dtype = WIDTHS[accessor.type], TYPES[accessor.componentType]
        flat = np.frombuffer(self.blob, dtype, accessor.count * width, view.byteOffset or 0)
        return flat.reshape(accessor.count, width).astype(float)

    def matrix(self, node: int, k: int) -> Array:
        """From the node to the forearm (4, 4) at a sample."""
        if node == self.number["forearm"]:
            return np.eye(4)
        own = np.eye(4)
        about = self.file.nodes[node]
        own[:3, 3] = self.tracks.get(
            (node, "translation"), [about.translation or (0, 0, 0)] * (k + 1)
        )[k]
        if (node, "rotation") in self.tracks:
            own[:3, :3] = Rotation.from_quat(self.tracks[node, "rotation"][k]).as_matrix()
        return np.asarray(self.matrix(self.parent[node], k) @ own)


@pytest.fixture(scope="module")
def hand(measured: Measured) -> Hand:
    made = export(replace(measured, skin=skin), "glb")
    return Hand(made.files[""])


def test_fingertip_nodes_are_ours_within_a_tenth_of_a_millimetre(
    hand: Hand, measured: Measured
) -> None:
    for k in instants(len(measured.movement), 25):
        tips = [hand.matrix(hand.number[f"{f}_tip"], k)[:3, 3] for f in FINGERS]
        np.testing.assert_allclose(tips, measured.movement.tips[k], atol=1e-4)
    np.testing.assert_allclose(
        hand.t[:, 0], measured.movement.t - measured.movement.t[0], atol=1e-5
    )


def test_the_skin_bends_as_it_does_in_the_scene(hand: Hand, measured: Measured) -> None:
    mesh = only_bones(hand_mesh(measured.geometry).fingers["index"])
    k = len(measured.movement) // 2
    turns, places = bones.pose(skeleton(measured).angles[k], measured.geometry)
    own = [bones.BONE[b] for b in mesh.bones]
    ours = posed(mesh, hand_mesh(measured.geometry).rest[own], turns[own], places[own])
    (skin_,) = hand.file.skins
    bind = hand.array(skin_.inverseBindMatrices).reshape(-1, 4, 4).swapaxes(1, 2)
    moving = np.stack([hand.matrix(j, k) for j in skin_.joints]) @ bind
    attributes = next(m for m in hand.file.meshes if m.name == "index").primitives[0].attributes
    vertices, joints, weights = (
        hand.array(a) for a in (attributes.POSITION, attributes.JOINTS_0, attributes.WEIGHTS_0)
    )
    carried = np.einsum(
        "vbij,vj->vbi", moving[joints.astype(int)], np.c_[vertices, np.ones(len(vertices))]
    )
    seen = np.sum(weights[..., None] * carried, axis=1)[:, :3]
    back = np.linalg.inv(hand.matrix(hand.number["hand"], k))
    np.testing.assert_allclose(seen @ back[:3, :3].T + back[:3, 3], ours, atol=1e-4)


def test_trimesh_finds_a_hand_in_metres(measured: Measured) -> None:
    data = export(replace(measured, skin=skin), "glb").files[""]
    scene = trimesh.load(io.BytesIO(data), file_type="glb")
    assert {"palm", "index", "thumb_nail"} <= set(scene.geometry)
    assert 0.1 < max(scene.extents) < 0.4


def test_the_file_is_a_container_of_two_aligned_chunks_and_tells_its_origin(
    measured: Measured,
) -> None:
    data = export(measured, "glb").files[""]
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    assert length % 4 == 0
    asset = pygltflib.GLTF2.load_from_bytes(data).asset
    assert asset.extras["simulated"] is True
    assert asset.extras["recording_sha256"] == measured.origin.checksum


def test_a_finger_not_measured_has_neither_bones_nor_skin(without_ring: Measured) -> None:
    made = export(replace(without_ring, skin=skin), "glb")
    read = pygltflib.GLTF2.load_from_bytes(made.files[""])
    assert not {"ring", "ring_nail"} & {mesh.name for mesh in read.meshes}
    assert "ring_tip" not in {node.name for node in read.nodes}
    assert any(n.startswith("ring") for n in made.notices)
