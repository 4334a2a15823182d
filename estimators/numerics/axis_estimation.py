"""The axis about which a segment turned while a joint bent, seen by its gyroscope; and the rotation
between two sensors that turned together.

In      angular rates (n, 3) of one movement in the sensor's frame, rad/s, bias removed, evenly
        sampled
Out     the axis with the sign of flexion, how much of the movement was about it, how similar the
        single repetitions were; q_ab with what is left over
Source  Kortier, thesis (2.34): z is the gyroscope's direction in flexion; principal axis over the
        whole movement instead of one sample, outliers weighted down (Cauchy). Rotation of two
        rates: Wahba 1965, solved by SVD (Markley 1988); so did the thesis' chapter 3 relate two
        hand sensors
Limits  an axis is that of everything the segment did: what its parent did is part of it
        (estimators/alignment/mounting_fit.py resolves that)
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

SLOW = 0.05  # rad/s, ours: perpendicular rates below count fully, however still the rest
REWEIGHTINGS = 8


@dataclass(frozen=True)
class Bending:
    """How a segment turned when a joint bent and stretched a few times."""

    axis: Array  # (3,) in the sensor's frame; positive turns are flexion
    planarity: float  # share of the squared rate about the axis
    repetitions: int
    # rad, largest angle between the axis of a single repetition and the whole; 0 with a single one
    repeatability: float
    extent: float  # rad, from straightest to most bent


@dataclass(frozen=True)
class CommonRotation:
    """Two sensors on one rigid body: w_a = rotate(q_ab, w_b)."""

    q_ab: Array  # (4,)
    residual: float  # RMS of what differs, share of the RMS rate
    # second principal rate against the first: 0 is a turn about one axis only, which determines nothing
    # about a turn around that
    spread: float


def principal_axis(rate: Array) -> Array:
    """Axis (3,), either sign, about which most of the movement (n, 3) was; single samples that were
    about another axis count little."""
    weight = np.ones(len(rate))
    for _ in range(REWEIGHTINGS):
        axis = np.asarray(np.linalg.eigh((rate * weight[:, None]).T @ rate)[1][:, -1])
        aside = np.linalg.norm(rate - np.outer(rate @ axis, axis), axis=1)
        weight = 1.0 / (1.0 + (aside / (2.0 * np.median(aside) + SLOW)) ** 2)
    return axis


def fit_bending(rate: Array, dt: float) -> Bending:
    """The flexion that began near straight: from there a joint bends further than it stretches."""
    axis = principal_axis(rate)
    angle = _integral(rate @ axis, dt)
    if angle.max() < -angle.min():
        axis, angle = -axis, -angle
    edges = _edges(angle)
    single = [principal_axis(rate[a:b]) for a, b in zip(edges, edges[1:])]
    deviations = [float(np.arccos(min(1.0, abs(float(s @ axis))))) for s in single]
    total = float((rate * rate).sum())
    planarity = float(((rate @ axis) ** 2).sum()) / total if total else 0.0
    return Bending(
        axis,
        planarity,
        len(single),
        max(deviations, default=0.0) if len(single) > 1 else 0.0,
        float(np.ptp(angle)),
    )


def fit_common_rotation(rate_a: Array, rate_b: Array) -> CommonRotation:
    """The rotation that takes the rates (n, 3) of b to those of a, least squares."""
    U, _, Vt = np.linalg.svd(rate_a.T @ rate_b)
    R_ab = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    left = rate_a - rate_b @ R_ab.T
    total = float(np.sqrt((rate_a * rate_a).sum() + 1e-30))
    principal = np.linalg.svd(rate_a, compute_uv=False)
    return CommonRotation(
        quat.from_matrix(R_ab),
        float(np.linalg.norm(left)) / total,
        float(principal[1] / (principal[0] + 1e-30)),
    )


def _integral(rate: Array, dt: float) -> Array:
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * dt)])


def _edges(angle: Array) -> list[int]:
    """Where single repetitions begin and end: at the straightest moments around each peak."""
    from scipy.signal import find_peaks  # takes as long to import as all else that a method needs

    peaks = find_peaks(angle, prominence=max(0.5 * float(np.ptp(angle)), 1e-6))[0]
    if not len(peaks):
        return [0]
    valleys = [int(a + np.argmin(angle[a:b])) for a, b in zip(peaks, peaks[1:])]
    return [0, *valleys, len(angle)]
