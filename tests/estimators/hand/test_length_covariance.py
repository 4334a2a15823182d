"""Which lengths of a hand err together, from what was measured; and what that makes of the tips."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.finger_ekf import output_covariance
from handscope.estimators.hand import forward_kinematics, joint_angles, length_covariance
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, IS_DOF, JOINTS
from handscope.estimators.hand.geometry import HandGeometry, HandMeasures, root_joint, sized
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation import person

FEW_PERCENTS = 0.03
MEASURED = HandMeasures(
    palm_length=0.083, hand_breadth=0.085, finger_length=dict.fromkeys(FINGERS, 0.09)
)


def _bent(rng: np.random.Generator) -> Array:
    return joint_angles.compose(rng.uniform(0.0, 1.2, (len(JOINTS), 3)) * IS_DOF)


def _tips_sd(geometry: HandGeometry, q_pc: Array) -> Array:
    """(5, 3) m where the rotations are known exactly."""
    of_lengths = length_covariance.covariance(geometry, FEW_PERCENTS)
    of_lengths += length_covariance.of_palm(geometry)
    angles = joint_angles.decompose(q_pc)
    return np.asarray(
        output_covariance.of_hand(
            angles[None], q_pc[None], np.zeros((1, 6, 9, 9)), geometry, of_lengths
        )[1][0]
    )


def _told_otherwise(
    geometry: HandGeometry, finger: str, root: Array, shares: Array
) -> HandGeometry:
    lengths = {s: geometry.lengths[s] * (1 + share) for s, share in zip(CHAINS[finger], shares)}
    places = {
        root_joint(finger): tuple(np.array(geometry.joint_positions[root_joint(finger)]) + root)
    }
    return replace(
        geometry,
        lengths={**geometry.lengths, **lengths},
        joint_positions={**geometry.joint_positions, **places},
    )


def test_tips_err_as_drawn_lengths_make_them(rng: np.random.Generator) -> None:
    geometry, q_pc = sized("right", MEASURED), _bent(rng)
    covariance = length_covariance.covariance(geometry, FEW_PERCENTS)
    covariance += length_covariance.of_palm(geometry)
    sds = _tips_sd(geometry, q_pc)
    here = forward_kinematics.tips(q_pc, geometry)
    for f, finger in enumerate(FINGERS):
        drawn = rng.multivariate_normal(np.zeros(6), covariance[f], 2000)
        tips = [
            forward_kinematics.tips(q_pc, _told_otherwise(geometry, finger, d[:3], d[3:]))[f]
            for d in drawn
        ]
        np.testing.assert_allclose(
            np.sqrt(np.mean((np.array(tips) - here[f]) ** 2, axis=0)), sds[f], rtol=0.08, atol=2e-5
        )


@pytest.mark.parametrize("finger", FINGERS[1:])
def test_bones_of_a_measured_finger_make_up_for_each_other(finger: str) -> None:
    """Together they err by the calipers and the tissue, each by its ratios; of a finger that was
    not measured they err together."""
    geometry, f = sized("left", MEASURED), FINGERS.index(finger)
    size = np.array([geometry.lengths[s] for s in CHAINS[finger]])
    bones = length_covariance.covariance(geometry, FEW_PERCENTS)[f, 3:, 3:] * np.outer(size, size)
    total = np.hypot(1e-3, 0.6e-3)
    assert np.sqrt(bones.sum()) == pytest.approx(total, rel=0.02)
    assert np.sqrt(bones[0, 0]) / size[0] == pytest.approx(
        np.hypot(0.54 * FEW_PERCENTS, total / size.sum()), rel=0.05
    )
    assert bones[0, 2] < 0
    whole = length_covariance.covariance(
        sized("left", HandMeasures(hand_length=0.19)), FEW_PERCENTS
    )[f, 3:, 3:] * np.outer(size, size)
    assert np.sqrt(whole.sum()) == pytest.approx(FEW_PERCENTS * size.sum(), rel=0.01)


def test_fingers_derived_from_the_palm_err_as_fingers_scatter_between_people() -> None:
    """One ratio more than those derived from the hand's length or from another finger."""
    palm = HandMeasures(palm_length=0.083)
    size = np.array([sized("left", palm).lengths[s] for s in CHAINS["middle"]])

    def share(measures: HandMeasures) -> float:
        bones = length_covariance.covariance(sized("left", measures), FEW_PERCENTS)[2, 3:, 3:]
        return float(np.sqrt(size @ bones @ size) / size.sum())

    assert share(palm) == pytest.approx(0.06, rel=0.01)
    assert share(replace(palm, hand_length=0.19)) == pytest.approx(FEW_PERCENTS, rel=0.01)
    assert share(replace(palm, finger_length={"index": 0.09})) == pytest.approx(
        FEW_PERCENTS, rel=0.01
    )


def test_bones_measured_one_by_one_err_each_for_itself() -> None:
    measured = HandMeasures(segment_length=dict.fromkeys(CHAINS["ring"], 0.03))
    np.testing.assert_allclose(
        length_covariance.covariance(sized("left", measured), FEW_PERCENTS)[3, 3:, 3:],
        FEW_PERCENTS**2 * np.eye(3),
        atol=1e-15,
    )


def test_a_bone_that_was_found_from_movement_errs_as_it_was_found() -> None:
    """Whatever was measured of its finger; the others err as before."""
    geometry = sized("left", MEASURED)
    bone, before = CHAINS["ring"][1], length_covariance.covariance(geometry, FEW_PERCENTS)
    found = length_covariance.covariance(geometry, FEW_PERCENTS, {bone: 2e-4})
    assert np.sqrt(found[3, 4, 4]) * geometry.lengths[bone] == pytest.approx(2e-4)
    assert not found[3, 4, [0, 1, 2, 3, 5]].any() and not found[3, [0, 1, 2, 3, 5], 4].any()
    found[3, 4], found[3, :, 4] = before[3, 4], before[3, :, 4]
    np.testing.assert_array_equal(found, before)


def test_people_whose_palms_are_flat_err_no_more_than_is_stated(rng: np.random.Generator) -> None:
    """Palm and fingers measured without error, ratios and knuckles of their own within two standard
    deviations of the mean hand."""
    normal = []
    for _ in range(150):
        somebody, q_pc = person.draw_person("left", rng), _bent(rng)
        error = forward_kinematics.tips(q_pc, somebody.declared) - forward_kinematics.tips(
            q_pc, somebody.true
        )
        normal.append(error / _tips_sd(somebody.declared, q_pc))
    by_finger = np.mean(np.square(normal), axis=(0, 2))
    assert (by_finger < 1.05).all() and by_finger[1] > 0.35


def test_roots_of_a_hand_of_bones_lie_within_two_standard_deviations() -> None:
    """MyoHand's, m: dorsal, distal, ulnar from the wrist, along the line to MCP 3."""
    bones = {
        "thumb": (-14.1e-3, 24.8e-3, -25.0e-3),
        "index": (-0.7e-3, 82.8e-3, -17.4e-3),
        "ring": (-5.5e-3, 78.6e-3, 14.5e-3),
        "little": (-13.2e-3, 68.7e-3, 23.6e-3),
    }
    geometry = sized("left", HandMeasures(palm_length=81.5e-3))
    covariance = length_covariance.covariance(geometry, FEW_PERCENTS)
    covariance += length_covariance.of_palm(geometry)
    for finger, place in bones.items():
        off = np.array(place) - geometry.joint_positions[root_joint(finger)]
        sd = np.sqrt(np.diag(covariance[FINGERS.index(finger), :3, :3]))
        assert (np.abs(off) < 2 * sd).all(), finger
        assert sd.max() < 0.02


def test_where_a_joint_was_measured_the_palm_adds_nothing() -> None:
    places = {"thumb_cmc": (0.0, 0.02, -0.02)}
    added = length_covariance.of_palm(sized("left", HandMeasures(joint_positions=places)))
    assert not added[0].any() and added[4, 0, 0] > 0
