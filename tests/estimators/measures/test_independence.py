"""Finger independence where the neighbours follow by known shares."""

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FLEXION, JOINT, JOINTS
from handscope.estimators.measures import independence
from handscope.estimators.measures.independence import Params, of_sums
from handscope.estimators.measures.task_request import Mark, TaskRequest
from tests.estimators.measures.trajectories import by_name, made

DEG = np.pi / 180
BEND = 150 * DEG * 0.5 * (1 - np.cos(2 * np.pi * np.arange(0, 4, 0.01) / 4))


def test_the_index_is_one_less_the_mean_slope_of_the_others() -> None:
    """Followed by 20, 10, 0 and, the other way, 2 %: 1 - 0.32 / 4."""
    sums = {
        "index": BEND,
        "middle": 0.2 * BEND,
        "ring": 0.1 * BEND,
        "little": 0 * BEND,
        "thumb": -0.02 * BEND,
    }
    found = of_sums("index", sums)
    assert found.index == pytest.approx(1 - 0.32 / 4)
    assert found.enslaving == pytest.approx({"thumb": 0.02, "middle": 0.2})
    assert found.sum_range == pytest.approx(150 * DEG)
    assert found.independent == pytest.approx(
        25 / 150, abs=0.02
    )  # the middle finger has moved by 5 deg when the index has by 25


def test_a_finger_alone_is_independent_over_its_whole_range_and_all_together_not_at_all() -> None:
    alone = of_sums("ring", {"ring": BEND, "middle": 0 * BEND, "little": 0.02 * BEND})
    assert (alone.independent, alone.index) == (1.0, pytest.approx(0.99))
    together = of_sums("ring", dict.fromkeys(("index", "middle", "ring", "little"), BEND))
    assert together.index == pytest.approx(0.0)
    assert together.independent < 0.05


def test_samples_that_are_not_known_are_left_out() -> None:
    middle = 0.2 * BEND
    middle[50:90] = np.nan
    assert of_sums("index", {"index": BEND, "middle": middle}).index == pytest.approx(0.8)


def test_every_finger_is_judged_in_the_rounds_in_which_it_was_called() -> None:
    """The index bends in the first 4 s, the ring finger in the next; the middle finger follows by 10 and by 30 %."""
    angles = np.zeros((800, len(JOINTS), 3))
    for k, (finger, share) in enumerate((("index", 0.1), ("ring", 0.3))):
        rows = slice(400 * k, 400 * (k + 1))
        angles[rows, JOINT[f"{finger}_pip"], FLEXION] = BEND
        angles[rows, JOINT["middle_pip"], FLEXION] = share * BEND
    asked = TaskRequest(
        "finger_independence", {}, (Mark(0.0, 4.0, "index", 1), Mark(4.0, 8.0, "ring", 1))
    )
    f = by_name(
        independence.figures(
            independence.measure(Params(), made(800, angles), 0.0, 8.0, None, asked)
        )
    )
    assert f["index_individuation_index"].value == pytest.approx(1 - 0.1 / 4)
    assert f["ring_individuation_index"].value == pytest.approx(1 - 0.3 / 4)
    assert f["ring_middle_enslaving_share"].value == pytest.approx(0.3, abs=0.01)
    assert "middle_individuation_index" not in f


def test_without_a_call_the_name_tells_the_finger_or_the_one_that_bends_furthest() -> None:
    angles = np.zeros((400, len(JOINTS), 3))
    angles[:, JOINT["index_pip"], FLEXION], angles[:, JOINT["ring_pip"], FLEXION] = BEND, 0.5 * BEND
    moved = made(400, angles)
    assert [
        a.finger
        for a in independence.measure(Params(), moved, 0, 4, None, TaskRequest("independence_ring"))
    ] == ["ring"]
    assert [
        a.finger
        for a in independence.measure(
            Params(), moved, 0, 4, None, TaskRequest("x", {"finger": "ring"})
        )
    ] == ["ring"]
    assert [a.finger for a in independence.measure(Params(), moved, 0, 4)] == ["index"]


def test_a_finger_that_hardly_bent_has_no_index_and_says_why() -> None:
    found = of_sums("index", {"index": 0.1 * BEND, "middle": 0 * BEND})
    assert np.isnan(found.index)
    assert found.reason == "the finger bent by less than 20 deg"
    with pytest.raises(InputError, match="at least one other finger"):
        of_sums("index", {"index": BEND})
