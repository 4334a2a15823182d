"""F test for a gradient of the field across the array: residuals of one magnet in a homogeneous
field are noise, or linear in position.

In      readings with the magnet that fits them best (dipole_fit.py); a field without curl and
        divergence has five gradients
Out     GradientTest: p value and size of the gradients; the position error that gradients cause
Source  F test of nested models (Seber & Wild, Nonlinear regression, 1989, 5.3), linear around the
        fit, over many readings. Errors of calibrations and positions are common to all, so that all
        together have the degrees of freedom of one
Limits  fewer than seven magnetometers leave too few degrees of freedom; iron close to the array
        bends the field more than linearly
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.magnet.array.dipole_fit import (
    GRADIENT_TERMS,
    DipoleFitProblem,
    compute_residuals,
    gradient_fields,
)
from handscope.estimators.numerics.tail_probabilities import f_sf
from handscope.estimators.numerics.typing import Array

MIN_MAGNETOMETERS = 7  # magnetometers: seven degrees of freedom beyond magnet, field and gradients
# common errors of calibration rarely look so; a needless gradient only costs accuracy
MAX_P_VALUE = 0.01


@dataclass(frozen=True)
class GradientTest:
    """p value of the test, and the gradient's standard deviation, T/m."""

    p_value: float
    gradient_sd: float  # T/m, standard deviation of each of the five


def gradient_f_test(problem: DipoleFitProblem, x: Array) -> GradientTest:
    """Test readings with unknowns x (n, 9); the noise need not be known."""
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
        f_sf(explained / (len(x) * GRADIENT_TERMS) / max(rest, 1e-12), GRADIENT_TERMS, spare)
    )
    square = (explained - len(x) * GRADIENT_TERMS * rest) / max(float((s**2).sum()), 1e-12)
    return GradientTest(p_value, float(np.sqrt(max(square, 0.0))))


def position_shift(problem: DipoleFitProblem, x: Array, change: float) -> Array:
    """Position error (n,) m of an ignored field gradient of `change` T/m in a random direction."""
    residual, A = compute_residuals(x, problem)
    shift = (np.linalg.pinv(A) @ _gradient_jacobian(problem, residual.shape[1]))[:, :3]
    return np.asarray(gradient_sd_of(change) * np.sqrt((shift**2).sum(axis=(1, 2))))


def gradient_sd_of(change: float) -> float:
    """Standard deviation of each of the five gradients of a field that changes by so many T/m (RMS
    over directions)."""
    return float(change * np.sqrt(3.0 / GRADIENT_TERMS))


def rms_change_of(slope: float) -> float:
    """The inverse."""
    return float(slope * np.sqrt(GRADIENT_TERMS / 3.0))


def _gradient_jacobian(problem: DipoleFitProblem, rows: int) -> Array:
    """Jacobian (n, rows, 5) of whitened residuals by gradients of 1 T/m; zero in the row of a
    declared moment."""
    noise = problem.noise * problem.noise_ratio[..., None, None]
    added = problem.whiten(
        (gradient_fields(problem.places) / noise).reshape(len(problem.y), -1, GRADIENT_TERMS)
    )
    return np.pad(added, ((0, 0), (0, rows - added.shape[1]), (0, 0)))


def _project_out(Q: Array, values: Array) -> Array:
    """Without the part that the unknowns explain."""
    return np.asarray(values - Q @ (np.swapaxes(Q, 1, 2) @ values))
