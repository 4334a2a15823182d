"""How far the fingertips of two recordings are apart: the error of Salchow-Hoemmen 2019.

In      places of the tips of both at the same instants, m, NaN where not known; a stretch in which only the wrist moves, or none
Out     for each finger E(t) = |p_A - p_B| as mean, SD, RMS, largest, and its RMS along each axis
Source  Salchow-Hoemmen 2019, 3.1.2 and 3.1.3: centre of the wrist (28), places in the wrist's frame (29), error (30), RMSE (31)
Limits  the paper turns the frames by markers on a fixture and the neutral pose; ours turns them so that the tips fit best (Wahba 1965), and without a
        stretch of the wrist also shifts them so: a constant error of the same size at all tips is taken away then
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import least_squares, minimize

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

Frame = Literal["wrist", "wrist found by its movement", "best fit"]
SURE = 0.005  # m, standard deviation of a centre that can be used; ours: a fifth of what the paper's best method is off
NOISE = 0.0005  # m, least noise of a tip about its sphere; ours: skin and optics
LEAST = 20  # places of one tip that a sphere is laid through


@dataclass(frozen=True)
class TipError:
    """Of one finger, m."""

    finger: str
    samples: int
    mean: float
    sd: float
    rmse: float
    largest: float
    parts: Array  # (3,) RMS along the axes of A's frame


def tip_errors(a: Array, b: Array) -> list[TipError]:
    """Of places (n, fingers, 3) in one frame."""
    found = []
    for k, finger in enumerate(FINGERS):
        difference = b[:, k] - a[:, k]
        difference = difference[np.isfinite(difference).all(axis=1)]
        if len(difference) >= 2:
            error = np.linalg.norm(difference, axis=1)  # (30)
            # (31)
            rmse, parts = float(np.sqrt((error**2).mean())), np.sqrt((difference**2).mean(axis=0))
            found.append(
                TipError(
                    finger,
                    len(difference),
                    float(error.mean()),
                    float(error.std(ddof=1)),
                    rmse,
                    float(error.max()),
                    parts,
                )
            )
    return found


def transform_places(b: Array, a: Array, centre: Array | None = None) -> Array:
    """Places b (n, fingers, 3) in a's frame, about b's wrist `centre` (3,) if known (29), else shifted to fit as well."""
    known = np.isfinite(a).all(axis=-1) & np.isfinite(b).all(axis=-1)
    if known.sum() < 3:
        return np.full_like(b, np.nan)
    from_b, to_a = (
        (b[known].mean(axis=0), a[known].mean(axis=0)) if centre is None else (centre, np.zeros(3))
    )
    U, _, Vt = np.linalg.svd((a[known] - to_a).T @ (b[known] - from_b))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return np.asarray(to_a + quat.rotate(quat.from_matrix(R), b - from_b))


def centre_of_rotation(places: Array) -> Array:
    """The wrist (3,) about which a stiff hand's tips (n, fingers, 3) turn, by the tip seen most. Source: Salchow-Hoemmen 2019, (28)."""
    k = int(np.isfinite(places).all(axis=-1).sum(axis=0).argmax())
    p = places[:, k][np.isfinite(places[:, k]).all(axis=-1)]
    if len(p) < LEAST:
        raise InputError("measure.no_fingertip")
    A = np.column_stack([2 * p, np.ones(len(p))])
    start = np.linalg.lstsq(A, (p**2).sum(axis=1), rcond=None)[0][:3]

    def off(c: Array) -> Array:
        return _from_mean(p, c)

    smooth = least_squares(off, start)  # near (28), with a standard deviation
    noise = max(float(np.sqrt((smooth.fun**2).mean())), NOISE)
    J: Array = np.array(smooth.jac)
    sd = noise * np.sqrt(np.diag(np.linalg.pinv(J.T @ J, rcond=1e-12)).max())
    flat = np.linalg.matrix_rank(J, tol=1e-6) < 3
    if flat or sd > SURE:
        raise InputError("measure.wrist_centre_not_observable", fingers=FINGERS[k])

    def deviations(c: Array) -> float:
        return float(np.abs(_from_mean(p, c)).sum())  # (28)

    found = minimize(
        deviations, np.asarray(smooth.x, dtype=float), method="Nelder-Mead", options={"xatol": 1e-6}
    )
    return np.asarray(found.x)


def _from_mean(places: Array, centre: Array) -> Array:
    distance = np.linalg.norm(places - centre, axis=1)
    return np.asarray(distance - distance.mean())
