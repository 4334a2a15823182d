"""People's hands: measured lengths are kept, the rest differs by as much as it says."""

from dataclasses import fields, replace

import numpy as np
import pytest

from handscope.estimators.hand.anatomy import CHAINS, FINGERS, HANDS
from handscope.estimators.hand.geometry import RATIOS, TIP_TISSUE_SD, HandGeometry
from handscope.estimators.simulation.person import Anatomy, draw_person

PEOPLE = [draw_person("left", np.random.default_rng(seed)) for seed in range(200)]
ALIKE = replace(Anatomy(), **dict.fromkeys((f.name for f in fields(Anatomy)), 0.0))


def _outer(geometry: HandGeometry, finger: str) -> float:
    bones = CHAINS[finger][-len(RATIOS[finger]) - 1 :]
    return sum(geometry.lengths[s] for s in bones) + geometry.tip_tissue[finger]


@pytest.mark.parametrize("finger", FINGERS)
def test_the_measured_lengths_are_those_of_the_hand(finger: str) -> None:
    for person in PEOPLE:
        assert _outer(person.true, finger) == pytest.approx(_outer(person.declared, finger))
        assert person.true.palm_length == person.declared.palm_length


def test_the_told_hand_has_the_mean_ratios_and_the_true_one_its_own() -> None:
    def ratios(of: str) -> np.ndarray:
        lengths = [getattr(p, of).lengths for p in PEOPLE]
        return np.array([g["index_proximal"] / g["index_middle"] for g in lengths])

    np.testing.assert_allclose(ratios("declared"), RATIOS["index"][0])
    assert ratios("true").std() == pytest.approx(0.03 * RATIOS["index"][0], rel=0.15)
    assert ratios("true").mean() == pytest.approx(RATIOS["index"][0], rel=0.01)


def test_the_tissue_differs_as_in_table_3() -> None:
    tissue = np.array([p.true.tip_tissue["thumb"] for p in PEOPLE])
    assert tissue.std() == pytest.approx(TIP_TISSUE_SD["thumb"], rel=0.15)
    assert len({p.declared.tip_tissue["thumb"] for p in PEOPLE}) == 1


def test_without_a_spread_everybody_is_as_the_method_is_told() -> None:
    person = draw_person("right", np.random.default_rng(0), ALIKE)
    assert dict(person.true.lengths) == pytest.approx(dict(person.declared.lengths))
    for joint, place in person.declared.joint_positions.items():
        assert person.true.joint_positions[joint] == pytest.approx(place)


def test_a_right_hand_is_the_mirror_image_of_the_left_one() -> None:
    left, right = (draw_person(hand, np.random.default_rng(3)) for hand in HANDS)
    for a, b in ((left.true, right.true), (left.declared, right.declared)):
        assert a.lengths == b.lengths
        for joint, place in a.joint_positions.items():
            np.testing.assert_array_equal(b.joint_positions[joint], -np.array(place))
