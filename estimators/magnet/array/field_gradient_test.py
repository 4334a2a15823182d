"""Whether the field around a magnet changes across the array: what one magnet in an even field leaves is noise, or has the shape of a field that varies linearly.

In      readings with the magnet that explains them best (magnet_fit.py); a field without curl and divergence has five slopes
Out     Uneven: probability that noise alone would look so much like slopes, and how large they are; by how much slopes misplace the magnet
Source  F test of nested models (Seber & Wild, Nonlinear regression, 1989, 5.3), linear around the fit, over many readings. Errors of calibrations and of places are
        the same in all of them, so that all together have no more degrees of freedom than one
Limits  with fewer than seven magnetometers too little is left over to tell; iron near the array bends the field more than linearly
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

from handscope.estimators.magnet.array.dipole_fit import (
    GRADIENT_TERMS,
    DipoleFitProblem,
    compute_residuals,
    gradient_fields,
)
from handscope.estimators.numerics.typing import Array

MIN_MAGNETOMETERS = 7  # magnetometers: seven axes above the unknowns of magnet, field and slopes
MAX_P_VALUE = 0.01  # below which errors that are everywhere the same hardly look so; slopes that are none only cost certainty


@dataclass(frozen=True)
class GradientTest:
    p_value: float
    gradient_sd: float  # T/m, standard deviation of each of the five slopes


def gradient_f_test(problem: DipoleFitProblem, x: Array) -> GradientTest:
    """Of readings with unknowns x (n, 9); the noise need not be known."""
    residual, A = compute_residuals(x, problem)
    spare = residual.shape[1] - A.shape[2] - GRADIENT_TERMS
    if len(problem.places) < MIN_MAGNETOMETERS:
        return GradientTest(1.0, 0.0)
    Q, _ = np.linalg.qr(A)
    U, s, _ = np.linalg.svd(
        _project_out(Q, _gradient_jacobian(problem, residual.shape[1])), full_matrices=False
    )
    remaining = _project_out(Q, residual[..., None])
    explained = float(((np.swapaxes(U, 1, 2) @ remaining) ** 2).sum())
    rest = (float((remaining**2).sum()) - explained) / (len(x) * spare)
    p_value = float(
        f_distribution.sf(
            explained / (len(x) * GRADIENT_TERMS) / max(rest, 1e-12), GRADIENT_TERMS, spare
        )
    )
    square = (explained - len(x) * GRADIENT_TERMS * rest) / max(float((s**2).sum()), 1e-12)
    return GradientTest(p_value, float(np.sqrt(max(square, 0.0))))


def position_shift(problem: DipoleFitProblem, x: Array, change: float) -> Array:
    """How far (n,) m a field that changes by `size` T/m in some direction draws the place, if it is not counted."""
    residual, A = compute_residuals(x, problem)
    shift = (np.linalg.pinv(A) @ _gradient_jacobian(problem, residual.shape[1]))[:, :3]
    return np.asarray(gradient_sd_of(change) * np.sqrt((shift**2).sum(axis=(1, 2))))


def gradient_sd_of(change: float) -> float:
    """Standard deviation of each of the five slopes of a field that changes by so many T/m (RMS over directions)."""
    return float(change * np.sqrt(3.0 / GRADIENT_TERMS))


def rms_change_of(slope: float) -> float:
    """The inverse."""
    return float(slope * np.sqrt(GRADIENT_TERMS / 3.0))


def _gradient_jacobian(problem: DipoleFitProblem, rows: int) -> Array:
    """What slopes of 1 T/m add to whitened residuals (n, rows, 5); nothing to the row of a moment that is told."""
    noise = problem.noise * problem.noise_ratio[..., None, None]
    added = problem.whiten(
        (gradient_fields(problem.places) / noise).reshape(len(problem.y), -1, GRADIENT_TERMS)
    )
    return np.pad(added, ((0, 0), (0, rows - added.shape[1]), (0, 0)))


def _project_out(Q: Array, values: Array) -> Array:
    """Without the part that the unknowns can take up."""
    return np.asarray(values - Q @ (np.swapaxes(Q, 1, 2) @ values))
