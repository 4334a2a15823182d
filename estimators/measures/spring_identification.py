"""Stiffness and damping of what is squeezed, from forces and the distance of the fingertips.

In      times t (n,) s, forces x (n,) N, distances p (n,) m of one grasp
Out     theta (stiffness N/m, force at no distance N, damping N s/m), its fit and how it changes
Source  Kortier, thesis (6.6), (6.8)
"""

import numpy as np

from handscope.estimators.force import (
    frequency_response,
    identification,
)
from handscope.estimators.force.frequency_response import Conditions, Response
from handscope.estimators.force.grasp_phases import UNSURE, GraspPhase
from handscope.estimators.force.identification import Fit, RunningEstimate
from handscope.estimators.measures.squeeze_options import Params
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

NOISE = 0.1  # N
# sizes of stiffness N/m, force at no distance N, and damping N s/m
USUAL = np.array([1e3, 50.0, 10.0])


def identify_spring(
    params: Params,
    h: GraspPhase,
    inside: np.ndarray,
    answer: Response,
    t: Array,
    x: Array,
    p: Array,
) -> tuple[Fit | None, Conditions | None, list[str]]:
    """Stiffness and damping (6.6) where the data allow them, the conditions, and reasons for doubt."""
    reasons = [r for r in [h.flagged(inside)] if r]
    doubtful = bool(np.bitwise_or.reduce(h.flags[inside], axis=None) & UNSURE)
    if np.ptp(p) < params.least_depth:
        return None, None, [*reasons, phrase("squeeze.rigid")]
    checked = frequency_response.check_conditions(answer)
    fit = identification.fit_least_squares(x[:, None], _spring_rows(t, p), np.full(len(t), NOISE))
    explained = 1 - float((fit.residuals**2).sum() / ((x - x.mean()) ** 2).sum())
    if explained < 0.7 or fit.theta[0] <= 0:
        return (
            None,
            checked,
            [
                *reasons,
                *checked.reasons,
                phrase("squeeze.not_a_spring"),
            ],
        )
    return (None if doubtful else fit), checked, [*reasons, *checked.reasons]


def _spring_rows(t: Array, p: Array) -> Array:
    """H (n, 1, 3) of stiffness, force at no distance, and damping. (6.6)"""
    return np.stack([-p, np.ones(len(p)), -np.gradient(p, t)], axis=-1)[:, None]


def stiffness_change(t: Array, x: Array, p: Array) -> float:
    """By what share of itself the stiffness changes over the range of the distance p (n,): that of a parabola in place of the straight line."""
    if np.ptp(p) <= 0:
        return 0.0
    u = (p - p.mean()) / np.ptp(p)
    parabola = np.concatenate([_spring_rows(t, u), (u**2)[:, None, None]], axis=2)
    theta = identification.fit_least_squares(x[:, None], parabola, np.full(len(t), NOISE)).theta
    return float(abs(2 * theta[3]) / max(abs(theta[0]), 1e-9))


def running_stiffness(
    params: Params, t: Array, x: Array, p: Array, unobserved: float = 0.0, bends: float = 0.0
) -> RunningEstimate:
    """The stiffness as it stood after each sample of force x (n,) N and distance p (n,) m on an even grid."""
    fit = identification.fit_least_squares(x[:, None], _spring_rows(t, p), np.full(len(t), NOISE))
    each = NOISE * float(np.sqrt(len(t) / fit.independent))
    common_share = correlated_share(params, unobserved, bends)
    return identification.track_first_parameter(
        t,
        x[:, None],
        _spring_rows(t, p),
        each,
        USUAL,
        params.memory,
        lambda K: common_share * np.abs(K),
    )


def correlated_share(params: Params, unobserved: float, bends: float) -> float:
    """By what share force over distance may be wrong in all samples alike.

    The push is the mean of both sides, one of which lacks what is untold; a stiffness that changes is any of those within its range.
    """
    bends = bends if bends > params.bent else 0.0
    return float(
        np.sqrt(params.gain_sd**2 + params.scale_sd**2 + (unobserved / 2) ** 2 + bends**2 / 12)
    )
