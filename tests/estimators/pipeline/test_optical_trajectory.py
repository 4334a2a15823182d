"""Joint angles from markers of a hand whose angles are known; markers that move against each other are seen."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handscope.estimators.errors import InputError
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import (
    FINGERS,
    JOINT,
    JOINTS,
    PARENTS,
    SEGMENT,
    SEGMENTS,
    Hand,
)
from handscope.estimators.measures.comparison import tip_distance
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.pipeline import optical_trajectory
from handscope.estimators.pipeline.optical_trajectory import FlatPose, Markers
from handscope.sessions.formats.qualisys import read_markers
from tests.estimators.measures.movements import movement
from tests.simulated import DEG

FLAT = FlatPose(0.0, 2.0, np.array([0.0, 0.0, 1.0]), np.zeros(3))
PILLOW = Path(__file__).parents[1] / "simulation" / "pillow_grasp.tsv.gz"
T = np.arange(0, 12, 0.01)


def marked(
    hand: Hand = "left", thumb: np.ndarray | None = None, seed: int = 0, up: int = 2
) -> tuple[Markers, np.ndarray]:
    """Markers on every segment of a hand that lies flat for 2 s and then moves in all angles of all joints, and these angles (n, joints, 3)."""
    rng = np.random.default_rng(seed)
    begun = np.clip((T - 2.2) / 2, 0, 1)[:, None, None]
    angles = begun * movement(seed, 3 * len(JOINTS), 1.0)(T).reshape(len(T), len(JOINTS), 3)
    if thumb is not None:
        angles[:, JOINT["thumb_cmc"]] += thumb
    side = 1.0 if hand == "left" else -1.0
    distal, dorsal = (
        np.array([np.cos(0.4), np.sin(0.4), 0.0]),
        np.array([0.0, 0.0, 1.0]),
    )  # it points anywhere on the table
    R = np.stack([side * dorsal, side * distal, np.cross(dorsal, distal)], axis=-1)
    q_GS = np.full((len(T), len(SEGMENTS), 4), np.nan)
    q_GS[:, SEGMENT["forearm"]] = quat.multiply(
        quat.exp(0.3 * begun[:, 0] * movement(seed + 1, 3, 0.5)(T)), quat.from_matrix(R)
    )
    for j, joint in enumerate(JOINTS):
        q_GS[:, SEGMENT[joint.child]] = quat.multiply(
            q_GS[:, PARENTS[j]], joint_angles.compose(angles[:, j])
        )
    names, places = [], []
    for k, segment in enumerate(SEGMENTS):
        along = (
            0.03 * (k - 2) % 0.09 + 0.09 if k > 1 else -0.1 * (2 - k)
        )  # metacarpals before distal bones
        centre = side * np.array([0.0, along, 0.02 * ((k - 2) // 3)])
        for m in range(3):
            at = rng.normal(scale=0.008, size=3)
            at -= np.array([0, at[1], at[2]]) * (m == 2)
            names.append(f"{segment}_{m + 1}")
            root = quat.rotate(q_GS[0, SEGMENT["hand"]], centre)
            places.append(root + quat.rotate(q_GS[:, k], at))
    together = np.stack(places, axis=1)
    middles = together.reshape(len(T), len(SEGMENTS), 3, 3).mean(axis=2, keepdims=True)
    together = (
        together.reshape(len(T), len(SEGMENTS), 3, 3)
        - middles[:1]
        + _straight(q_GS[0, SEGMENT["hand"]], side)
    ).reshape(len(T), -1, 3)
    turned = np.roll(np.eye(3), up - 2, axis=1)
    return Markers(T, tuple(names), together @ turned), angles


def _straight(q_GH: np.ndarray, side: float) -> np.ndarray:
    """Where the clusters' centres lie in the flat pose: fingers straight and parallel."""
    centres = [[0, -0.2, 0], [0, -0.05, 0]] + [
        [0, 0.03 * (k % 3), 0.02 * (k // 3)] for k in range(15)
    ]
    return np.asarray(quat.rotate(q_GH, side * np.array(centres))[None, :, None])


def tracked(markers: Markers, hand: Hand = "left", pose: FlatPose = FLAT) -> np.ndarray:
    return optical_trajectory.trajectory_of(
        markers, optical_trajectory.find_clusters(markers, pose), hand, pose
    ).angles


@pytest.mark.parametrize("hand", ["left", "right"])
def test_all_three_angles_of_every_joint_are_found_again(hand: Hand) -> None:
    markers, angles = marked(hand)
    np.testing.assert_allclose(tracked(markers, hand), angles, atol=1e-9)


def test_a_thumb_held_otherwise_and_another_axis_up() -> None:
    thumb = np.array([0.1, -0.7, 0.5])
    markers, angles = marked("right", thumb)
    np.testing.assert_allclose(
        tracked(markers, "right", FlatPose(0, 2, FLAT.up, thumb)), angles, atol=1e-9
    )
    markers, angles = marked("left", up=0)
    up = np.array([0.0, 0.0, 1.0]) @ np.roll(np.eye(3), -2, axis=1)
    np.testing.assert_allclose(
        tracked(markers, "left", FlatPose(0, 2, up, np.zeros(3))), angles, atol=1e-9
    )


def test_our_angles_are_those_of_grood_and_suntay() -> None:
    """Grood & Suntay 1983 with flexion about the parent's z, rotation about the child's y, and the floating axis square to both."""
    rng = np.random.default_rng(1)
    angles = rng.uniform(-1.2, 1.2, (200, 3))
    R = Rotation.from_quat(
        joint_angles.compose(angles), scalar_first=True
    ).as_matrix()  # the child's axes on the parent, in columns
    e1, e3 = np.broadcast_to([0.0, 0.0, 1.0], (200, 3)), R[:, :, 1]
    floating = np.cross(e3, e1)
    floating /= np.linalg.norm(floating, axis=1, keepdims=True)
    flexion = np.arctan2(
        floating[:, 1], floating[:, 0]
    )  # the floating axis against the parent's x, about e1
    deviation = np.arcsin((e1 * e3).sum(axis=1))
    rotation = np.arctan2(
        -np.einsum("ni,ni->n", np.cross(floating, R[:, :, 0]), -e3),
        (floating * R[:, :, 0]).sum(axis=1),
    )
    np.testing.assert_allclose(
        np.stack([flexion, deviation, rotation], axis=-1), angles, atol=1e-12
    )


def test_hidden_markers_cost_a_sample_only_where_fewer_than_three_are_left() -> None:
    markers, angles = marked()
    four = Markers(
        T,
        (*markers.names, "index_middle_4"),
        np.concatenate([markers.places, _fourth(markers)], axis=1),
    )
    column = four.names.index("index_middle_2")
    four.places[400:500, column] = np.nan
    four.places[600:650, column - 1 : column + 1] = np.nan
    found = tracked(four)
    pip = JOINT["index_pip"]
    np.testing.assert_allclose(found[:600, pip], angles[:600, pip], atol=1e-9)
    assert np.isnan(found[600:650, pip]).all()
    np.testing.assert_allclose(found[650:], angles[650:], atol=1e-9)


def _fourth(markers: Markers) -> np.ndarray:
    k = markers.names.index("index_middle_1")
    return (
        markers.places[:, [k]]
        + 0.7 * (markers.places[:, [k + 1]] - markers.places[:, [k]])
        + 0.4 * (markers.places[:, [k + 2]] - markers.places[:, [k]])
    )


def test_one_finger_without_a_hand_gives_its_own_joints() -> None:
    markers, angles = marked()
    own = [k for k, name in enumerate(markers.names) if name.startswith("index_")]
    few = Markers(
        T, tuple(f"Subject:{markers.names[k].title()}" for k in own), markers.places[:, own]
    )
    found = tracked(few)
    for joint in ("index_pip", "index_dip"):
        np.testing.assert_allclose(found[:, JOINT[joint]], angles[:, JOINT[joint]], atol=1e-9)
    assert np.isnan(np.delete(found, [JOINT["index_pip"], JOINT["index_dip"]], axis=1)).all()


def test_rigid_markers_do_not_move_and_a_slipping_one_does() -> None:
    markers, _ = marked()
    still = {
        r.segment: r
        for r in optical_trajectory.rigidity(
            optical_trajectory.find_clusters(markers, FLAT), markers
        )
    }
    assert max(r.movement_max for r in still.values()) < 1e-12
    assert max(r.angle_max for r in still.values()) < 1e-6
    slipping = Markers(T, markers.names, markers.places.copy())
    k, hand = (
        slipping.names.index("index_middle_1"),
        [slipping.names.index(f"index_middle_{m}") for m in (1, 2, 3)],
    )
    side = slipping.places[:, hand[1]] - slipping.places[:, k]
    away = np.cross(
        side, np.cross(side, slipping.places[:, hand[2]] - slipping.places[:, k])
    )  # in the markers' plane, square to that side
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    slipping.places[600:, k] += 0.006 * away[600:]
    moved = {
        r.segment: r
        for r in optical_trajectory.rigidity(
            optical_trajectory.find_clusters(slipping, FLAT), slipping
        )
    }
    rows = slipping.places[600:][:, hand]
    fit = [
        Rotation.align_vectors(
            p - p.mean(axis=0),
            (rest := slipping.places[:200, hand].mean(axis=0)) - rest.mean(axis=0),
        )
        for p in rows[::60]
    ]
    expected = [
        np.linalg.norm(p - p.mean(axis=0) - R.apply(rest - rest.mean(axis=0)), axis=1).max()
        for p, (R, _) in zip(rows[::60], fit)
    ]
    assert moved["index_middle"].movement_max == pytest.approx(max(expected), rel=1e-6)
    assert moved["index_middle"].angle_max == pytest.approx(
        max(_between(R.apply(rest), p).max() for p, (R, _) in zip(rows[::60], fit)), rel=1e-6
    )
    assert moved["index_distal"].movement_max < 1e-12


def _between(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles (3,) between the axes laid through three markers, by orthogonal factors."""
    axes = []
    for m in (one, other):
        factor, upper = np.linalg.qr(np.stack([m[1] - m[0], m[2] - m[0]], axis=-1))
        x, y = (factor * np.sign(np.diag(upper))).T
        axes.append(np.stack([x, y, np.cross(x, y)]))
    return np.asarray(np.arccos(np.clip((axes[0] * axes[1]).sum(axis=1), -1, 1)))


def test_real_markers_on_the_back_of_a_hand_are_rigid_within_half_a_millimetre() -> None:
    """The notes of that recording: 55.2, 44.7 and 32.4 mm apart, standard deviation 0.1 mm."""
    real = read_markers(PILLOW)
    markers = Markers(real.t, ("hand_1", "hand_2", "hand_3"), real.back)
    sides = np.linalg.norm(real.back - np.roll(real.back, 1, axis=1), axis=-1)
    np.testing.assert_allclose(
        np.sort(np.nanmean(sides, axis=0)), [0.0324, 0.0447, 0.0552], atol=2e-4
    )
    start = float(real.t[int(np.nanargmin(_restless(real.back)))])
    (hand,) = optical_trajectory.rigidity(
        optical_trajectory.find_clusters(
            markers, FlatPose(start, start + 0.18, FLAT.up, np.zeros(3))
        ),
        markers,
    )
    assert 1e-5 < hand.movement_mean < 0.2e-3
    assert hand.movement_max < 1e-3
    assert hand.angle_mean < 0.5 * DEG


def _restless(places: np.ndarray) -> np.ndarray:
    """How much (n - 10,) m the markers move within ten samples, 0.2 s."""
    return np.array([np.ptp(places[k : k + 10], axis=0).max() for k in range(len(places) - 10)])


def test_tips_are_told_by_their_markers_and_their_distance_needs_no_hand() -> None:
    markers, _ = marked()
    tip = np.stack([0.1 + 0.02 * np.sin(T), 0 * T, 0 * T], axis=-1)
    more = Markers(
        T,
        (*markers.names, "thumb_tip", "Index_tip"),
        np.concatenate([markers.places, 0 * tip[:, None], tip[:, None]], axis=1),
    )
    for few in (more, Markers(T, more.names[-2:], more.places[:, -2:])):
        moved = optical_trajectory.trajectory_of(
            few, optical_trajectory.find_clusters(few, FLAT), "left", FLAT
        )
        np.testing.assert_allclose(tip_distance(moved), tip[:, 0], atol=1e-9)
        assert np.isnan(moved.tips[:, FINGERS.index("little")]).all()


def test_orientations_of_bodies_that_sit_anyhow_are_aligned_in_the_flat_pose() -> None:
    thumb = np.array([0.0, -0.7, 1.0])
    markers, angles = marked(thumb=thumb)
    pose = FlatPose(0.0, 2.0, FLAT.up, thumb)
    moved = optical_trajectory.trajectory_of(
        markers, optical_trajectory.find_clusters(markers, pose), "left", pose
    )
    rng = np.random.default_rng(2)
    misaligned = moved.q_GS.copy()
    for k in range(len(SEGMENTS)):
        if k != SEGMENT["hand"]:
            misaligned[:, k] = quat.multiply(misaligned[:, k], quat.normalize(rng.normal(size=4)))
    moved.q_GS[:] = misaligned
    np.testing.assert_allclose(optical_trajectory.align(moved, pose).angles, angles, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            lambda m: Markers(T, tuple(f"m{k}" for k in range(len(m.names))), m.places),
            "the markers give no joint: needed are three or more",
        ),
        (
            lambda m: Markers(T, m.names, m.places + 0.01 * np.sin(T)[:, None, None]),
            "in the flat pose (standard deviation, 1 mm are allowed)",
        ),
        (
            lambda m: Markers(T, m.names, np.where((T < 3)[:, None, None], np.nan, m.places)),
            "hidden during the whole flat pose",
        ),
        (lambda m: Markers(T, m.names, np.repeat(m.places[:, ::3], 3, axis=1)), "lie on a line"),
    ],
)
def test_markers_that_tell_nothing_are_refused(change: object, sentence: str) -> None:
    assert callable(change)
    with pytest.raises(InputError) as refusal:
        tracked(change(marked()[0]))
    assert sentence in str(refusal.value)


@pytest.mark.parametrize(
    ("up", "hand"),
    [
        ([0.0, 0.0, -1.0], "left"),
        ([np.cos(0.4), np.sin(0.4), 0.0], "left"),
        ([np.sin(0.4), -np.cos(0.4), 0.0], "left"),
        ([0.0, 0.0, 1.0], "right"),
    ],
)
def test_a_wrong_axis_or_hand_is_seen_by_how_the_fingers_lie(up: list[float], hand: Hand) -> None:
    """Up is down; up is along the fingers; up is to the side; the hand is the other one."""
    markers, _ = marked("left")
    with pytest.raises(InputError, match="another axis of the markers' frame points up"):
        tracked(markers, hand, FlatPose(0.0, 2.0, np.array(up), np.zeros(3)))
