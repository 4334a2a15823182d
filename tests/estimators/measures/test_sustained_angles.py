"""Thumb, spread and forearm: known postures, both hands."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.trajectory import Flag
from handscope.estimators.hand.anatomy import (
    DEVIATION,
    FLEXION,
    JOINT,
    JOINTS,
    PRONATION,
    SEGMENT,
    SEGMENTS,
    Hand,
)
from handscope.estimators.measures.sustained_angle_measures import (
    FINGER_SPREAD,
    FOREARM_ROTATION,
    THUMB_ABDUCTION,
    SustainedAngleMeasure,
)
from handscope.estimators.measures.sustained_angles import Params
from handscope.estimators.numerics import quaternions as quat
from tests.estimators.measures.trajectories import by_name, made

DEG = np.pi / 180
WEIGHT = np.interp(np.arange(300) / 100, [0.5, 1, 2, 2.5], [0, 1, 1, 0])


def test_spread_is_the_difference_of_neighbouring_deviations() -> None:
    """Ulnar deviation is positive: index 10 deg radial, middle 2 ulnar, ring 12 ulnar, little 30 ulnar."""
    angles = np.full((300, len(JOINTS), 3), np.nan)
    for finger, degrees in (("index", -10), ("middle", 2), ("ring", 12), ("little", 30)):
        angles[:, JOINT[f"{finger}_mcp"], DEVIATION] = degrees * DEG * WEIGHT
    moved = replace(made(300, angles), angles_sd=np.full(angles.shape, 1 * DEG))
    f = by_name(FINGER_SPREAD.figures(FINGER_SPREAD.measure(Params(), moved, 0, 3)))
    degrees = {name: figure.value / DEG for name, figure in f.items()}
    assert degrees == pytest.approx(
        {
            "index_middle_spread": 12,
            "middle_ring_spread": 10,
            "ring_little_spread": 18,
            "index_little_whole_spread": 40,
        }
    )
    assert f["index_middle_spread"].sd == pytest.approx(np.sqrt(2) * DEG)


def test_the_thumbs_angles_are_those_of_its_metacarpal() -> None:
    angles = np.full((300, len(JOINTS), 3), np.nan)
    angles[:, JOINT["thumb_cmc"]] = WEIGHT[:, None] * DEG * np.array([48.0, -60.0, 80.0])
    moved = made(300, angles)
    moved.flags[:30, SEGMENT["thumb_metacarpal"]] = Flag.MAGNETIC
    f = by_name(THUMB_ABDUCTION.figures(THUMB_ABDUCTION.measure(Params(), moved, 0, 3)))
    assert f["thumb_cmc_palmar_abduction"].value == pytest.approx(48 * DEG)
    assert f["thumb_cmc_radial_abduction"].value == pytest.approx(60 * DEG)
    assert f["thumb_cmc_pronation"].value == pytest.approx(80 * DEG)
    assert f["thumb_cmc_pronation"].grade == "fair"
    assert "magnetic disturbance in 10 %" in f["thumb_cmc_pronation"].reason
    assert (FLEXION, DEVIATION, PRONATION) == (0, 1, 2)


@pytest.mark.parametrize("hand", ["left", "right"])
def test_palm_up_and_palm_down_are_told_from_gravity_on_either_hand(hand: Hand) -> None:
    """Long axis level; the palm turns from 90 deg pronation (palm down) to 75 deg supination, whatever the heading."""
    sign = 1.0 if hand == "left" else -1.0
    # hand's frame in the global one with the palm down: dorsal is up, distal ahead (global x), ulnar to its side
    dorsal, distal = sign * np.array([0.0, 0, 1]), sign * np.array([1.0, 0, 0])
    level = quat.from_matrix(np.stack([dorsal, distal, np.cross(dorsal, distal)], axis=1))
    turned = DEG * np.interp(np.arange(300) / 100, [0.5, 1.5, 2, 3], [0, 165, 165, 0])
    ways = []
    for way in (-1.0, 1.0):  # about the long axis; one of the two turns the thumb up first
        q_GS = np.full((300, len(SEGMENTS), 4), np.nan)
        q_GS[:, SEGMENT["hand"]] = quat.turn_heading(
            quat.multiply(level, quat.exp(way * turned[:, None] * np.array([0.0, 1.0, 0.0]))), 0.7
        )
        f = by_name(
            FOREARM_ROTATION.figures(
                FOREARM_ROTATION.measure(Params(), made(300, q_GS=q_GS, hand=hand), 0, 3)
            )
        )
        ways.append((f["supination"].value / DEG, f["pronation"].value / DEG))
    assert min(ways) == pytest.approx((75, 90), abs=0.1)


@pytest.mark.parametrize(
    ("measure", "yes", "no"),
    [
        (
            THUMB_ABDUCTION,
            ("rom_thumb", "rom_thumb_palmar", "prom_thumb_radial"),
            ("rom_thumb_ip", "thumb_flat", "rom_fist"),
        ),
        (FINGER_SPREAD, ("rom_spread",), ("rom_fist", "tapping")),
        (FOREARM_ROTATION, ("rom_forearm", "prom_forearm"), ("rom_wrist", "pronation_supination")),
    ],
)
def test_tasks_are_told_by_the_words_of_their_names(
    measure: SustainedAngleMeasure, yes: tuple[str, ...], no: tuple[str, ...]
) -> None:
    assert [measure.applies(n) for n in yes + no] == [True] * len(yes) + [False] * len(no)
