"""Covariance of the parameters, corrected for noise that looks like information and for the random walk of biases.

In      a Problem, the place of its minimum, the factor of its normal equations
Out     the same factor with a covariance (P, P) that accounts for both
Source  errors in variables: an arm is multiplied by an angular acceleration, which is noisy itself; Fuller 1987, Measurement error models, 1.2, 2.2. A walk's mean
        against its beginning: its variance grows by q^2 T / 3, integral of a Wiener process
Limits  the gyroscopes' noise is the declared one within NOISE_KNOWN; the random walk is that of the option and is not estimated
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import normal_equations, residuals
from handscope.estimators.self_calibration.normal_equations import Factor
from handscope.estimators.self_calibration.problem import Problem, Unknowns, parameter_columns
from handscope.estimators.self_calibration.residuals import SECOND_DIFFERENCE, Terms
from handscope.estimators.self_calibration.uncertainty import posterior, sandwich_covariance

CHUNK = 1024  # samples whose derivatives are in memory at once
DRAWS = 2  # of the trajectory: it has thousands of samples
NOISE_KNOWN = 0.25  # share of the gyroscopes' variance by which it may differ from the declared one: their noise is known within an eighth
DOUBTED = 3.0  # times the spurious information is subtracted: it may be that much larger, and is random itself


def correct_covariance(problem: Problem, at: Unknowns, factor: Factor, spurious: Array) -> Factor:
    """The factor with the covariance that the movement itself supports; `spurious` (P, P) of `spurious_information`."""
    slopes = residuals.prior_residuals(problem, at)[1]
    covariance = without_noise(
        factor.covariance, spurious, slopes.T @ slopes, arm_directions(problem, at)
    ) + np.diag(bias_walk_variance(problem))
    return replace(
        factor,
        covariance=sandwich_covariance.widen_covariance(
            covariance, sandwich_covariance.limb_pulls(problem, at, factor), factor.covariance
        ),
    )


def spurious_information(
    problem: Problem,
    at: Unknowns,
    factor: Factor,
    draws: int = DRAWS,
    known: Sequence[Terms] | None = None,
) -> Array:
    """Information (P, P) on the arms that comes from noise of the orientations alone: what it would be if nothing turned; `known` are `joint_acceleration_terms` of all samples."""
    n, e, P = factor.Y.shape
    count = parameter_columns(problem.chain).near.stop
    information = np.zeros((P, P))
    for k in range(draws):
        turns = normal_equations.draw_trajectory(
            factor, posterior.normal_numbers(n * e, k).reshape(n, e)
        ).reshape(n, -1, 3)
        B, C = np.zeros((n, e, count)), np.zeros((count, count))
        for terms in known or (
            residuals.joint_acceleration_terms(problem, at, start, start + CHUNK)
            for start in range(0, n, CHUNK)
        ):
            noise = _noise_terms(problem, at, turns, terms)
            normal = normal_equations.empty(len(noise.r) + normal_equations.SPAN - 1, e, count)
            normal_equations.add_terms(normal, replace(noise, first=0))
            B[noise.first : noise.first + len(normal.B)] += normal.B
            C += normal.C
        flat = normal_equations.whiten(factor, B).reshape(-1, count)
        information[:count, :count] += (C - flat.T @ flat) / draws
    return information


def _noise_terms(problem: Problem, at: Unknowns, turns: Array, terms: Terms) -> Terms:
    """`joint_acceleration_terms` with only that part of the derivatives by the arms which the orientations' noise makes up."""
    chain = problem.chain
    first, stop, J = terms.first + 1, terms.first + 1 + len(terms.r), len(chain.joints)
    three = np.arange(first, stop)[:, None] + np.arange(-1, 2)
    R = quat.matrix(at.q_GS[first - 1 : stop + 1]) @ quat.skew(turns[first - 1 : stop + 1])
    swung = np.einsum("k,tksij->tsij", SECOND_DIFFERENCE / problem.dt**2, R[three - (first - 1)])
    by = np.zeros((len(terms.r), J, 3, 6 * J))
    for k in range(J):
        by[:, k, :, 3 * k : 3 * k + 3] = -swung[:, chain.parents[k]]
        by[:, k, :, 3 * J + 3 * k : 3 * J + 3 * k + 3] = swung[:, chain.children[k]]
    white = residuals.whitening_matrix(problem, first, stop) @ by.reshape(len(by), J, -1)
    return replace(
        terms,
        by_parameters=white.reshape(len(by), 3 * J, -1) / residuals.common_scale(at),
        cols=np.arange(6 * J),
    )


def arm_directions(problem: Problem, at: Unknowns) -> Array:
    """Directions (2 J, P) m of each arm alone; the other parameters are 0 in them."""
    directions = np.zeros((2 * len(at.far), parameter_columns(problem.chain).count))
    for k, arm in enumerate((*at.far, *at.near)):
        directions[k, 3 * k : 3 * k + 3] = arm
    return directions


def without_noise(covariance: Array, spurious: Array, before: Array, arms: Array) -> Array:
    """Covariance (P, P) without the spurious part of its information, plus the bias that noise causes along `arm_directions` (m, P).

    `before` (P, P) is the prior information, which always remains.
    """
    root = np.linalg.cholesky(before)
    off = np.linalg.solve(
        root,
        np.linalg.solve(root, normal_equations.invert(covariance) - before - DOUBTED * spurious).T,
    )
    eigenvalues, directions = np.linalg.eigh(0.5 * (off + off.T))
    spread = np.linalg.solve(root.T, directions / np.sqrt(1 + np.maximum(eigenvalues, 0.0)))
    pulled = NOISE_KNOWN * arms @ spurious @ covariance
    # what was known before holds against noise, too
    pulled /= np.maximum(1.0, np.linalg.norm(pulled @ root, axis=1, keepdims=True))
    return np.asarray(spread @ spread.T + pulled.T @ pulled)


def bias_walk_variance(problem: Problem) -> Array:
    """Variances (P,) that gyroscope biases at the beginning have besides: their mean over the recording was estimated, and they walk."""
    variances = np.zeros(parameter_columns(problem.chain).count)
    variances[parameter_columns(problem.chain).bias_gyr] = (
        np.radians(problem.noise.gyr_bias_walk) ** 2 * problem.dt * len(problem) / 3
    )
    return variances
