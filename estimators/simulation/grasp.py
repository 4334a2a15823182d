"""Postures in which fingertips touch or hold something: inverse kinematics by bounded least squares."""

from collections.abc import Mapping

import numpy as np
from scipy.optimize import least_squares

from estimators import forward_kinematics, joint_angles
from estimators.hand_anatomy import ANGLES, CHAINS, FINGERS, JOINTS
from estimators.hand_geometry import HandGeometry
from estimators.quaternions import Array
from estimators.simulation.motion import COORDINATES, posture

NATURAL = {"thumb_cmc": ((-10, 60), (-60, 10), (0, 110)), "thumb_mcp": ((0, 50),), "thumb_ip": ((-5, 60),)}
NATURAL |= {f"{f}_{j}": r for f in FINGERS[1:] for j, r in {"mcp": ((-10, 85), (-15, 15)), "pip": ((0, 100),), "dip": ((0, 65),)}.items()}


def tips_of(x: Array, geometry: HandGeometry) -> Array:
    """Bone ends (5, 3) in WCS of a posture (54,)."""
    return forward_kinematics.tips(joint_angles.compose(x[6:].reshape(-1, 3)), geometry)


def pinch(geometry: HandGeometry, finger: str = "index", distance: float | None = None, base: Array | None = None) -> Array:
    """A posture (54,) with the thumb's and the finger's bone ends `distance` apart (default: pads touching, both tissues)."""
    gap = distance if distance is not None else geometry.tip_tissue["thumb"] + geometry.tip_tissue[finger]
    return reach({("thumb", finger): gap}, geometry, ("thumb", finger), _pinch_guess(finger, base))


def reach(gaps: Mapping[tuple[str, str], float], geometry: HandGeometry, fingers: tuple[str, ...], guess: Array) -> Array:
    """The posture nearest to `guess` whose tips have the given mutual distances, within natural joint ranges; only `fingers` move."""
    free = [c for f in fingers for c in _freedoms(f)]
    columns = np.array([COORDINATES[name] for name, _, _ in free])
    low, high = np.radians([[a for _, a, _ in free], [b for _, _, b in free]])
    start = np.clip(guess[columns], low + 1e-3, high - 1e-3)
    index = {f: FINGERS.index(f) for f in FINGERS}

    def residual(angles: Array) -> Array:
        x = guess.copy()
        x[columns] = angles
        tips = tips_of(x, geometry)
        miss = [(np.linalg.norm(tips[index[a]] - tips[index[b]]) - gap) / 1e-4 for (a, b), gap in gaps.items()]
        return np.concatenate([miss, (angles - start) * 0.3])

    found = least_squares(residual, start, bounds=(low, high), xtol=1e-12)
    x = guess.copy()
    x[columns] = found.x
    return x


def _freedoms(finger: str) -> list[tuple[str, float, float]]:
    joints = [j for j in JOINTS if j.child in CHAINS[finger]]
    return [(f"{j.name}_{ANGLES[a]}", *NATURAL[j.name][k]) for j in joints for k, a in enumerate(j.dofs)]


def _pinch_guess(finger: str, base: Array | None) -> Array:
    across = FINGERS.index(finger) - 1
    bent = {f"{finger}_mcp_flexion": 50.0, f"{finger}_pip_flexion": 45.0, f"{finger}_dip_flexion": 25.0}
    thumb = {
        "thumb_cmc_flexion": 35.0 + 5 * across,
        "thumb_cmc_deviation": -20.0 + 5 * across,
        "thumb_cmc_pronation": 75.0,
        "thumb_mcp_flexion": 15.0 + 5 * across,
        "thumb_ip_flexion": 20.0,
    }
    return posture(base, **bent, **thumb)
