"""The same problem of fewer samples: every fourth to begin with, and of fast recordings every second and so on for good.

In      a Problem, Unknowns
Out     the problem and the unknowns of every k-th sample; a place of all samples from one of every k-th
Source  multi-resolution start of a least-squares problem, Triggs et al. 2000, Bundle adjustment - a modern synthesis, 7
Limits  biases and scale errors count as constant in the frame of a sensor meanwhile
"""

from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.problem import Problem, Unknowns

COARSE = 25.0  # Hz, of the samples to begin with
LEAST = 10.0  # s below which it is not worth it


def thinning(dt: float, rate: float) -> int:
    """Every which sample of period dt (s) is kept for a rate of no less than `rate` Hz."""
    return max(1, int(1 / (dt * rate) + 1e-3))


def thin_problem(problem: Problem, every: int) -> Problem:
    """Of every k-th sample; between them sensors turn by what their gyroscopes said meanwhile."""
    cells = (len(problem) - 1) // every

    def within(v: Array) -> Array:
        """Of turns (n-1, ...) as (cells, every, ...)."""
        return v[: cells * every].reshape(cells, every, *v.shape[1:])

    turned = within(problem.turns)
    q = quat.exp(turned[:, 0])
    for k in range(1, every):
        q = quat.multiply(q, quat.exp(turned[:, k]))
    kept = slice(0, cells * every + 1, every)
    return replace(
        problem,
        dt=every * problem.dt,
        turns=quat.log(q),
        later=within(problem.later).sum(axis=1),
        turn_sd=np.sqrt((within(problem.turn_sd) ** 2).sum(axis=1)),
        acc=problem.acc[kept],
        acc_sd=problem.acc_sd[kept],
        bent=problem.bent[kept],
        by_tilt=problem.by_tilt[kept],
    )


def average_accelerations(problem: Problem, every: int) -> Problem:
    """The problem with every specific force the mean over `every` samples about it, corrected to what was read in the middle: thinned afterwards, it has what all samples tell.

    The sensors turn by little meanwhile. As doubtful as the most doubtful of these samples.
    """
    if every == 1:
        return problem
    reach = every // 2
    weight = np.full(2 * reach + 1, 1.0 / every)
    weight[[0, -1]] *= 0.5 if every % 2 == 0 else 1.0
    acc, acc_sd = problem.acc.copy(), problem.acc_sd.copy()
    whole = sliding_window_view(problem.acc, len(weight), axis=0)
    acc[reach:-reach] = whole @ weight
    # a mean is off by half the window's second moment times the second derivative
    moment = float(weight @ np.arange(-reach, reach + 1) ** 2)
    curvature = acc[: -2 * reach] - 2 * acc[reach:-reach] + acc[2 * reach :]
    acc[reach:-reach] -= 0.5 * moment / reach**2 * curvature
    doubt = sliding_window_view(problem.acc_sd, len(weight), axis=0).max(axis=-1)
    acc_sd[reach:-reach] = np.sqrt((weight**2).sum()) * doubt
    return replace(problem, acc=acc, acc_sd=acc_sd)


def thin_unknowns(at: Unknowns, every: int) -> Unknowns:
    """Of every k-th sample."""
    return replace(at, q_GS=at.q_GS[: (len(at.q_GS) - 1) // every * every + 1 : every])


def refine(problem: Problem, coarse: Unknowns, every: int) -> Unknowns:
    """All samples of `problem`: between those of every k-th sensors turn as their gyroscopes said, what is left is shared out evenly."""
    felt = problem.turns
    phi = (
        felt
        + np.einsum("sij,tsj->tsi", coarse.scale_gyr, felt)
        - problem.dt * coarse.bias_gyr
        + coarse.delay * problem.later
    )
    turned, n, cells = quat.exp(phi), len(problem), len(coarse.q_GS) - 1
    q_GS = np.empty((n, *coarse.q_GS.shape[1:]))
    q_GS[: cells * every + 1 : every] = coarse.q_GS
    for k in range(1, every):
        q_GS[k : cells * every : every] = quat.multiply(
            q_GS[k - 1 : cells * every : every], turned[k - 1 : cells * every : every]
        )
    arrived = quat.multiply(
        q_GS[every - 1 : cells * every : every], turned[every - 1 : cells * every : every]
    )
    left = quat.log(quat.relative(arrived, coarse.q_GS[1:]))
    for k in range(1, every):
        own = q_GS[k : cells * every : every]
        q_GS[k : cells * every : every] = quat.multiply(own, quat.exp(left * (k / every)))
    for k in range(cells * every + 1, n):
        q_GS[k] = quat.multiply(q_GS[k - 1], turned[k - 1])
    return replace(coarse, q_GS=quat.normalize(q_GS))
