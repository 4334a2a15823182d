"""Posterior of a solution: covariance of the parameters, draws, and the estimated sizes of the errors.

In      a Problem and the place of its minimum
Out     covariance of the parameters, draws of all unknowns, sizes of the errors
Source  Gauss-Newton covariance; draws by a triangular solve (blocks of the band's inverse lose all digits here: its second differences are nearly
        singular); sizes of errors: iterated almost unbiased estimates of variance components, Forstner 1979, traces by draws, Hutchinson 1990
Limits  holds for the estimated sizes of errors; errors outside the model (a sensor that slipped) appear in the residuals only
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.self_calibration import normal_equations, residuals
from handscope.estimators.self_calibration.normal_equations import Factor
from handscope.estimators.self_calibration.problem import (
    Noise,
    Problem,
    Unknowns,
    apply_increment,
    parameter_columns,
)
from handscope.estimators.self_calibration.residuals import NUMEROV

CHUNK = 1024  # samples whose derivatives are in memory at once
# m/s^2, deg, deg, mm: of the best sensors on a printed finger
LEAST_ACC, LEAST_HINGE, LEAST_TURN, LEAST_SLIDE = 0.005, 0.1, 0.02, 0.01
LEAST_SCALE, LEAST_LAW = 1e-4, 0.02
ITERATIONS = 50  # of the estimate of a spread


@dataclass(frozen=True)
class Sizes:
    """RMS of residuals in their standard deviations, corrected for the degrees of freedom of the unknowns: 1 where errors are as large as assumed."""

    meeting: float
    hinging: float


def draw_places(
    problem: Problem, at: Unknowns, factor: Factor, count: int, samples: Indices
) -> Iterator[Unknowns]:
    """Draws of all unknowns from the posterior, orientations of these samples."""
    there = replace(at, q_GS=at.q_GS[samples])
    for k in range(count):
        step = _draw_step(factor, k)
        turns = step.turns[samples].reshape(len(samples), -1, 3)
        yield apply_increment(there, problem.chain, turns, step.parameters)


def residual_sizes(problem: Problem, at: Unknowns, factor: Factor) -> Sizes:
    """Residual sizes of accelerations at joints and of hinges, at the minimum."""
    step, ratios = _draw_step(factor, 0), []
    for kind, always_zero in (
        (residuals.joint_acceleration_terms, 0),
        (residuals.hinge_terms, len(problem.chain.hinges)),
    ):  # unit vectors differ in two directions
        squares, redundancy = 0.0, 0.0
        for start in range(0, len(problem), CHUNK):
            terms = kind(problem, at, start, start + CHUNK)
            squares += float((terms.r**2).sum())
            redundancy += (
                terms.r.size
                - always_zero * len(terms.r)
                - float((residual_change(terms, step) ** 2).sum())
            )
        ratios.append(float(np.sqrt(squares / redundancy)) if redundancy > 1 else 1.0)
    return Sizes(*ratios)


def _draw_step(factor: Factor, which: int) -> normal_equations.Step:
    n, e, P = factor.Y.shape
    numbers = normal_numbers(n * e + P, which)
    return normal_equations.draw_step(factor, numbers[: n * e].reshape(n, e), numbers[n * e :])


def normal_numbers(count: int, which: int, first: int = 0) -> Array:
    """Numbers (count,) from the `first` on as if drawn from the standard normal distribution, always the same: splitmix64 of their places, Steele et al. 2014."""
    with np.errstate(over="ignore"):
        z = (
            np.arange(first + 1, first + count + 1, dtype=np.uint64) + np.uint64(which << 40)
        ) * np.uint64(0x9E3779B97F4A7C15)
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
    return np.asarray(ndtri(((z >> np.uint64(11)).astype(float) + 0.5) / 2.0**53))


def residual_change(terms: residuals.Terms, step: normal_equations.Step) -> Array:
    """By how much a step changes residuals (T, m), to first order."""
    T = len(terms.r)
    change = terms.by_parameters @ step.parameters[terms.cols]
    e = step.turns.shape[1]
    for k in range(terms.knots):
        x = step.turns[terms.first + k : terms.first + k + T]
        change += np.einsum("tmi,ti->tm", terms.by_turns[:, :, k * e : (k + 1) * e], x)
    return np.asarray(change)


def estimate_noise(problem: Problem, at: Unknowns, factor: Factor) -> Noise:
    """Estimated sizes of the errors of accelerations, hinges, skin and scales."""
    noise, c, met = (
        problem.noise,
        parameter_columns(problem.chain),
        residual_sizes(problem, at, factor),
    )
    variance = np.diag(factor.covariance)
    quarter = np.pi / 2
    turn = _spread(at.skin_turn, variance[c.skin_turn], np.radians(noise.skin_turn) / quarter)
    slide = _spread(at.skin_slide, variance[c.skin_slide], 1e-3 * noise.skin_slide / quarter)
    scales = np.concatenate([at.scale_gyr.ravel(), at.scale_acc.ravel()])
    return replace(
        noise,
        acc=max(
            noise.acc * met.meeting / float(np.linalg.norm(NUMEROV)), LEAST_ACC
        ),  # a mean of three samples hides noise of high frequency only
        hinge=max(noise.hinge * met.hinging, LEAST_HINGE),
        skin_turn=max(float(np.degrees(turn * quarter)), LEAST_TURN),
        skin_slide=max(1e3 * slide * quarter, LEAST_SLIDE),
        skin_law=most_likely_spread(
            at.law, factor.covariance[c.law, c.law], noise.skin_law, LEAST_LAW
        ),
        scale=max(
            _spread(
                scales, np.concatenate([variance[c.scale_gyr], variance[c.scale_acc]]), noise.scale
            ),
            LEAST_SCALE,
        ),
    )


def _spread(values: Array, variance: Array, prior_sd: float) -> float:
    """Estimated standard deviation of unknowns with the prior N(0, prior_sd^2). Source: MacKay 1992, Bayesian interpolation, (4.9)."""
    count = (
        values.size - float(variance.sum()) / prior_sd**2
    )  # effective number of parameters that the readings determine
    return float(np.sqrt((values**2).sum() / count)) if count > 1 else prior_sd


def most_likely_spread(values: Array, covariance: Array, prior_sd: float, least: float) -> float:
    """The same for a few unknowns (m,), iterated to convergence; `covariance` (m, m) is that of their posterior, from which the prior is taken off."""
    information = np.linalg.inv(covariance) - np.eye(len(values)) / prior_sd**2
    pull, spread = (information + np.eye(len(values)) / prior_sd**2) @ values, prior_sd
    for _ in range(ITERATIONS):
        sure = np.linalg.inv(information + np.eye(len(values)) / spread**2)
        spread = max(_spread(sure @ pull, np.diag(sure), spread), least)
    return spread


def turn_deviations(problem: Problem, at: Unknowns) -> Array:
    """How far each sensor turned otherwise than its gyroscope says (n-1, S), in the gyroscope's standard deviations."""
    deviations = np.empty(problem.turn_sd.shape)
    for start in range(0, len(deviations), CHUNK):
        r = residuals.gyroscope_residuals(problem, at, start, start + CHUNK)
        deviations[start : start + len(r)] = np.linalg.norm(
            r.reshape(len(r), -1, 3), axis=2
        ) / np.sqrt(3)
    return deviations


def acceleration_deviations(problem: Problem, at: Unknowns) -> Array:
    """How far each sensor's acceleration is off (n, S) for what its neighbours say, in standard deviations of that; 0 at both ends."""
    n, a = len(problem), problem.chain.incidence
    z = np.zeros((n, a.shape[1]))
    for start in range(1, n - 1, CHUNK):
        stop = min(start + CHUNK, n - 1)
        white = residuals.joint_acceleration_residuals(problem, at, start, stop).reshape(
            stop - start, a.shape[0], 3
        )
        # what a sensor's error does to the whitened rows
        seen = residuals.whitening_matrix(problem, start, stop) @ a
        deviation = np.einsum("tjs,tjx->tsx", seen, white)
        z[start:stop] = np.linalg.norm(deviation, axis=2) / np.sqrt(
            3 * (seen**2).sum(axis=1) + 1e-300
        )
    return z
