"""The hand's surfaces: closed, skinned, the right the mirror of the left, and as long and broad as the hand measured."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.app.scene import postures, view
from handscope.app.scene.mesh import bones
from handscope.app.scene.mesh.finger_shape import finger_shape
from handscope.app.scene.mesh.hand_mesh import HandMesh, hand_mesh
from handscope.app.scene.mesh.highlight_mesh import highlight_parts
from handscope.app.scene.mesh.skinned_mesh import Indices, SkinnedMesh, cut_out, posed
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import (
    CHAINS,
    FINGERS,
    HANDS,
    IS_DOF,
    JOINT,
    LIMITS,
    SEGMENTS,
    Hand,
    side_sign,
)
from handscope.estimators.hand.geometry import HandGeometry, HandMeasures, sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.movements import task_performance

MM, MM2 = 1e-3, 1e-6
SIZES = {
    "adult": HandMeasures(),
    "child": HandMeasures(hand_length=0.12),
    "long and narrow": HandMeasures(hand_length=0.21, hand_breadth=0.078),
    "short and broad": HandMeasures(hand_length=0.16, hand_breadth=0.092),
}
PARTS = (*FINGERS, *(f"{finger}_nail" for finger in FINGERS), "palm", "cuff")


@cache
def geometry(hand: Hand = "left", size: str = "adult") -> HandGeometry:
    return sized(hand, SIZES[size])


@cache
def mesh(hand: Hand = "left", size: str = "adult") -> HandMesh:
    return hand_mesh(geometry(hand, size))


def in_pose(part: SkinnedMesh, angles: Array, hand: Hand = "left", size: str = "adult") -> Array:
    """Vertices (V, 3) of a part in the hand's frame."""
    which = [bones.BONE[bone] for bone in part.bones]
    rotations, places = bones.pose(angles, geometry(hand, size))
    return posed(part, mesh(hand, size).rest[which], rotations[which], places[which])


def directed_edges(faces: Indices) -> Indices:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def areas(vertices: Array, faces: Indices) -> Array:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def volume(vertices: Array, faces: Indices) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@st.composite
def natural(draw: st.DrawFn) -> Array:
    """Joint angles (joints, 3) within the permitted range of every freedom."""
    share = np.array(
        draw(st.lists(st.floats(0, 1), min_size=IS_DOF.size, max_size=IS_DOF.size))
    ).reshape(IS_DOF.shape)
    return np.where(IS_DOF, LIMITS[..., 0] + share * (LIMITS[..., 1] - LIMITS[..., 0]), 0.0)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("hand", HANDS)
def test_every_surface_is_closed_faces_outward_and_has_no_empty_triangle(
    hand: Hand, size: str
) -> None:
    assert set(mesh(hand, size).parts()) == set(PARTS)
    for name, part in mesh(hand, size).parts().items():
        there = {tuple(edge) for edge in directed_edges(part.faces)}
        assert there == {(b, a) for a, b in there}, f"{name} has a hole"
        assert areas(part.vertices, part.faces).min() > 1e-3 * MM2, name
        assert volume(part.vertices, part.faces) > 0, f"{name} is inside out"


def test_an_adults_surfaces_are_manifold_without_a_handle() -> None:
    for name, part in mesh().parts().items():
        edges, count = np.unique(
            np.sort(directed_edges(part.faces), axis=1), axis=0, return_counts=True
        )
        assert set(count) == {2}, name
        assert len(part.vertices) - len(edges) + len(part.faces) == 2, (
            name
        )  # a sphere's Euler number


def test_weights_of_a_vertex_sum_to_one_over_at_most_four_bones() -> None:
    for name, part in mesh().parts().items():
        assert (part.weights >= 0).all(), name
        np.testing.assert_allclose(part.weights.sum(axis=1), 1.0, atol=1e-12, err_msg=name)
        assert (part.weights > 0).sum(axis=1).max() <= 4, name
        assert set(part.bones) <= set(bones.BONES)


def test_the_right_hand_is_the_left_one_mirrored_exactly() -> None:
    right = mesh("right").parts()
    for name, left in mesh("left").parts().items():
        np.testing.assert_array_equal(right[name].vertices, -left.vertices)
        np.testing.assert_array_equal(right[name].faces, left.faces[:, ::-1])
        np.testing.assert_array_equal(right[name].weights, left.weights)


@given(natural())
def test_a_posed_right_hand_is_the_posed_left_one_mirrored(angles: Array) -> None:
    for name in ("index", "thumb"):
        left, right = (in_pose(mesh(hand).parts()[name], angles, hand) for hand in HANDS)
        np.testing.assert_allclose(right, -left, atol=1e-12)


def test_in_the_bound_pose_nothing_moves() -> None:
    for part in mesh().parts().values():
        np.testing.assert_allclose(in_pose(part, bones.BOUND), part.vertices, atol=1e-12)


@pytest.mark.parametrize("hand", HANDS)
@given(angles=natural())
def test_a_fingertip_lies_the_tip_tissue_beyond_the_end_of_its_bone(
    hand: Hand, angles: Array
) -> None:
    angles = np.where(
        np.arange(len(JOINT))[:, None] == JOINT["wrist"], 0.0, angles
    )  # then the wrist frame is the hand's
    g, q_pc = geometry(hand), joint_angles.compose(angles)
    ends = forward_kinematics.tips(q_pc, g)
    q = forward_kinematics.segments_on(quat.IDENTITY, q_pc)
    for k, finger in enumerate(FINGERS):
        distal = quat.rotate(
            q[SEGMENTS.index(CHAINS[finger][2])], np.array([0.0, side_sign(hand), 0.0])
        )
        skin = in_pose(mesh(hand).fingers[finger], angles, hand)
        np.testing.assert_allclose(
            skin[-1], ends[k] + g.tip_tissue[finger] * distal, atol=1e-6 * MM
        )
        assert np.linalg.norm(skin - ends[k], axis=1).min() <= g.tip_tissue[finger] + 0.01 * MM


def test_a_bent_joint_keeps_its_thickness() -> None:
    angles = postures.relaxed()
    angles[JOINT["index_pip"]] = [np.radians(90.0), 0, 0]
    _, places = bones.pose(angles, geometry())
    joint = places[bones.BONE["index_middle"]]
    nearest = {name: np.linalg.norm(in_pose(mesh().fingers["index"], a) - p, axis=1) for name, a, p in (
        ("bent", angles, joint),
        ("straight", bones.BOUND, mesh().rest[bones.BONE["index_middle"]]),
    )}  # fmt: skip
    at_joint = nearest["straight"] < 1.15 * nearest["straight"].min()
    knuckle = at_joint & (np.arange(len(at_joint)) % 32 == 8)  # the dorsal line of vertices
    assert knuckle.any()
    assert (
        nearest["bent"][knuckle] / nearest["straight"][knuckle]
    ).min() > 0.85  # linear blending without the half-way bone: 0.71


def test_the_forearm_stays_when_the_wrist_bends() -> None:
    angles = postures.relaxed()
    angles[JOINT["wrist"]] = [0.9, 0.3, 0.0]
    back = quat.conjugate(joint_angles.compose(angles[JOINT["wrist"]]))
    np.testing.assert_allclose(
        in_pose(mesh().cuff, angles), quat.rotate(back, mesh().cuff.vertices), atol=1e-12
    )


def test_the_palm_moves_with_a_finger_where_the_fingers_mesh_covers_it() -> None:
    palm, fist = mesh().palm, postures.angles_of(task_performance.fist())
    rotations, places = bones.pose(fist, geometry())
    for finger in FINGERS:
        bone = bones.BONE[CHAINS[finger][0]]
        begins = mesh().fingers[finger].vertices[-2]
        axis = (begins - mesh().rest[bone]) / np.linalg.norm(begins - mesh().rest[bone])
        out = (palm.vertices - begins) @ axis
        beside = np.linalg.norm(palm.vertices - begins - out[:, None] * axis, axis=1)
        covered = (out > 4 * MM) & (beside < 1.05 * finger_shape(finger, geometry()).half_breadth)
        assert covered.sum() > 10
        rigid = (
            quat.rotate(rotations[bone], palm.vertices[covered] - mesh().rest[bone]) + places[bone]
        )
        np.testing.assert_allclose(in_pose(palm, fist)[covered], rigid, atol=0.02 * MM)


def test_a_longer_finger_is_drawn_longer_and_a_broader_hand_thicker() -> None:
    longer = hand_mesh(sized("left", HandMeasures(finger_length={"ring": 0.115})))
    reach = [
        np.linalg.norm(m.fingers["ring"].vertices[-1] - m.rest[bones.BONE["ring_proximal"]])
        for m in (mesh(), longer)
    ]
    np.testing.assert_allclose(
        reach,
        [sum(geometry().lengths[s] for s in CHAINS["ring"]) + geometry().tip_tissue["ring"], 0.115],
        atol=1e-9,
    )
    thick = [
        np.ptp(mesh("left", size).fingers["middle"].vertices[:, 2])
        for size in ("long and narrow", "short and broad")
    ]
    assert thick[1] > 1.1 * thick[0]


@pytest.mark.parametrize("segment", SEGMENTS)
def test_the_lit_skin_of_a_segment_lies_round_that_segment(segment: str) -> None:
    patches = highlight_parts(mesh(), segment)
    centre = np.mean(np.concatenate([patch.vertices for patch in patches.values()]), axis=0)
    middles = {
        s: mesh().rest[[bones.BONE[c] for c in chain]]
        for f, chain in CHAINS.items()
        for s, chain in segments_with_next(f)
    }
    middles |= {
        "hand": np.array([[0, 0, 0], mesh().rest[bones.BONE["middle_proximal"]]]),
        "forearm": np.array([[0, -0.05, 0]]),
    }
    distance = {
        s: np.linalg.norm(np.mean(ends, axis=0) - centre)
        for s, ends in middles.items()
        if not s.endswith("distal")
    }
    if not segment.endswith("distal"):
        assert min(distance, key=lambda s: distance[s]) == segment


def segments_with_next(finger: str) -> list[tuple[str, tuple[str, str]]]:
    first, second, third = CHAINS[finger]
    return [(first, (first, second)), (second, (second, third)), (third, (third, third))]


def test_a_surface_cut_in_two_has_both_halves_whole() -> None:
    part = mesh().fingers["index"]
    value = part.vertices[:, 1] - 0.115
    upper, lower = cut_out(part, value), cut_out(part, -value)
    assert upper.vertices[:, 1].min() == pytest.approx(0.115, abs=1e-12)
    whole = areas(part.vertices, part.faces).sum()
    assert areas(upper.vertices, upper.faces).sum() + areas(
        lower.vertices, lower.faces
    ).sum() == pytest.approx(whole, rel=1e-9)


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("heading", np.radians([0.0, 70.0, -160.0]))
@pytest.mark.parametrize("pitch", np.radians([0.0, 50.0, 89.0, -89.0]))
@pytest.mark.parametrize("roll", np.radians([0.0, 180.0]))
def test_the_fingers_point_away_from_the_viewer_whatever_the_heading(
    hand: Hand, heading: float, pitch: float, roll: float
) -> None:
    if abs(pitch) > 1.5 and roll:
        return  # upright, palm towards oneself: the same pose as upright and turned round, and taken for that
    level = quat.multiply(
        quat.about(0, pitch), quat.multiply(quat.about(1, roll), view.palm_down(hand))
    )
    q_GH = quat.multiply(quat.about(2, heading), level)
    q_DH = quat.multiply(view.heading_removed(q_GH, hand), q_GH)
    np.testing.assert_allclose(np.degrees(quat.angle(quat.relative(level, q_DH))), 0.0, atol=1e-5)


def test_palm_down_is_palm_down_on_both_hands() -> None:
    for hand in HANDS:
        dorsal, distal, _ = (side_sign(hand) * quat.matrix(view.palm_down(hand)).T)[:3]
        np.testing.assert_allclose([dorsal, distal], [[0, 0, 1], [0, 1, 0]], atol=1e-12)
        np.testing.assert_allclose(
            quat.rotate(view.palm_down(hand), np.array([0, 0, 1.0])), [-1, 0, 0], atol=1e-12
        )  # z to the left


def test_angles_that_are_not_known_are_the_resting_hands() -> None:
    angles = np.full((len(JOINT), 3), np.nan)
    angles[JOINT["index_pip"], 0] = 1.0
    filled = postures.filled(angles)
    assert filled[JOINT["index_pip"], 0] == 1.0
    filled[JOINT["index_pip"], 0] = postures.relaxed()[JOINT["index_pip"], 0]
    np.testing.assert_array_equal(filled, postures.relaxed())


def test_the_ghost_goes_round_its_postures_without_a_jump() -> None:
    round_ = [
        postures.relaxed(),
        postures.angles_of(task_performance.flat()),
        postures.angles_of(task_performance.fist()),
    ]
    for k, posture in enumerate(round_):
        np.testing.assert_array_equal(
            postures.along(round_, 2.0 * k + 0.3, move=1.2, hold=0.8), posture
        )
        np.testing.assert_array_equal(
            postures.along(round_, 2.0 * (k + 3), move=1.2, hold=0.8), posture
        )
    steps = [postures.along(round_, t) for t in np.arange(0, 8, 0.005)]
    assert (
        np.abs(np.diff(steps, axis=0)).max() < 1.9 * np.abs(np.diff(round_, axis=0)).max() * 0.005
    )  # peak speed of minimum jerk: 15/8 of the mean
