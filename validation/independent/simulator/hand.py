"""A thumb and an index finger that close on something: where segments and pads are for given angles, and which angles bring the pads to a distance.

Frames  of the hand and its segments: left dorsal, distal, ulnar; right palmar, proximal, radial. Rotations take vectors of a segment to the hand
Units   m, rad
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

Values = NDArray[np.float64]
SEGMENTS = (
    "hand",
    "thumb_metacarpal",
    "thumb_proximal",
    "thumb_distal",
    "index_proximal",
    "index_middle",
    "index_distal",
)
LENGTHS = dict(zip(SEGMENTS[1:], (0.046, 0.033, 0.026, 0.044, 0.0245, 0.019)))
# of a left hand
THUMB_BASE, KNUCKLE = np.array([-0.010, 0.024, -0.030]), np.array([0.0, 0.090, -0.026])
PALM = 0.095
# CMC z x y, MCP, IP of the thumb; MCP z x, PIP, DIP of the index finger
GRASP = np.radians([40, -34, 72, 14, 14, 28, 6, 26, 16.0])
LEAST = np.radians([5, -60, 30, -8, -12, -5, -15, 2, 0.0])
MOST = np.radians([65, -2, 105, 55, 60, 80, 15, 95, 65.0])
KNOTS = 9


@dataclass(frozen=True)
class Hand:
    """Sizes of a thumb and an index finger, m."""

    sign: float  # 1 left, -1 right
    lengths: dict[str, float]
    thumb_base: Values  # (3,)
    knuckle: Values  # (3,)
    thick: tuple[float, float]  # from the bone to the pad: thumb, index finger
    back: tuple[float, float]  # from the bone's end to where the pad touches

    def rotations(self, angles: Values) -> list[Rotation]:
        """Of the six phalanges, for angles (n, 9)."""
        zero = np.zeros(len(angles))

        def turned(*columns: Values) -> Rotation:
            return Rotation.from_euler("ZXY", np.stack(columns, axis=1))

        metacarpal = turned(angles[:, 0], angles[:, 1], angles[:, 2])
        thumb = metacarpal * turned(angles[:, 3], zero, zero)
        index = turned(angles[:, 5], angles[:, 6], zero)
        middle = index * turned(angles[:, 7], zero, zero)
        return [
            metacarpal,
            thumb,
            thumb * turned(angles[:, 4], zero, zero),
            index,
            middle,
            middle * turned(angles[:, 8], zero, zero),
        ]

    def ends(self, rotations: list[Rotation]) -> tuple[dict[str, Values], Values, Values]:
        """Distal ends of the phalanges by name, pad of the thumb, pad of the index finger, each (n, 3)."""
        out: dict[str, Values] = {}
        for finger, base in (("thumb", self.thumb_base), ("index", self.knuckle)):
            at = self.sign * base
            for name, rotation in zip(SEGMENTS[1:], rotations):
                if name.startswith(finger):
                    at = at + rotation.apply(self.sign * np.array([0.0, self.lengths[name], 0.0]))
                    out[name] = at
        pads = [
            out[f"{finger}_distal"] + rotation.apply(self.sign * np.array([-thick, -back, 0.0]))
            for finger, rotation, thick, back in zip(
                ("thumb", "index"), (rotations[2], rotations[5]), self.thick, self.back
            )
        ]
        return out, pads[0], pads[1]

    def closing(self, distance: Values) -> Values:
        """Angles (n, 9) that bring the pads to distances (n,), one facing the other."""
        low, high = float(distance.min()), float(distance.max())
        if high - low < 1e-6:
            return np.repeat(self._close_to(np.array([low])), len(distance), axis=0)
        knots = np.linspace(low - 1e-3, high + 1e-3, KNOTS)
        return np.asarray(make_interp_spline(knots, self._close_to(knots), k=5)(distance))

    def _close_to(self, distances: Values) -> Values:
        found, x = [], GRASP
        for wanted in distances:

            def missed(x: Values, wanted: float = wanted) -> Values:
                rotations = self.rotations(x[None])
                _, thumb, index = self.ends(rotations)
                line = (thumb - index)[0]
                distance = float(np.linalg.norm(line))
                faces = [
                    rotations[k].apply(self.sign * np.array([-1.0, 0.0, 0.0]))[0] for k in (2, 5)
                ]
                return np.concatenate(
                    [
                        [2000 * (distance - wanted)],
                        0.5 * (faces[1] - line / distance),
                        0.5 * (faces[0] + line / distance),
                        0.5 * (x - GRASP),
                    ]
                )

            x = least_squares(missed, np.clip(x, LEAST + 1e-3, MOST - 1e-3), bounds=(LEAST, MOST)).x
            found.append(x)
        return np.array(found)


def draw_hand(rng: np.random.Generator, side: str) -> Hand:
    """Somebody's: lengths by 6 %, places of joints by 5 % of the mean hand's."""
    lengths = {name: length * rng.normal(1, 0.06) for name, length in LENGTHS.items()}
    base, knuckle = THUMB_BASE * rng.normal(1, 0.05), KNUCKLE * rng.normal(1, 0.05)
    thick = 0.0085 + rng.normal(0, 0.0006), 0.007 + rng.normal(0, 0.0005)
    return Hand(
        1.0 if side == "left" else -1.0,
        lengths,
        base,
        knuckle,
        thick,
        (rng.normal(0, 0.0015), rng.normal(0, 0.0015)),
    )


def measured(hand: Hand, rng: np.random.Generator, missed: float = 0.02) -> dict[str, object]:
    """The hand as a clinician measures it, for the sidecar: lengths by 2 %, places of joints by 1 mm."""
    geometry: dict[str, object] = {
        name: float(length * rng.normal(1, missed)) for name, length in hand.lengths.items()
    }
    places = {"index_mcp": hand.knuckle, "thumb_cmc": hand.thumb_base}
    geometry["joint_positions"] = {
        joint: (hand.sign * (p + 0.001 * rng.normal(size=3))).tolist()
        for joint, p in places.items()
    }
    return geometry | {"palm_length": PALM}
