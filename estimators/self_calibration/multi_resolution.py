"""The same problem of every fourth sample: where to begin with all of them.

In      a Problem, Unknowns
Out     the problem and the unknowns of every fourth sample; a place of all samples from one of every fourth
Source  multi-resolution start of a least-squares problem, Triggs et al. 2000, Bundle adjustment - a modern synthesis, 7
Limits  biases and scale errors count as constant in the frame of a sensor for four samples: good enough to begin with
"""

from dataclasses import replace

import numpy as np

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.problem import Problem, Unknowns

EVERY = 4
LEAST = 1000  # samples below which it is not worth it


def thin_problem(problem: Problem) -> Problem:
    """Of every fourth sample; between them sensors turn by what their gyroscopes said meanwhile."""
    cells = (len(problem) - 1) // EVERY

    def within(v: Array) -> Array:
        """Of turns (n-1, ...) as (cells, EVERY, ...)."""
        return v[: cells * EVERY].reshape(cells, EVERY, *v.shape[1:])

    turned = within(problem.turns)
    q = quat.exp(turned[:, 0])
    for k in range(1, EVERY):
        q = quat.multiply(q, quat.exp(turned[:, k]))
    kept = slice(0, cells * EVERY + 1, EVERY)
    return replace(
        problem,
        dt=EVERY * problem.dt,
        turns=quat.log(q),
        later=within(problem.later).sum(axis=1),
        turn_sd=np.sqrt((within(problem.turn_sd) ** 2).sum(axis=1)),
        acc=problem.acc[kept],
        acc_sd=problem.acc_sd[kept],
        bent=problem.bent[kept],
        by_tilt=problem.by_tilt[kept],
    )


def thin_unknowns(at: Unknowns) -> Unknowns:
    """Of every fourth sample."""
    return replace(at, q_GS=at.q_GS[: (len(at.q_GS) - 1) // EVERY * EVERY + 1 : EVERY])


def refine(problem: Problem, coarse: Unknowns) -> Unknowns:
    """All samples of `problem`: between those of every fourth sensors turn as their gyroscopes said, what is left is shared out evenly."""
    felt = problem.turns
    phi = (
        felt
        + np.einsum("sij,tsj->tsi", coarse.scale_gyr, felt)
        - problem.dt * coarse.bias_gyr
        + coarse.delay * problem.later
    )
    turned, n, cells = quat.exp(phi), len(problem), len(coarse.q_GS) - 1
    q_GS = np.empty((n, *coarse.q_GS.shape[1:]))
    q_GS[: cells * EVERY + 1 : EVERY] = coarse.q_GS
    for k in range(1, EVERY):
        q_GS[k : cells * EVERY : EVERY] = quat.multiply(
            q_GS[k - 1 : cells * EVERY : EVERY], turned[k - 1 : cells * EVERY : EVERY]
        )
    arrived = quat.multiply(
        q_GS[EVERY - 1 : cells * EVERY : EVERY], turned[EVERY - 1 : cells * EVERY : EVERY]
    )
    left = quat.log(quat.relative(arrived, coarse.q_GS[1:]))
    for k in range(1, EVERY):
        own = q_GS[k : cells * EVERY : EVERY]
        q_GS[k : cells * EVERY : EVERY] = quat.multiply(own, quat.exp(left * (k / EVERY)))
    for k in range(cells * EVERY + 1, n):
        q_GS[k] = quat.multiply(q_GS[k - 1], turned[k - 1])
    return replace(coarse, q_GS=quat.normalize(q_GS))
