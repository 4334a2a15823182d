"""How thick a finger is along its length: half breadth, half depth to the back and half depth to the palm.

In      a sized hand
Out     a smooth profile in the straight finger's own coordinates (dorsal, distal, ulnar) from its first joint, m
Source  ours: drawn after photographs of hands, as shares of the finger's half breadth at the middle joint; that breadth is a share of hand
        breadth (ours; 20 mm for an index finger of an 85 mm hand). Only what is seen depends on it, no figure does.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.hand.geometry import MCP_ULNAR, HandGeometry
from handscope.estimators.numerics.typing import Array

# of hand breadth, at PIP; thumb at IP
HALF_BREADTH = {"thumb": 0.130, "index": 0.116, "middle": 0.119, "ring": 0.112, "little": 0.099}
SQUARENESS = 2.25  # exponent of the superellipse of a section: 2 is an ellipse

# segment, share of its length, half breadth, dorsal and palmar half depth in units of the half breadth at the middle joint
_FINGER = (
    (0, 0.00, 1.10, 1.00, 1.12),
    (0, 0.45, 0.98, 0.90, 1.00),
    (0, 0.75, 0.96, 0.86, 0.94),
    (1, 0.00, 1.00, 0.92, 0.88),
    (1, 0.30, 0.92, 0.80, 0.88),
    (1, 0.60, 0.88, 0.76, 0.88),
    (2, 0.00, 0.89, 0.78, 0.76),
    (2, 0.35, 0.87, 0.70, 0.80),
    (2, 0.70, 0.84, 0.60, 0.78),
    (2, 1.00, 0.74, 0.48, 0.60),
)
_THUMB = (
    (0, 0.00, 1.10, 1.00, 1.15),
    (0, 0.60, 1.05, 0.95, 1.10),
    (1, 0.00, 1.04, 1.00, 0.98),
    (1, 0.30, 0.94, 0.86, 0.92),
    (1, 0.65, 0.92, 0.82, 0.92),
    (2, 0.00, 1.00, 0.86, 0.84),
    (2, 0.35, 1.00, 0.74, 0.86),
    (2, 0.70, 0.95, 0.62, 0.82),
    (2, 1.00, 0.80, 0.46, 0.60),
)
_TIP_ROUNDING = 0.95  # of the half breadth: how far from the tip the section begins to close


@dataclass(frozen=True)
class FingerShape:
    """A straight finger; coordinates (dorsal, distal, ulnar) from its first joint."""

    joints: tuple[float, float, float]  # m, distal coordinate of the three joints; the first is 0
    length: float  # m, to the outer tip, tissue included
    half_breadth: float  # m, at the middle joint
    profile: CubicSpline  # distal coordinate -> (half breadth, dorsal half depth, palmar half depth), m, before the tip closes

    def section(self, t: Array) -> Array:
        """Half breadth, dorsal and palmar half depth (..., 3) at distal coordinates t (...)."""
        closing = self.length - _TIP_ROUNDING * self.half_breadth
        s = np.clip((t - closing) / (self.length - closing), 0.0, 1.0)
        sections: Array = (
            self.profile(np.clip(t, 0.0, self.length)) * np.sqrt(1.0 - s**2)[..., None]
        )
        return sections

    def surface(self, t: Array, phi: Array) -> Array:
        """Points (..., 3) of the skin at distal coordinate t and angle phi: 0 ulnar, pi/2 dorsal."""
        breadth, dorsal, palmar = np.moveaxis(self.section(t), -1, 0)
        c, s = np.cos(phi), np.sin(phi)
        depth = np.where(s > 0, dorsal, palmar)
        return np.stack(
            [depth * _square_off(s), np.broadcast_to(t, np.shape(s + t)), breadth * _square_off(c)],
            axis=-1,
        )


def hand_breadth(geometry: HandGeometry) -> float:
    """Breadth of the palm at the MCP joints, m, from the distance of the joints of index and little finger."""
    index, little = (geometry.joint_positions[f"{finger}_mcp"][2] for finger in ("index", "little"))
    return abs(little - index) / (MCP_ULNAR["little"] - MCP_ULNAR["index"])


def finger_shape(finger: str, geometry: HandGeometry) -> FingerShape:
    """The finger as long as measured and as thick as the hand is broad."""
    lengths = [geometry.lengths[segment] for segment in CHAINS[finger]]
    lengths[2] += geometry.tip_tissue[finger]
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    half = HALF_BREADTH[finger] * hand_breadth(geometry)
    rows = _THUMB if finger == "thumb" else _FINGER
    stations = [starts[k] + share * lengths[k] for k, share, *_ in rows]
    profile = CubicSpline(stations, half * np.array([row[2:] for row in rows]), bc_type="natural")
    return FingerShape((0.0, float(starts[1]), float(starts[2])), float(starts[3]), half, profile)


def _square_off(x: Array) -> Array:
    return np.sign(x) * np.abs(x) ** (2.0 / SQUARENESS)
