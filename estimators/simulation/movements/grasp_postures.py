"""Postures in which fingertips touch or hold something: inverse kinematics by bounded least squares, and by Newton steps for whole motions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from handscope.estimators.data.fingertip_contacts import FINGERTIPS, contact_points_each
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import ANGLES, CHAINS, FINGERS, JOINTS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.motion import COORDINATES, make_posture

NATURAL = {
    "thumb_cmc": ((-10, 60), (-60, 10), (0, 110)),
    "thumb_mcp": ((0, 50),),
    "thumb_ip": ((-5, 60),),
}
NATURAL |= {
    f"{f}_{j}": r
    for f in FINGERS[1:]
    for j, r in {"mcp": ((-10, 85), (-15, 15)), "pip": ((0, 100),), "dip": ((0, 65),)}.items()
}

NUDGE, LONGEST_STEP = 1e-6, 0.2  # rad, of the Newton steps


@dataclass(frozen=True)
class Hold:
    """Two contact points kept at a distance: (finger, point) each, m."""

    a: tuple[str, str]
    b: tuple[str, str]
    distance: float

    @property
    def fingers(self) -> tuple[str, str]:
        return self.a[0], self.b[0]


def tips_of(x: Array, geometry: HandGeometry) -> Array:
    """Bone ends (5, 3) in WCS of a posture (54,)."""
    return forward_kinematics.tips(joint_angles.compose(x[6:].reshape(-1, 3)), geometry)


def pinch_posture(
    geometry: HandGeometry,
    finger: str = "index",
    distance: float | None = None,
    base: Array | None = None,
) -> Array:
    """A posture (54,) with the thumb's and the finger's bone ends `distance` apart (default: pads touching, both tissues)."""
    gap = (
        distance
        if distance is not None
        else geometry.tip_tissue["thumb"] + geometry.tip_tissue[finger]
    )
    return reach_posture(
        {("thumb", finger): gap}, geometry, ("thumb", finger), touching_posture(finger, base)
    )


def touching_posture(finger: str, base: Array | None) -> Array:
    """A posture (54,) near one in which the thumb's pad touches the finger's."""
    across = FINGERS.index(finger) - 1
    bent = {
        f"{finger}_mcp_flexion": 50.0,
        f"{finger}_pip_flexion": 45.0,
        f"{finger}_dip_flexion": 25.0,
    }
    thumb = {
        "thumb_cmc_flexion": 35.0 + 5 * across,
        "thumb_cmc_deviation": -20.0 + 5 * across,
        "thumb_cmc_pronation": 75.0,
        "thumb_mcp_flexion": 15.0 + 5 * across,
        "thumb_ip_flexion": 20.0,
    }
    return make_posture(base, **bent, **thumb)


def reach_posture(
    gaps: Mapping[tuple[str, str], float],
    geometry: HandGeometry,
    fingers: tuple[str, ...],
    guess: Array,
) -> Array:
    """The posture nearest to `guess` whose tips have the given mutual distances, within natural joint ranges; only `fingers` move."""
    free = [c for f in fingers for c in freedoms(f)]
    columns = np.array([COORDINATES[name] for name, _, _ in free])
    low, high = np.radians([[a for _, a, _ in free], [b for _, _, b in free]])
    start = np.clip(guess[columns], low + 1e-3, high - 1e-3)
    index = {f: FINGERS.index(f) for f in FINGERS}

    def residual(angles: Array) -> Array:
        x = guess.copy()
        x[columns] = angles
        tips = tips_of(x, geometry)
        miss = [
            (np.linalg.norm(tips[index[a]] - tips[index[b]]) - gap) / 1e-4
            for (a, b), gap in gaps.items()
        ]
        return np.concatenate([miss, (angles - start) * 0.3])

    found = least_squares(residual, start, bounds=(low, high), xtol=1e-12)
    x = guess.copy()
    x[columns] = found.x
    return x


def close_holds(
    x: Array,
    holds: Sequence[Hold],
    geometry: HandGeometry,
    rounds: int = 30,
    places: Array | None = None,
) -> Array:
    """Postures (n, 54) nearest to x, finger by finger joint, with every hold exact: Newton steps of least change, all n at once.

    `places` (m,): what every residual is to be in place of zero, as of a touch beside the points. The natural ranges are not looked at: begin well inside them.
    """
    wanted = 0.0 if places is None else places

    def residuals(x: Array) -> Array:
        return _hold_residuals(x, holds, geometry) - wanted

    columns = np.array([COORDINATES[name] for f in fingers_of(holds) for name, _, _ in freedoms(f)])
    x = x.copy()
    for _ in range(rounds):
        miss = residuals(x)
        if np.abs(miss).max() < 1e-9:
            return x
        J = np.stack(
            [(residuals(_nudge(x, c)) - miss) / NUDGE for c in columns],
            axis=-1,
        )
        step = (np.linalg.pinv(J, rcond=1e-6) @ miss[..., None])[..., 0]
        x[:, columns] -= step / np.maximum(
            1.0, np.abs(step).max(axis=1, keepdims=True) / LONGEST_STEP
        )
    miss = np.abs(residuals(x)).max()
    assert miss < 1e-6, (
        f"the hold cannot be closed from these postures: {miss * 1e3:.2f} mm are left"
    )
    return x


def contact_offset(x: Array, hold: Hold, geometry: HandGeometry) -> Array:
    """From contact point b to a (n, 3) in WCS at postures (n, 54)."""
    angles = x[:, 6:].reshape(len(x), -1, 3)
    points = [(finger, point, FINGERTIPS[finger]) for finger, point in (hold.a, hold.b)]
    a, b = contact_points_each(angles, geometry, points)
    return a - b


def fingers_of(holds: Sequence[Hold]) -> tuple[str, ...]:
    """The fingers that hold, thumb first."""
    return tuple(sorted({f for hold in holds for f in hold.fingers}, key=FINGERS.index))


def freedoms(finger: str) -> list[tuple[str, float, float]]:
    """The finger's coordinates with their natural ranges in degrees."""
    joints = [j for j in JOINTS if j.child in CHAINS[finger]]
    return [
        (f"{j.name}_{ANGLES[a]}", *NATURAL[j.name][k]) for j in joints for k, a in enumerate(j.dofs)
    ]


def _hold_residuals(x: Array, holds: Sequence[Hold], geometry: HandGeometry) -> Array:
    """What is wrong with each hold (n, m), m: its length, or all three components of a touch."""
    distances = [(hold, contact_offset(x, hold, geometry)) for hold in holds]
    return np.concatenate(
        [
            np.linalg.norm(d, axis=-1, keepdims=True) - h.distance if h.distance else d
            for h, d in distances
        ],
        axis=-1,
    )


def _nudge(x: Array, column: int) -> Array:
    moved = x.copy()
    moved[:, column] += NUDGE
    return moved
