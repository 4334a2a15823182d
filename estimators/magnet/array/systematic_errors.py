"""Systematic errors of an array that are common to all readings of a recording, though each reading
alone absorbs them in its position.

In      readings with the magnet that fits each best (dipole_fit.py)
Out     SystematicErrors: offsets, gains and axes, positions of the magnetometers, timestamps,
        gradients of the field, length of the magnet, rotation of all axes, size of the moment, with
        covariance and likelihood ratio; the position errors that they cause
Source  linear mixed model: errors of a kind are normal with one variance, noise is white, variances
        by maximum likelihood (Harville 1977, JASA 72:320; EM: Dempster, Laird & Rubin 1977, J R
        Stat Soc B 39:1). The unknowns of each reading are projected out. A rod of length 2 a is a
        line of dipoles: to second order its field is B + a^2/6 (u.grad)^2 B, u along the moment; a
        disc's has the other sign (Jackson, Classical electrodynamics, 4.1)
Limits  linear around the fit; what shifts or rotates the whole array is not observable and stays in
        the covariance, and so does what the magnet's path did not separate
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from handscope.estimators.magnet.array.dipole_fit import (
    GRADIENT_TERMS,
    PER_MAGNET,
    DipoleFitProblem,
    compute_residuals,
    gradient_fields,
)
from handscope.estimators.magnet.model import dipole
from handscope.estimators.numerics.tail_probabilities import chi2_sf
from handscope.estimators.numerics.typing import Array, Indices


class Kind(NamedTuple):
    """Errors of one kind: number of each magnetometer or of all together, and initial standard
    deviation."""

    name: str
    per_magnetometer: int
    shared: int
    size: float


KINDS = (
    Kind("offset", 3, 0, 1e-7),  # T
    Kind("gain", 9, 0, 2e-3),  # share of an axis' field or of another's
    Kind("place", 3, 0, 3e-4),  # m
    Kind("late", 1, 0, 2e-3),  # s
    Kind("length", 0, 1, 2e-5),  # a^2 / 6, m^2
    Kind("slope", 0, GRADIENT_TERMS, 3e-6),  # T/m
    Kind("turn", 0, 3, 1e-2),  # rad, of all magnetometers' axes against the board
    Kind("moment", 0, 1, 1.0),  # standard deviations of the declared size
)
ROUNDS = 40
STEP = 1e-3  # m
MIN_NOISE_VARIANCE = 1e-2  # of the noise's variance: less is no noise but too many unknowns


@dataclass(frozen=True)
class SystematicErrors:
    """Errors (p,) over the sizes of KINDS, magnetometer by magnetometer within a kind."""

    errors: Array
    covariance: Array  # (p, p)
    sizes: Array  # (kinds,) estimated standard deviations, in units of KINDS
    noise: float  # residual variance over that of the declared noise
    p_value: float  # of noise alone, by the likelihood ratio
    dominant: Kind  # the kind that explains most


def estimate_systematic_errors(problem: DipoleFitProblem, x: Array) -> SystematicErrors:
    """From readings with unknowns x (n, 9)."""
    residual, A = compute_residuals(x, problem)
    Q, _ = np.linalg.qr(A)
    remaining, added = (
        v - Q @ (np.swapaxes(Q, 1, 2) @ v)
        for v in (residual[..., None], _error_jacobian(problem, x, residual.shape[1]))
    )
    kind, spare = error_kinds(len(problem.places)), len(x) * (residual.shape[1] - A.shape[2])
    F, r = added.reshape(-1, len(kind)), remaining.ravel()
    N, b, square = F.T @ F, F.T @ r, float(r @ r)
    variance, noise = np.ones(len(KINDS)), 1.0
    for _ in range(ROUNDS):
        covariance, _ = _compute_posterior(N, variance[kind], noise)
        errors = covariance @ b / noise
        each = errors**2 + np.diag(covariance)
        variance = np.array([each[kind == k].mean() for k in range(len(KINDS))])
        noise = max(
            MIN_NOISE_VARIANCE,
            float(square - 2 * errors @ b + errors @ N @ errors + (N * covariance).sum()) / spare,
        )
    covariance, volume = _compute_posterior(N, variance[kind], noise)
    errors = covariance @ b / noise
    likelihood_ratio = (
        spare * np.log(square / spare / noise)
        + spare
        - square / noise
        + float(b @ errors) / noise
        - volume
    )
    dominant = KINDS[int(np.argmax([errors[kind == k] @ b[kind == k] for k in range(len(KINDS))]))]
    sizes = np.sqrt(variance) * [k.size for k in KINDS]
    return SystematicErrors(
        errors, covariance, sizes, noise, float(chi2_sf(likelihood_ratio, len(KINDS))), dominant
    )


def propagate_systematic_errors(
    problem: DipoleFitProblem,
    x: Array,
    systematic: SystematicErrors,
    chips: Indices,
    many: int,
) -> tuple[Array, Array]:
    """Effect of the errors on the unknowns x (n, 9) of readings of these of `many` magnetometers,
    and the variances (n, 9) that remain after its correction."""
    residual, A = compute_residuals(x, problem)
    inverse = np.linalg.pinv(A)
    kind = error_kinds(many)
    chip = np.concatenate(
        [
            np.repeat(np.arange(many), k.per_magnetometer)
            if k.per_magnetometer
            else np.full(k.shared, -1)
            for k in KINDS
        ]
    )
    there = (chip < 0) | np.isin(chip, chips)
    assert len(chip) == len(kind)
    by_error = inverse @ _error_jacobian(problem, x, residual.shape[1])
    covariance = systematic.covariance[np.ix_(there, there)]
    variance = max(1.0, systematic.noise) * (inverse**2).sum(axis=2) + np.einsum(
        "nip,pq,niq->ni", by_error, covariance, by_error
    )
    scale = np.repeat([1.0, problem.noise], [PER_MAGNET, A.shape[2] - PER_MAGNET])
    return scale * (by_error @ systematic.errors[there]), scale**2 * variance


def error_kinds(many: int) -> Indices:
    """Kind of every error (p,) of so many magnetometers."""
    return np.repeat(np.arange(len(KINDS)), [k.per_magnetometer * many + k.shared for k in KINDS])


def _compute_posterior(N: Array, variance: Array, noise: float) -> tuple[Array, float]:
    """Posterior covariance (p, p) for prior variances (p,), and the logarithm of the reduction of
    its volume."""
    root = np.sqrt(variance)
    M = np.eye(len(root)) + root[:, None] * N * root / noise
    return root[:, None] * np.linalg.inv(M) * root, float(np.linalg.slogdet(M)[1])


def _error_jacobian(problem: DipoleFitProblem, x: Array, rows: int) -> Array:
    """Whitened residuals (n, rows, p) by each error in units of its kind's size."""
    n, many = problem.y.shape[:2]
    r, m, own = (
        x[:, None, :3] - problem.places,
        x[:, None, 3:PER_MAGNET],
        np.eye(many)[:, None, :, None],
    )
    offsets = np.broadcast_to(own * np.eye(3)[:, None, :], (n, many, 3, many, 3))
    # not as read: gains must not explain the noise
    field = x[:, None, PER_MAGNET:] + dipole.field(r, m)
    gains = np.einsum("lk,ij,nla->nlikja", np.eye(many), np.eye(3), field)
    places = own * -dipole.field_gradient(r, m)[:, :, :, None]
    slopes = np.broadcast_to(gradient_fields(problem.places), (n, many, 3, GRADIENT_TERMS))
    noise = (problem.noise * problem.noise_ratio)[:, :, None, None]
    delays = own * (
        np.zeros((n, many, 3, 1, 1)) if problem.rate is None else -problem.rate[..., None, None]
    )
    turn = np.cross(np.eye(3), field[:, :, None]).swapaxes(2, 3)
    length, nothing = _length_jacobian(x, problem), np.zeros((n, many, 3))
    each = zip(KINDS, (offsets, gains, places, delays, length, slopes, turn, nothing))
    by_kind = [kind.size * v.reshape(n, many, 3, -1) / noise for kind, v in each]
    added = problem.whiten(np.concatenate(by_kind, axis=-1).reshape(n, 3 * many, -1))
    added = np.pad(added, ((0, 0), (0, rows - added.shape[1]), (0, 0)))
    if problem.size is not None:
        added[:, -1, -1] = 1.0
    return added


def _length_jacobian(x: Array, problem: DipoleFitProblem) -> Array:
    """Field (n, magnetometers, 3) T per a^2 / 6 of 1 m^2."""
    r, m = x[:, None, :3] - problem.places, x[:, None, 3:PER_MAGNET]
    along = STEP * m / np.maximum(np.linalg.norm(m, axis=-1, keepdims=True), 1e-12)
    return np.asarray(
        (dipole.field(r + along, m) + dipole.field(r - along, m) - 2 * dipole.field(r, m)) / STEP**2
    )
