"""What a chain's sensors and joints say: measurements of an error-state filter with their Jacobians.

In      rotations between sensors, gravity or specific forces in their frames (F, 4, 3), how fast they turn (F, 4); the true joints (ekf_seats.Seated)
Out     rows for a Kalman update: what was missed, its Jacobian by the 42 error states, its variance
Source  Kortier, thesis ch. 2: (2.25)-(2.28) vectors of neighbouring segments with their gates, (2.29)-(2.32) what joints cannot do, written for angles:
        the same for small ones, and ranges of motion fit in; zero-rate updates as VQF has them (Laidig & Seel 2023)
Limits  time-correlated noise counts as white noise of as much more variance as the time it lasts is longer than the time between two updates
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimators import hand_anatomy, joint_angles
from estimators import quaternions as quat
from estimators.ekf_seats import SIZE, Seated
from estimators.hand_anatomy import DEVIATION, FINGER_JOINTS, FINGERS, FLEXION, IS_DOF, JOINT, PRONATION
from estimators.options import option
from estimators.quaternions import Array

GRAVITY = 9.80665  # m/s^2
REST = 1.5  # s that a sensor has to rest before its rate counts as bias: VQF's restMinT
SETTLED = 20.0  # s over which the vertical is taken where turns about it must not be seen: VQF's errors stay alike for 3
STEEPEST = np.radians(80.0)  # at 90 deg of deviation flexion and pronation are one
_CHAINS = [
    *([JOINT[j] for j in FINGER_JOINTS[f]] for f in FINGERS),
    [JOINT["wrist"]] * 3,
]  # the wrist's has one joint: the others are never known
IS_FREE: NDArray[np.bool_] = IS_DOF[np.array(_CHAINS)]  # (6 chains, 3 joints, 3 angles)
LIMITS: Array = hand_anatomy.LIMITS[np.array(_CHAINS)]  # (6, 3, 3, 2) rad


@dataclass(frozen=True, kw_only=True)
class UpdateParams:
    vertical: str = option(
        "fused",
        "",
        "which way is up for a sensor: as its own fusion has it (VQF), or its accelerometer where the thesis' gates let it pass",
        "accelerometers: Kortier thesis, (2.25)-(2.28); fused: ours, not disturbed by movement",
        ("fused", "accelerometers"),
    )
    inclination: float = option(
        0.5, "deg", "error of gravity's direction as a sensor's fusion sees it", "VQF on the BROAD trials: docs/reproduction.md", least=0.01
    )
    inclination_time: float = option(3.0, "s", "time over which that error stays alike", "VQF's tauAcc", least=0.0)
    acc_noise: float = option(0.04, "m/s^2", "white noise of an accelerometer axis", "Kortier thesis, Table 2.1", least=1e-4)
    acc_error: float = option(
        0.1, "m/s^2", "what two accelerometers at rest may differ by else: bias, scale", "ours; of the thesis' model none"
    )
    acc_gate: float = option(
        0.5, "m/s^2", "accelerometers whose magnitudes differ by more are left out", "Kortier thesis, (2.27): eps_a; size ours"
    )
    rate_gate: float = option(
        2.0, "rad/s", "accelerometers of segments that turn faster are left out", "Kortier thesis, (2.28): eps_b; size ours", least=0.01
    )
    lever: float = option(
        0.04, "m", "distance between neighbouring sensors, over which turning makes them feel different accelerations", "ours: a phalanx"
    )
    dimensions: bool = option(True, "", "use what the joints cannot do", "Kortier thesis, (2.29)-(2.32); ranges: hand_anatomy.py")
    dimension_noise: float = option(
        2.0,
        "deg",
        "turn of a true joint about an axis that is no freedom, or beyond its range, and of its sensors beyond seat and skin",
        "ours; 1e-5 deg in Kortier's Table 2.1, which knows no soft tissue",
        least=1e-5,
    )
    correlation: float = option(
        1.0, "s", "time over which errors of accelerometers and joints stay alike", "ours: half a movement", least=0.0
    )
    rest_rate: float = option(
        0.5,
        "deg/s",
        "a sensor that turns slower for 1.5 s rests",
        "ours; VQF's 2 deg/s takes the skin's turn over a moving finger for rest, more often one way than the other once a bias is wrong",
        least=0.01,
    )
    creeping: float = option(
        0.1,
        "deg/s",
        "rate at which a sensor that seems to rest still turns, for 1.5 s alike",
        "ours: as rest_turn; weighs as it does in VQF",
        least=1e-3,
    )


@dataclass(frozen=True)
class Rows:
    """M measurements of each chain; those that are not used have zero Jacobians and miss nothing."""

    missed: Array  # (F, M) measured minus expected
    H: Array  # (F, M, 42) by the error states
    noise: Array  # (F, M, M) covariance


def vectors(params: UpdateParams, R_pc: Array, acc: Array, up: Array, rates: Array, usable: NDArray[np.bool_], span: float) -> Rows:
    """Three rows a joint: both sensors see the same vector acc (F, 4, 3); `usable` (F, 3) says where both are measured.

    Turns about the vertical are not seen. The slopes are taken at `up` (F, 4, 3), the vertical as it was seen over a long time: about the newest, whose
    errors change all the time, the filter would seem to see them after all (Huang, Mourikis & Roumeliotis 2010, Int J Rob Res 29:502).

    Neighbouring joints share a sensor and its error: what the one joint misses too much the other misses too little.
    """
    parent, child = acc[:, :3], acc[:, 1:]
    expected = (R_pc @ child[..., None])[..., 0]
    if params.vertical == "fused":
        used, lasts = usable, params.inclination_time
        variance = np.full(usable.shape, 2 * (GRAVITY * np.radians(params.inclination)) ** 2)
    else:
        apart = np.abs(_norm(parent) - _norm(child))  # (2.27)
        fastest = np.maximum(rates[:, :3], rates[:, 1:])  # (2.28)
        used, lasts = usable & (apart < params.acc_gate) & (fastest < params.rate_gate), params.correlation
        variance = 2 * params.acc_noise**2 + params.acc_error**2 + apart**2 + (params.lever * fastest**2) ** 2
    H = np.zeros((len(acc), 3, 3, SIZE))
    slopes = np.where(used[..., None, None], vector_jacobian(R_pc, GRAVITY * up[:, 1:]), 0.0)
    for j in range(3):
        H[:, j, :, 3 * j : 3 * j + 3] = slopes[:, j]
    rows = _rows(np.where(used[..., None], parent - expected, 0.0), H, np.repeat(variance[..., None], 3, axis=-1))
    for j in range(2):
        a, b = slice(3 * j, 3 * j + 3), slice(3 * j + 3, 3 * j + 6)
        shared = -0.5 * np.sqrt(variance[:, j] * variance[:, j + 1])[:, None, None] * R_pc[:, j]
        rows.noise[:, a, b], rows.noise[:, b, a] = shared, shared.transpose(0, 2, 1)
    return replace(rows, noise=rows.noise * max(1.0, lasts / span))


def settled(up: Array, turned: Array, acc: Array, told: NDArray[np.bool_], span: float) -> Array:
    """The vertical (F, 4, 3) over a long time in frames that have turned by `turned` (F, 4, 4), drawn towards what is `told` (F, 4) now."""
    carried, now = quat.rotate(quat.conjugate(turned), up), acc / np.where(told, _norm(acc), 1.0)[..., None]
    far = ((carried * now).sum(axis=-1) < np.cos(np.radians(10.0)))[..., None]  # a beginning, or after a gap
    mixed = carried + np.where(far, 1.0, min(1.0, span / SETTLED)) * (now - carried)
    mixed = np.where(told[..., None], mixed, carried)
    size = _norm(mixed)[..., None]
    return np.asarray(mixed / np.where(size > 0, size, 1.0))


def vector_jacobian(R_pc: Array, v_c: Array) -> Array:
    """How R_pc v_c changes with dth: -R_pc [v_c]x (..., 3, 3). (2.26)"""
    return np.asarray(-R_pc @ quat.skew(v_c))


def joints(
    params: UpdateParams, seated: Seated, P: Array, free: NDArray[np.bool_], limits: Array, known: NDArray[np.bool_], span: float
) -> Rows:
    """Three rows a joint: angles that are no freedom are zero, the others within their range; softly. (2.29)-(2.32)

    Slopes are taken where the joint is allowed to be, so that a hinge never seems to tell its flexion. The end of a range tells only that an angle is
    below it: its noise is as large as the angle's own, from the joints' covariance P (F, 9, 9).
    """
    angles = joint_angles.decompose(seated.q)
    allowed = np.minimum(np.maximum(angles, limits[..., 0]), limits[..., 1])
    missed = allowed - angles
    told = known[..., None] & (~free | (missed != 0)) & params.dimensions
    slopes = np.where(told[..., None], angle_jacobian(allowed), 0.0)
    own = np.stack([P[:, 3 * j : 3 * j + 3, 3 * j : 3 * j + 3] for j in range(3)], axis=1)
    unsure = np.where(free, ((slopes @ own) * slopes).sum(axis=-1), 0.0)
    variance = (np.radians(params.dimension_noise) ** 2 + unsure) * max(1.0, params.correlation / span)
    return _rows(np.where(told, missed, 0.0), slopes @ seated.A.reshape(-1, 3, 3, SIZE), variance)


def angle_jacobian(angles: Array) -> Array:
    """How flexion, deviation and pronation (..., 3) change with d, q_true = q exp(d): (..., 3 angles, 3)."""
    deviation = np.minimum(np.maximum(angles[..., DEVIATION], -STEEPEST), STEEPEST)
    c, s, cd, td = np.cos(angles[..., PRONATION]), np.sin(angles[..., PRONATION]), np.cos(deviation), np.tan(deviation)
    J = np.zeros((*angles.shape, 3))
    J[..., FLEXION, 0], J[..., FLEXION, 2] = -s / cd, c / cd
    J[..., DEVIATION, 0], J[..., DEVIATION, 2] = c, s
    J[..., PRONATION, 0], J[..., PRONATION, 1], J[..., PRONATION, 2] = s * td, 1.0, -c * td
    return J


def resting(params: UpdateParams, crept: Array, rest: Array, due: NDArray[np.bool_]) -> Rows:
    """Three rows a sensor: what it seemed to turn by, (F, 4, 3) rad in `rest` (F, 4) s, was its bias; of those that are `due`."""
    H = np.zeros((len(crept), 12, SIZE))
    H[:, range(12), range(9, 21)] = np.repeat(due, 3, axis=1)
    missed = np.where(due, 1.0 / np.where(due, rest, 1.0), 0.0)[..., None] * crept
    variance = np.full((len(crept), 12), np.radians(params.creeping) ** 2)
    return Rows(missed.reshape(-1, 12), H, variance[..., None] * np.eye(12))


def stacked(parts: list[Rows]) -> Rows:
    """All measurements as one, each part's noise its own."""
    missed, H = (np.concatenate([getattr(p, name) for p in parts], axis=1) for name in ("missed", "H"))
    noise, first = np.zeros((len(missed), missed.shape[1], missed.shape[1])), 0
    for part in parts:
        last = first + part.missed.shape[1]
        noise[:, first:last, first:last] = part.noise
        first = last
    return Rows(missed, H, noise)


def _rows(missed: Array, H: Array, variance: Array) -> Rows:
    """Rows of joints (F, 3, m), (F, 3, m, 42) as rows of the chain."""
    chains = len(missed)
    size = missed[0].size
    return Rows(missed.reshape(chains, -1), H.reshape(chains, -1, SIZE), variance.reshape(chains, -1, 1) * np.eye(size))


def _norm(v: Array) -> Array:
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z))
