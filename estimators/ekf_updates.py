"""What a finger's sensors and joints say about its joint rotations: measurements of an error-state filter with their Jacobians.

In      joint rotations R_pc (F, 3, 3, 3), specific forces (F, 4, 3) of the hand and the three phalanges in segment frames, how fast they turn (F, 4)
Out     rows for a Kalman update: what was missed, its Jacobian by the rotation errors dth (R_true = R_pc exp(dth)), its variance
Source  Kortier, thesis ch. 2: (2.25)-(2.28) vectors of neighbouring segments with their gates, (2.29)-(2.32) what joints cannot do; the component
        pairs of (2.32) are misprinted there: a hinge about z keeps z common
Limits  neighbours feel different accelerations while they turn: the variance grows with what the gates see; ranges of motion are not used
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimators import quaternions as quat
from estimators.hand_anatomy import DEVIATION, FINGER_JOINTS, FINGERS, IS_DOF, JOINT, PRONATION
from estimators.options import option
from estimators.quaternions import Array

GRAVITY = 9.80665  # m/s^2
X, Y, Z = 0, 1, 2
FORBIDS: NDArray[np.bool_] = np.array(
    [[[not IS_DOF[JOINT[j], angle] for angle in (PRONATION, DEVIATION)] for j in FINGER_JOINTS[f]] for f in FINGERS]
)  # (5 fingers, 3 joints, 2)


@dataclass(frozen=True, kw_only=True)
class UpdateParams:
    acc_noise: float = option(0.04, "m/s^2", "white noise of an accelerometer axis", "Kortier thesis, Table 2.1", least=1e-4)
    acc_error: float = option(
        0.34,
        "m/s^2",
        "what two accelerometers at rest may differ by for other reasons: bias, scale, turn of the sensor on the skin",
        "ours: 2 deg of skin turn in the field of gravity; of the thesis' model none",
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
    dimensions: bool = option(True, "", "use what the joints cannot do", "Kortier thesis, (2.29)-(2.32)")
    dimension_sd: float = option(
        5.0,
        "deg",
        "turn about an axis that is no freedom of its joint, for as long as the sensors sit as they do",
        "sensors 5-10 deg askew: Salchow-Hoemmen 2019, 5; size ours; 1e-5 deg in Kortier's Table 2.1",
    )
    dimension_noise: float = option(
        2.0,
        "deg",
        "the same turn, as far as it changes while the joint moves",
        "ours: skin that follows the joint turns a sensor by about this much; 1e-5 deg in Kortier's Table 2.1",
        least=1e-5,
    )


@dataclass(frozen=True)
class Rows:
    """M measurements of each finger; those that are not used have zero Jacobians."""

    missed: Array  # (F, M) measured minus expected
    H: Array  # (F, M, 9) by the errors of the three joints
    H_play: Array  # (F, M, 6) by the constant turns about axes that are no freedom: (joint, pronation or deviation)
    variance: Array  # (F, M)


def vectors(params: UpdateParams, R_pc: Array, acc: Array, rates: Array, usable: NDArray[np.bool_]) -> Rows:
    """Three rows a joint: specific forces (F, 4, 3) of its two segments agree; `usable` (F, 3) says where both are measured."""
    parent, child = acc[:, :3], acc[:, 1:]
    expected = (R_pc @ child[..., None])[..., 0]
    apart = np.abs(_norm(parent) - _norm(child))  # (2.27)
    fastest = np.maximum(rates[:, :3], rates[:, 1:])  # (2.28)
    used = usable & (apart < params.acc_gate) & (fastest < params.rate_gate)
    variance = 2 * params.acc_noise**2 + params.acc_error**2 + apart**2 + (params.lever * fastest**2) ** 2
    return _rows(
        np.where(used[..., None], parent - expected, 0.0),
        np.where(used[..., None, None], vector_jacobian(R_pc, child), 0.0),
        np.repeat(np.where(used, variance, 1.0)[..., None], 3, axis=-1),
    )


def vector_jacobian(R_pc: Array, v_c: Array) -> Array:
    """How R_pc v_c changes with dth: -R_pc [v_c]x (..., 3, 3). (2.26)"""
    return np.asarray(-R_pc @ quat.skew(v_c))


def dimensions(params: UpdateParams, R_pc: Array, forbids: NDArray[np.bool_], usable: NDArray[np.bool_]) -> Rows:
    """Two rows a joint: no pronation and, of a hinge, no deviation where it `forbids` them (F, 3, 2); softly."""
    used = forbids & usable[..., None] & params.dimensions
    rows = _rows(
        np.where(used, -leaning(R_pc), 0.0),
        np.where(used[..., None], leaning_jacobian(allowed(R_pc, forbids)), 0.0),
        np.where(used, np.radians(params.dimension_noise) ** 2, 1.0),
    )
    return replace(rows, H_play=used.reshape(len(used), 6, 1) * np.eye(6))


def leaning(R_pc: Array) -> Array:
    """e_z' R e_x and e_z' R e_y (..., 2): the sines of pronation (times the deviation's cosine) and deviation, both zero where z is common."""
    return np.stack([R_pc[..., Z, X], R_pc[..., Z, Y]], axis=-1)


def leaning_jacobian(row: Array) -> Array:
    """How `leaning` changes with dth (..., 2, 3), from the row e_z' R (..., 3): -e_z' R [e_x]x and -e_z' R [e_y]x. (2.31)"""
    x, y, z = row[..., X], row[..., Y], row[..., Z]
    zero = np.zeros_like(x)
    return np.stack([np.stack([zero, -z, y], axis=-1), np.stack([z, zero, -x], axis=-1)], axis=-2)


def allowed(R_pc: Array, forbids: NDArray[np.bool_]) -> Array:
    """The row e_z' R (..., 3) without what the joint forbids: where the Jacobian is taken, so that a hinge never seems to tell its flexion."""
    x, y = (np.where(forbids[..., k], 0.0, R_pc[..., Z, k]) for k in (X, Y))
    return np.stack([x, y, np.copysign(np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0)), R_pc[..., Z, Z])], axis=-1)


def stacked(parts: list[Rows]) -> Rows:
    """All measurements as one."""
    return Rows(*(np.concatenate([getattr(p, name) for p in parts], axis=1) for name in ("missed", "H", "H_play", "variance")))


def _rows(missed: Array, H: Array, variance: Array) -> Rows:
    """Rows of joints (F, 3, m), (F, 3, m, 3) as rows of the finger, each by its own joint's error only."""
    fingers, joints, m = missed.shape
    wide = np.zeros((fingers, joints, m, 9))
    for j in range(joints):
        wide[:, j, :, 3 * j : 3 * j + 3] = H[:, j]
    still = np.zeros((fingers, joints * m, 6))
    return Rows(missed.reshape(fingers, -1), wide.reshape(fingers, -1, 9), still, variance.reshape(fingers, -1))


def _norm(v: Array) -> Array:
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.asarray(np.sqrt(x * x + y * y + z * z))
