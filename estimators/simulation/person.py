"""Somebody's hand: how it really is, and how a method that measured its total lengths and applied the ratios takes it to be.

In      a random generator and the sizes of the anatomical spread
Out     the true geometry and the declared geometry that a method gets
Source  every spread is an option with its source; declared is what the paper measures: palm length and the fingers' total lengths
Limits  the measured lengths themselves are exact: the paper gives no error of its measuring
"""

from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, Hand
from handscope.estimators.hand.geometry import (
    FINGER_LENGTH,
    MCP_DISTAL,
    MEAN_HAND_BREADTH,
    MEAN_HAND_LENGTH,
    RATIOS,
    TIP_TISSUE,
    TIP_TISSUE_SD,
    HandGeometry,
    HandMeasures,
    sized,
)
from handscope.estimators.numerics.quaternions import about, rotate
from handscope.estimators.numerics.typing import Array

ANSUR = "ANSUR (Gordon et al. 1989), men and women together"
SALCHOW = "Salchow-Hoemmen 2019"


@dataclass(frozen=True, kw_only=True)
class Anatomy:
    """How people's hands differ: standard deviations."""

    hand_length: float = option(0.012, "m", "length of the hand", ANSUR)
    finger_length: float = option(
        0.03,
        "1",
        "length of each finger against the hand's",
        f"{SALCHOW}, 5: ratios vary by a few percents; size ours",
    )
    ratio: float = option(
        0.03,
        "1",
        "ratio of neighbouring phalanges against the mean ratio",
        f"{SALCHOW}, 5: from subject to subject by a few percents, size ours; Table 2's 95 % CI of 1 to 2 % is the lower bound",
    )
    tissue: float = option(
        1.0,
        "1",
        "tissue at the fingertip, in standard deviations of Table 3",
        f"{SALCHOW}, Table 3",
    )
    breadth: float = option(
        0.045,
        "1",
        "breadth of the hand against its length: where the MCP joints lie sideways",
        ANSUR,
    )
    knuckles: float = option(
        0.03,
        "1",
        "distance of each joint on the palm from the wrist, and of the thumb's metacarpal",
        f"{SALCHOW}, 5; size ours",
    )
    thumb_angle: float = option(
        3.0,
        "deg",
        "angle between wrist-MCP 3 and wrist-CMC",
        f"{SALCHOW}, Fig. 3 takes 58 deg for all; size ours",
    )


@dataclass(frozen=True)
class Person:
    """A hand as it is (true) and as it was measured (declared)."""

    true: HandGeometry
    declared: HandGeometry


def draw_person(hand: Hand, rng: np.random.Generator, anatomy: Anatomy | None = None) -> Person:
    """One person; every deviation stays within two standard deviations."""
    a = anatomy or Anatomy()
    length = MEAN_HAND_LENGTH + a.hand_length * _bounded_normal(rng)
    breadth = length * MEAN_HAND_BREADTH / MEAN_HAND_LENGTH * (1 + a.breadth * _bounded_normal(rng))
    outer = {
        f: FINGER_LENGTH[f] * length * (1 + a.finger_length * _bounded_normal(rng)) for f in FINGERS
    }
    tissue = {
        f: TIP_TISSUE[f] + a.tissue * TIP_TISSUE_SD[f] * _bounded_normal(rng) for f in FINGERS
    }
    palm = MCP_DISTAL["middle"] * length
    segments = {
        s: v for f in FINGERS for s, v in _phalanges(f, outer[f] - tissue[f], a.ratio, rng).items()
    }
    declared = sized(hand, HandMeasures(palm_length=palm, finger_length=outer))
    segments["thumb_metacarpal"] = declared.lengths["thumb_metacarpal"] * (
        1 + a.knuckles * _bounded_normal(rng)
    )
    usual = sized(hand, HandMeasures(palm_length=palm, hand_breadth=breadth))
    true = sized(hand, HandMeasures(palm_length=palm, segment_length=segments, tip_tissue=tissue))
    return Person(replace(true, joint_positions=_roots(usual, a, rng)), declared)


def _phalanges(
    finger: str, bones: float, spread: float, rng: np.random.Generator
) -> dict[str, float]:
    """The finger's bones, together `bones` long, in this person's own ratios."""
    ratios = [r * (1 + spread * _bounded_normal(rng)) for r in RATIOS[finger]]
    share = np.cumprod([1.0, *ratios[::-1]])[::-1]
    return {s: float(v) for s, v in zip(CHAINS[finger][-len(share) :], bones * share / share.sum())}


def _roots(
    usual: HandGeometry, a: Anatomy, rng: np.random.Generator
) -> dict[str, tuple[float, float, float]]:
    """Where the fingers begin; MCP 3 stays, its distance is the palm length that was measured."""
    places = {}
    for joint, place in usual.joint_positions.items():
        stretch, turn = (
            a.knuckles * _bounded_normal(rng),
            np.radians(a.thumb_angle) * _bounded_normal(rng),
        )
        moved: Array = np.array(place) * (1 + (joint != "middle_mcp") * stretch)
        x, y, z = rotate(about(0, np.array(turn if joint == "thumb_cmc" else 0.0)), moved)
        places[joint] = (float(x), float(y), float(z))
    return places


def _bounded_normal(rng: np.random.Generator) -> float:
    """A standard normal number, not beyond +-2."""
    return float(np.clip(rng.normal(), -2.0, 2.0))
