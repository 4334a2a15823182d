"""The palm as a smooth field: metacarpals, thenar and hypothenar eminence, webs, wrist and the first part of every finger, blended into one surface.

In      a sized hand; points in the left hand's frame (dorsal, distal, ulnar) from the wrist, fingers in the bound pose
Out     a field that is negative inside, about the distance to the skin in m
Source  ours: drawn after photographs and atlases; places as shares of palm length and hand breadth. Only what is seen depends on it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handscope.app.scene.mesh import bones
from handscope.app.scene.mesh.finger_mesh import leaves_palm
from handscope.app.scene.mesh.finger_shape import (
    SQUARENESS,
    FingerShape,
    finger_shape,
    hand_breadth,
)
from handscope.estimators.hand.anatomy import FINGERS, side_sign
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

FOREARM = 0.55  # of palm length: how much of the forearm is drawn
_STUB = 6e-3  # m, the palm's surface reaches this far into a finger's mesh
_BEGINS = 0.20  # of hand breadth, before a finger's first joint: there its surface begins, within the palm
# of hand breadth: distance below which bodies blend
_BLEND = {"palm": 0.100, "finger": 0.070, "web": 0.11, "stub": 0.045}


@dataclass(frozen=True)
class Root:
    """Where a finger leaves the palm in the bound pose."""

    shape: FingerShape
    q: Array  # (4,) from the finger's first segment to the hand
    place: Array  # (3,) m, its first joint

    def local(self, points: Array) -> Array:
        """Points (..., 3) in the finger's coordinates (dorsal, distal, ulnar)."""
        return quat.rotate(quat.conjugate(self.q), points - self.place)

    def on_hand(self, points: Array) -> Array:
        """The finger's points (..., 3) in the hand's frame."""
        return quat.rotate(self.q, points) + self.place


@dataclass(frozen=True)
class PalmShape:
    """Everything that the palm's field needs, in the left hand's frame for either hand."""

    roots: Mapping[str, Root]
    ends: Mapping[str, float]  # m, distal coordinate at which each finger's stub ends
    breadth: float  # m
    length: float  # m, wrist to the middle finger's MCP

    def at(self, dorsal: float, distal: float, ulnar: float) -> Array:
        """A place given as shares of hand breadth, palm length and hand breadth."""
        return np.array([dorsal * self.breadth, distal * self.length, ulnar * self.breadth])

    def on_finger(self, finger: str, dorsal: float, along: float, ulnar: float = 0.0) -> Array:
        """A place on a finger's first segment: shares of hand breadth, of the segment's length and of hand breadth."""
        shape = self.roots[finger].shape
        return self.roots[finger].on_hand(
            np.array([dorsal * self.breadth, along * shape.joints[1], ulnar * self.breadth])
        )

    def forearm_half_axes(self, distal: Array) -> tuple[Array, Array]:
        """Half depth and half breadth of the forearm at distal coordinates (n,), negative towards the elbow, m."""
        share = np.clip(-distal / (FOREARM * self.length), 0.0, 1.0)
        return (0.195 + 0.045 * share) * self.breadth, (0.305 + 0.05 * share) * self.breadth

    def field(self, points: Array) -> Array:
        """The field (n,) at points (n, 3)."""
        blend = {name: k * self.breadth for name, k in _BLEND.items()}
        palm = self._forearm(points)
        for start, stop, r_start, r_stop in self._bodies():
            palm = smooth_union(
                palm,
                _cone(points, start, stop, r_start * self.breadth, r_stop * self.breadth),
                blend["palm"],
            )
        palm = smooth_union(palm, self._first_web(points), blend["web"])
        fingers = self._stub(FINGERS[0], points)
        for finger in FINGERS[1:]:
            fingers = smooth_union(fingers, self._stub(finger, points), blend["stub"])
        return smooth_union(palm, fingers, blend["finger"])

    def _bodies(self) -> list[tuple[Array, Array, float, float]]:
        """Round cones: start, stop and their radii as shares of hand breadth."""
        mcp = {finger: self.roots[finger].place for finger in FINGERS}
        dorsal = np.array([self.breadth, 0.0, 0.0])
        metacarpals = [
            (self.at(0.02, 0.22, base), mcp[finger] - 0.008 * dorsal, 0.125, radius)
            for finger, base, radius in (
                ("index", -0.15, 0.128),
                ("middle", -0.04, 0.138),
                ("ring", 0.07, 0.130),
                ("little", 0.17, 0.108),
            )
        ]
        pads = [
            (self.on_finger(a, -0.045, 0.12), self.on_finger(b, -0.045, 0.12), 0.098, 0.098)
            for a, b in (("index", "middle"), ("middle", "ring"), ("ring", "little"))
        ]
        knuckles = [
            (0.66 * mcp[f] + 0.022 * dorsal, mcp[f] + 0.030 * dorsal, 0.085, 0.092)
            for f in FINGERS[1:]
        ]
        thenar = [
            (self.at(-0.09, 0.20, -0.16), self.on_finger("thumb", -0.03, 0.48), 0.165, 0.125),
            (self.at(-0.11, 0.30, -0.10), self.on_finger("thumb", -0.05, 0.35, 0.06), 0.13, 0.13),
        ]
        hypothenar = [(self.at(-0.09, 0.16, 0.20), self.at(-0.05, 0.66, 0.365), 0.150, 0.115)]
        carpus = [(self.at(0.0, 0.02, -0.12), self.at(0.0, 0.06, 0.13), 0.185, 0.180)]
        return [*metacarpals, *pads, *knuckles, *thenar, *hypothenar, *carpus]

    def _first_web(self, points: Array) -> Array:
        """The fold between thumb and index finger."""
        index = self.at(-0.02, 0.60, -0.22)
        return np.minimum(
            _cone(
                points,
                self.on_finger("thumb", -0.01, 0.36),
                index,
                0.055 * self.breadth,
                0.06 * self.breadth,
            ),
            _cone(
                points,
                self.on_finger("thumb", -0.01, 0.54),
                index,
                0.035 * self.breadth,
                0.06 * self.breadth,
            ),
        )

    def _forearm(self, points: Array) -> Array:
        """An elliptic stump that grows a little towards the elbow and ends round."""
        d, y, u = points[:, 0], points[:, 1], points[:, 2]
        end = FOREARM * self.length
        radial = _elliptic(d, u, *self.forearm_half_axes(y), 2.0)
        return -smooth_union(
            -radial, -np.maximum(y - 0.2 * self.length, -y - end), 0.14 * self.breadth
        )

    def _stub(self, finger: str, points: Array) -> Array:
        """The finger's own skin, a little further than where its mesh begins."""
        root = self.roots[finger]
        local = root.local(points)
        t, end = local[:, 1], self.ends[finger]
        begin = _BEGINS * self.breadth
        # round where it begins, within the palm
        roundness = np.sqrt(np.clip(1.0 - np.minimum(t / begin, 0.0) ** 2, 0.05, 1.0))
        breadth, dorsal, palmar = roundness * np.moveaxis(
            root.shape.section(np.clip(t, 0.0, end + _STUB)), -1, 0
        )
        radial = _elliptic(
            local[:, 0], local[:, 2], np.where(local[:, 0] > 0, dorsal, palmar), breadth, SQUARENESS
        )
        within = np.maximum(t - end, -t - begin)
        return -smooth_union(-radial, -within, 0.6 * _STUB)


def palm_shape(geometry: HandGeometry) -> PalmShape:
    """The palm of a sized hand, on the left hand's frame."""
    q, places = bones.chain(bones.BOUND, geometry)
    sign = side_sign(geometry.hand)
    roots = {
        f: Root(finger_shape(f, geometry), q[k, 0], sign * places[k, 0])
        for k, f in enumerate(FINGERS)
    }
    ends = {f: leaves_palm(f, root.shape) + _STUB for f, root in roots.items()}
    return PalmShape(roots, ends, hand_breadth(geometry), geometry.palm_length)


def smooth_union(a: Array, b: Array, k: float) -> Array:
    """The smaller of two fields, rounded where they differ by less than k; exact elsewhere. Source: Quilez, polynomial smooth minimum."""
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - h * h * k * 0.25


def _cone(points: Array, start: Array, stop: Array, r_start: float, r_stop: float) -> Array:
    """A capsule whose radius changes along it."""
    axis = stop - start
    length2 = float(axis @ axis)
    share = np.clip((points - start) @ axis / length2, 0.0, 1.0)
    off = points - start - share[:, None] * axis
    return np.asarray(
        np.sqrt(np.einsum("ij,ij->i", off, off)) - (r_start + share * (r_stop - r_start))
    )


def _elliptic(
    depth: Array, across: Array, half_depth: Array, half_breadth: Array, exponent: float
) -> Array:
    """About the distance to a superelliptic cylinder, exact on its surface."""
    norm = (np.abs(depth / half_depth) ** exponent + np.abs(across / half_breadth) ** exponent) ** (
        1 / exponent
    )
    off = np.hypot(depth, across)
    return np.where(
        off > 1e-6, off * (1 - 1 / np.maximum(norm, 1e-6)), -np.minimum(half_depth, half_breadth)
    )
