"""Lengths of the hand's segments and where its joints lie, from whatever was measured.

In      any of: hand length and breadth, palm length, finger lengths, segment lengths, tip tissue,
        joint positions (metres)
Out     functional segment lengths, MCP and thumb CMC centres in the hand's frame from the wrist's
        centre
Source  phalanx ratios and tip tissue: Salchow-Hoemmen 2019, Tables 2 and 3; joint centres and
        finger lengths as fractions of hand length and breadth: Buchholz, Armstrong & Goldstein
        1992, Ergonomics 35:261; thumb angle 58 deg: Salchow-Hoemmen 2019, Fig. 3; average adult
        hand 0.187 m x 0.085 m: mean of men and women, ANSUR (Gordon et al. 1989)
Limits  the palm is flat and rigid; a derived length is as good as the ratio (95 % CI of its mean:
        RATIO_CI95, in units of the ratio) and the measure it came from
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENTS, Hand, side_sign
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

MEAN_HAND_LENGTH, MEAN_HAND_BREADTH = 0.187, 0.085
THUMB_ANGLE = np.radians(58.0)  # between wrist-MCP3 and wrist-CMC
THUMB_CMC_DISTANCE = 0.118  # of hand length, wrist to thumb CMC: Buchholz 1992
THUMB_METACARPAL = 0.251  # of hand length
FINGER_LENGTH = {
    "thumb": 0.196 + 0.158,
    "index": 0.245 + 0.143 + 0.097,
    "middle": 0.266 + 0.170 + 0.108,
    "ring": 0.244 + 0.165 + 0.107,
    "little": 0.204 + 0.117 + 0.093,
}
MCP_DISTAL = {"index": 0.447, "middle": 0.446, "ring": 0.409, "little": 0.368}  # of hand length
MCP_ULNAR = {"index": -0.251, "middle": 0.0, "ring": 0.206, "little": 0.402}  # of hand breadth
RATIOS = {
    "thumb": (0.98,),
    "index": (1.86, 1.24),
    "middle": (1.72, 1.36),
    "ring": (1.70, 1.29),
    "little": (1.91, 1.06),
}
# of the same two ratios
RATIO_CI95 = {
    "index": (0.018, 0.018),
    "middle": (0.013, 0.016),
    "ring": (0.016, 0.016),
    "little": (0.022, 0.022),
}
TIP_TISSUE = {
    "thumb": 5.67e-3,
    "index": 3.84e-3,
    "middle": 3.95e-3,
    "ring": 3.95e-3,
    "little": 3.73e-3,
}
TIP_TISSUE_SD = {
    "thumb": 0.61e-3,
    "index": 0.59e-3,
    "middle": 0.61e-3,
    "ring": 0.60e-3,
    "little": 0.62e-3,
}
PLAUSIBLE = {
    "hand_length": (0.05, 0.30),
    "hand_breadth": (0.02, 0.15),
    "palm_length": (0.02, 0.16),
    "finger": (0.015, 0.15),
    "segment": (0.004, 0.09),
    "forearm": (0.05, 0.40),
    "tissue": (0.0, 0.02),
    "thumb_cmc": (0.005, 0.16),  # from the wrist's centre
}


@dataclass(frozen=True)
class HandMeasures:
    """What was measured, in metres; everything is optional, what is absent is derived."""

    hand_length: float | None = None
    hand_breadth: float | None = None
    palm_length: float | None = None  # wrist centre to MCP 3
    # MCP centre to the outer tip, by finger
    finger_length: Mapping[str, float] = field(default_factory=dict)
    # functional length by segment
    segment_length: Mapping[str, float] = field(default_factory=dict)
    tip_tissue: Mapping[str, float] = field(default_factory=dict)  # by finger
    # in the hand's frame from the wrist's centre, by joint
    joint_positions: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    # which of all these were measured where others were derived before; None: all of them
    measured: frozenset[str] | None = None

    def measured_names(self) -> frozenset[str]:
        """What was measured: names of the hand's lengths, fingers whose total is known, segments,
        joints."""
        if self.measured is not None:
            return self.measured
        scalars = (
            name
            for name in ("hand_length", "hand_breadth", "palm_length")
            if getattr(self, name) is not None
        )
        return frozenset(
            (*scalars, *self.finger_length, *self.segment_length, *self.joint_positions)
        )


@dataclass(frozen=True)
class HandGeometry:
    """The sized hand: everything forward kinematics needs."""

    hand: Hand
    # m, joint centre to joint centre by segment, a distal phalanx to the end of its bone; forearm 0
    # = unknown
    lengths: Mapping[str, float]
    # m, MCP and thumb CMC centres in the hand's frame from the wrist's centre
    joint_positions: Mapping[str, tuple[float, float, float]]
    tip_tissue: Mapping[str, float]  # m, by finger
    palm_length: float  # m
    # what of it was measured, as HandMeasures.measured_names has it; the rest is derived: length_covariance.py
    measured: frozenset[str] = frozenset()

    def roots(self) -> Array:
        """Where the five chains begin in the hand's frame (5, 3), thumb first."""
        return self._arrays[0]

    def chain_offsets(self) -> Array:
        """Translation along each segment of each chain in its own frame (5 fingers, 3 segments,
        3)."""
        return self._arrays[1]

    @cached_property
    def _arrays(self) -> tuple[Array, Array]:
        """Roots and offsets, computed once: a live view needs them at every step."""
        roots, offsets = (
            np.array([self.joint_positions[root_joint(finger)] for finger in FINGERS]),
            np.zeros((5, 3, 3)),
        )
        offsets[..., 1] = [
            [side_sign(self.hand) * self.lengths[s] for s in CHAINS[finger]] for finger in FINGERS
        ]
        roots.flags.writeable = offsets.flags.writeable = False
        return roots, offsets


def root_joint(finger: str) -> str:
    """The joint that ties a finger to the palm."""
    return "thumb_cmc" if finger == "thumb" else f"{finger}_mcp"


def sized(hand: Hand, measures: HandMeasures | None = None) -> HandGeometry:
    """Fill in what was not measured and build the hand."""
    m = measures or HandMeasures()
    check(m)
    length, breadth = hand_length(m), m.hand_breadth
    breadth = breadth if breadth is not None else length * MEAN_HAND_BREADTH / MEAN_HAND_LENGTH
    tissue = {finger: m.tip_tissue.get(finger, TIP_TISSUE[finger]) for finger in FINGERS}
    lengths = {"forearm": m.segment_length.get("forearm", 0.0), "hand": _palm_length(m, length)}
    lengths["thumb_metacarpal"] = m.segment_length.get(
        "thumb_metacarpal", THUMB_METACARPAL * length
    )
    for finger in FINGERS:
        outer = m.finger_length.get(finger)
        lengths |= _phalanges(
            finger, m.segment_length, outer, FINGER_LENGTH[finger] * length, tissue[finger]
        )
    return HandGeometry(
        hand,
        lengths,
        _joint_positions(hand, m, lengths["hand"], breadth),
        tissue,
        lengths["hand"],
        m.measured_names(),
    )


def with_finger_lengths(
    geometry: HandGeometry, limb: str, found: Mapping[str, float], off: float = 0.0
) -> HandGeometry:
    """The hand with lengths (m) of a finger, or of the forearm, found from movement; lengths of the
    same limb that were not found are scaled by 1 + off.

    A distal phalanx that was not found keeps its length where it was measured. Where the finger's
    total was measured it gets what remains of the total, else it is scaled as the others were.
    """
    chain = CHAINS.get(limb, (limb,))
    rest = {s: geometry.lengths[s] for s in chain if s not in found}
    if found and chain[-1] in rest and chain[-1] not in geometry.measured:
        rest[chain[-1]] = _last_length(geometry, limb, found)
    return replace(
        geometry,
        lengths={
            **geometry.lengths,
            **found,
            **{s: length * (1 + off) for s, length in rest.items()},
        },
    )


def _last_length(geometry: HandGeometry, finger: str, found: Mapping[str, float]) -> float:
    """Length of a finger's distal phalanx, m, where those of the others were found."""
    chain, given = CHAINS[finger], geometry.lengths
    grown = given[chain[-1]] * sum(found.values()) / sum(given[s] for s in found)
    # the thumb's metacarpal is no part of its finger length
    counted = set(chain[-len(RATIOS[finger]) - 1 :]) & set(found)
    left = given[chain[-1]] - sum(found[s] - given[s] for s in counted)
    return left if finger in geometry.measured and left >= PLAUSIBLE["segment"][0] else grown


def hand_length(m: HandMeasures) -> float:
    """Length of the hand: measured, else from the palm, else from the fingers, else the average
    adult's."""
    if m.hand_length is not None:
        return m.hand_length
    if m.palm_length is not None or "middle_mcp" in m.joint_positions:
        return _palm_length(m, MEAN_HAND_LENGTH) / MCP_DISTAL["middle"]
    fingers = [value / FINGER_LENGTH[finger] for finger, value in m.finger_length.items()]
    return float(np.mean(fingers)) if fingers else MEAN_HAND_LENGTH


def check(m: HandMeasures) -> None:
    """Refuse a length that no hand has: most often millimetres given as metres."""
    given: dict[str, tuple[Any, str]] = {
        phrase("hand.measure_hand_length"): (m.hand_length, "hand_length"),
        phrase("hand.measure_hand_breadth"): (m.hand_breadth, "hand_breadth"),
        phrase("hand.measure_palm_length"): (m.palm_length, "palm_length"),
    }
    given |= {
        phrase("hand.length_of", segment=finger): (value, "finger")
        for finger, value in m.finger_length.items()
    }
    given |= {
        phrase("hand.length_of", segment=s): (value, "forearm" if s == "forearm" else "segment")
        for s, value in m.segment_length.items()
    }
    given |= {f"tip_tissue {finger}": (value, "tissue") for finger, value in m.tip_tissue.items()}
    for name, (value, kind) in given.items():
        low, high = PLAUSIBLE[kind]
        if value is not None and not low <= value <= high:
            in_mm = {"value": 1e3 * value, "least": 1e3 * low, "most": 1e3 * high}
            raise InputError("hand.geometry_length_outside", name=name, **in_mm)
    for joint, position in m.joint_positions.items():
        low, high = PLAUSIBLE["thumb_cmc" if joint == "thumb_cmc" else "palm_length"]
        if (
            joint not in {root_joint(f) for f in FINGERS}
            or len(position) != 3
            or not low <= np.linalg.norm(position) <= high
        ):
            raise InputError("hand.geometry_joint_position", joint=joint, place=str(list(position)))


def measures_from(table: Mapping[str, Any]) -> HandMeasures:
    """Read the contract's `HandGeometry` object: named measures, and functional lengths by segment
    name."""
    _require_known(table)
    try:
        scalars = {
            name: float(table[name])
            for name in ("hand_length", "hand_breadth", "palm_length")
            if table.get(name) is not None
        }
        if table.get("hand") is not None:  # the hand's functional length is the palm's
            scalars.setdefault("palm_length", float(table["hand"]))
        by_finger = {
            name: {f: float(v) for f, v in dict(table.get(name) or {}).items()}
            for name in ("finger_length", "tip_tissue")
        }
        segments = {
            s: float(table[s]) for s in SEGMENTS if s != "hand" and table.get(s) is not None
        }
        positions = {
            j: (float(x), float(y), float(z))
            for j, (x, y, z) in dict(table.get("joint_positions") or {}).items()
        }
        measured = (
            None
            if table.get("measured") is None
            else frozenset(str(name) for name in table["measured"])
        )
    except (TypeError, ValueError) as problem:
        raise InputError("hand.geometry_unreadable", problem=str(problem)) from None
    _require_fingers(by_finger)
    measures = HandMeasures(
        **scalars,
        finger_length=by_finger["finger_length"],
        segment_length=segments,
        tip_tissue=by_finger["tip_tissue"],
        joint_positions=positions,
        measured=measured,
    )
    check(measures)
    return measures


def _require_known(table: Mapping[str, Any]) -> None:
    """InputError where an entry is neither a measure nor a segment."""
    known = {
        "hand_length",
        "hand_breadth",
        "palm_length",
        "finger_length",
        "tip_tissue",
        "joint_positions",
        "measured",
    }
    unknown = set(table) - known - set(SEGMENTS)
    if unknown:
        raise InputError(
            "hand.geometry_unknown_entries",
            names=str(sorted(unknown)),
            known=str(sorted(known)),
        )


def _require_fingers(by_finger: Mapping[str, Mapping[str, float]]) -> None:
    """InputError where a measure by finger names something else."""
    for name, values in by_finger.items():
        if set(values) - set(FINGERS):
            raise InputError(
                "hand.geometry_unknown_fingers",
                name=name,
                fingers=str(sorted(set(values) - set(FINGERS))),
                known=", ".join(FINGERS),
            )


def table_of(geometry: HandGeometry) -> dict[str, Any]:
    """The contract's `HandGeometry` object of a sized hand: reading it back gives the same hand."""
    return {
        "palm_length": geometry.palm_length,
        **{
            segment: value
            for segment, value in geometry.lengths.items()
            if segment != "hand" and value > 0
        },
        "tip_tissue": dict(geometry.tip_tissue),
        "joint_positions": {joint: list(p) for joint, p in geometry.joint_positions.items()},
        "measured": sorted(geometry.measured),
    }


def _palm_length(m: HandMeasures, hand: float) -> float:
    if m.palm_length is None and "middle_mcp" in m.joint_positions:
        return float(np.linalg.norm(m.joint_positions["middle_mcp"]))
    return m.palm_length if m.palm_length is not None else MCP_DISTAL["middle"] * hand


def _phalanges(
    finger: str, measured: Mapping[str, float], outer: float | None, typical: float, tissue: float
) -> dict[str, float]:
    """Split a finger by the ratios of Table 2; measured phalanges stay, the others share what is
    left."""
    # the thumb's ratio covers its two phalanges
    segments = CHAINS[finger][-len(RATIOS[finger]) - 1 :]
    share = np.cumprod([1.0, *RATIOS[finger][::-1]])[::-1]  # distal = 1, then proximally
    known = {s: measured[s] for s in segments if s in measured}
    free = {s: w for s, w in zip(segments, share) if s not in known}
    if not free:
        return known
    if outer is not None:
        scale = (outer - tissue - sum(known.values())) / sum(free.values())
        if scale <= 0:
            raise InputError("hand.phalanges_longer_than_finger", finger=finger, length=outer)
    elif known:
        scale = sum(known.values()) / sum(w for s, w in zip(segments, share) if s in known)
    else:
        scale = (typical - tissue) / sum(free.values())
    return known | {s: float(w * scale) for s, w in free.items()}


def _joint_positions(
    hand: Hand, m: HandMeasures, palm: float, breadth: float
) -> dict[str, tuple[float, float, float]]:
    length = palm / MCP_DISTAL["middle"]
    dorsal_distal_ulnar = {
        f"{f}_mcp": (0.0, MCP_DISTAL[f] * length, MCP_ULNAR[f] * breadth) for f in MCP_DISTAL
    }
    reach = THUMB_CMC_DISTANCE * length
    dorsal_distal_ulnar["thumb_cmc"] = (
        0.0,
        float(reach * np.cos(THUMB_ANGLE)),
        float(-reach * np.sin(THUMB_ANGLE)),
    )
    sign = side_sign(hand)
    derived = {
        joint: (sign * x, sign * y, sign * z) for joint, (x, y, z) in dorsal_distal_ulnar.items()
    }
    return derived | dict(m.joint_positions)
