"""The hand's size from whatever was measured: mixtures, ratios, sides, refusals."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, FINGERS
from handscope.estimators.hand.geometry import (
    RATIOS,
    HandMeasures,
    measures_from,
    root_joint,
    sized,
    table_of,
    with_finger_lengths,
)

LENGTH = st.floats(0.14, 0.22)
TABLES = st.fixed_dictionaries(
    {},
    optional={
        "hand_length": LENGTH,
        "hand_breadth": st.floats(0.06, 0.11),
        "palm_length": st.floats(0.06, 0.11),
        "finger_length": st.dictionaries(st.sampled_from(FINGERS), st.floats(0.06, 0.11)),
        "tip_tissue": st.dictionaries(st.sampled_from(FINGERS), st.floats(0.002, 0.006)),
        "index_proximal": st.floats(0.02, 0.03),
        "ring_distal": st.floats(0.01, 0.015),
        "thumb_metacarpal": st.floats(0.035, 0.05),
        "forearm": st.floats(0.2, 0.3),
        "joint_positions": st.dictionaries(
            st.sampled_from([root_joint(f) for f in FINGERS]),
            st.tuples(st.floats(-0.02, 0.02), st.floats(0.03, 0.09), st.floats(-0.05, 0.05)).map(
                list
            ),
        ),
    },
)


@given(TABLES, st.sampled_from(["left", "right"]))
def test_what_was_measured_is_kept_and_reading_back_gives_the_same_hand(
    table: Mapping[str, Any], hand: Any
) -> None:
    geometry = sized(hand, measures_from(table))
    assert sized(hand, measures_from(table_of(geometry))) == geometry
    for name in ("index_proximal", "ring_distal", "thumb_metacarpal", "forearm"):
        if name in table:
            assert geometry.lengths[name] == table[name]
    for finger, outer in table.get("finger_length", {}).items():
        phalanges = CHAINS[finger] if finger != "thumb" else CHAINS[finger][1:]
        assert sum(geometry.lengths[s] for s in phalanges) + geometry.tip_tissue[
            finger
        ] == pytest.approx(outer, abs=1e-12)
    for joint, place in table.get("joint_positions", {}).items():
        assert geometry.joint_positions[joint] == tuple(place)
    if "palm_length" in table:
        assert geometry.palm_length == table["palm_length"]


@pytest.mark.parametrize("finger", FINGERS)
def test_derived_phalanges_have_the_ratios_of_table_2(finger: str) -> None:
    lengths = sized("left", HandMeasures(finger_length={finger: 0.09})).lengths
    chain = [lengths[s] for s in CHAINS[finger]][-len(RATIOS[finger]) - 1 :]
    np.testing.assert_allclose(np.array(chain[:-1]) / chain[1:], RATIOS[finger], rtol=1e-12)


def test_one_measured_phalanx_scales_the_others() -> None:
    lengths = sized("left", HandMeasures(segment_length={"middle_middle": 0.03})).lengths
    assert lengths["middle_proximal"] == pytest.approx(1.72 * 0.03)
    assert lengths["middle_distal"] == pytest.approx(0.03 / 1.36)


def test_the_hand_is_as_long_as_its_palm_or_fingers_say() -> None:
    palm = sized("left", HandMeasures(palm_length=0.1))
    assert palm.lengths["thumb_metacarpal"] == pytest.approx(0.251 * 0.1 / 0.446)
    fingers = sized("left", HandMeasures(finger_length={"middle": 0.544 * 0.2}))
    assert fingers.palm_length == pytest.approx(0.446 * 0.2)
    assert measures_from({"hand": 0.09}).palm_length == 0.09


@given(TABLES)
def test_left_and_right_hand_are_mirror_images_to_the_last_bit(table: Mapping[str, Any]) -> None:
    measures = measures_from({k: v for k, v in table.items() if k != "joint_positions"})
    left, right = sized("left", measures), sized("right", measures)
    assert left.lengths == right.lengths
    np.testing.assert_array_equal(left.roots(), -right.roots())
    np.testing.assert_array_equal(left.chain_offsets(), -right.chain_offsets())


def test_the_thumb_sits_radially_at_58_degrees() -> None:
    x, y, z = sized("left").joint_positions["thumb_cmc"]
    assert x == 0
    assert np.degrees(np.arctan2(-z, y)) == pytest.approx(58.0)
    places = [sized("left").joint_positions[f"{f}_mcp"][2] for f in FINGERS[1:]]
    assert places == sorted(places)  # ulnar grows from index to little


@pytest.mark.parametrize(
    ("table", "word"),
    [
        ({"hand_length": 187}, "hand length: 187000 mm is outside 50 to 300 mm"),
        ({"palm_length": 83}, "palm length: 83000 mm is outside"),
        ({"hand": 83}, "palm length"),
        ({"index_middle": 24.0}, "index_middle"),
        ({"forearm": 250}, "forearm"),
        ({"finger_length": {"ring": 92}}, "length of ring"),
        ({"tip_tissue": {"ring": 3.9}}, "tip_tissue ring"),
        ({"joint_positions": {"index_mcp": [0, 83, -20]}}, "index_mcp"),
        ({"joint_positions": {"middle_mcp": [0, 0, 0]}}, "middle_mcp"),
        ({"hand_length": float("nan")}, "hand length"),
        ({"hand_length": -0.18}, "hand length"),
    ],
)
def test_millimetres_and_nonsense_are_refused_by_name(table: Mapping[str, Any], word: str) -> None:
    with pytest.raises(InputError, match=word):
        measures_from(table)


@pytest.mark.parametrize(
    "table",
    [
        {"hand_lenght": 0.18},
        {"finger_length": [0.09]},
        {"finger_length": {"pinky": 0.07}},
        {"hand_length": "long"},
        {"joint_positions": {"index_mcp": [0.0, 0.08]}},
        {"joint_positions": {"index_mcp": [0.0, 0.08, 0.0, 0.0]}},
        {"joint_positions": {"index_pip": [0.0, 0.08, 0.0]}},
        {"joint_positions": {"index_mcp": {"x": 0}}},
        {"tip_tissue": 0.004},
    ],
)
def test_a_table_of_another_shape_is_refused(table: Mapping[str, Any]) -> None:
    with pytest.raises(InputError):
        measures_from(table)


def test_phalanges_longer_than_their_finger_are_refused() -> None:
    with pytest.raises(InputError, match="index"):
        sized(
            "left",
            HandMeasures(finger_length={"index": 0.05}, segment_length={"index_proximal": 0.06}),
        )


def test_a_last_phalanx_is_what_the_others_leave_of_a_measured_finger_and_grows_where_none_was() -> (
    None
):
    found = {"index_proximal": 0.046, "index_middle": 0.026}
    derived, total, bone = (
        sized("left", HandMeasures(**measures))  # type: ignore[arg-type]
        for measures in (
            {},
            {"finger_length": {"index": 0.095}},
            {"segment_length": {"index_distal": 0.019}},
        )
    )
    size = {s: derived.lengths[s] for s in CHAINS["index"]}
    grown = size["index_distal"] * 0.072 / (size["index_proximal"] + size["index_middle"])
    assert with_finger_lengths(derived, "index", found).lengths["index_distal"] == pytest.approx(
        grown
    )
    whole = with_finger_lengths(total, "index", found)
    assert sum(whole.lengths[s] for s in CHAINS["index"]) + whole.tip_tissue[
        "index"
    ] == pytest.approx(0.095)
    assert with_finger_lengths(bone, "index", found).lengths["index_distal"] == 0.019
    assert with_finger_lengths(bone, "index", found, off=0.05).lengths[
        "index_distal"
    ] == pytest.approx(0.019 * 1.05)
    # of that finger nothing would be left
    too_long = {
        "index_proximal": 0.06,
        "index_middle": 0.04,
    }
    assert (
        with_finger_lengths(total, "index", too_long).lengths["index_distal"]
        > total.lengths["index_distal"]
    )


def test_a_thumbs_metacarpal_is_not_counted_to_its_measured_length() -> None:
    total = sized("right", HandMeasures(finger_length={"thumb": 0.065}))
    found = with_finger_lengths(
        total, "thumb", {"thumb_metacarpal": 0.05, "thumb_proximal": 0.033}
    ).lengths
    assert found["thumb_proximal"] + found["thumb_distal"] + total.tip_tissue[
        "thumb"
    ] == pytest.approx(0.065)
    assert with_finger_lengths(total, "forearm", {}).lengths == total.lengths
