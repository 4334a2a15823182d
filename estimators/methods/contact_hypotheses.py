"""Which of the contacts that were announced happened: every likely answer is kept with the estimate under it, and all are compared once the last contact is known.

In      for each contact its constraint and derivative around each estimate so far
Out     the estimate under the likeliest answer, its covariance with how far the other answers' estimates lie from it, and that answer
Source  Gaussian sums: Alspach & Sorenson 1972; the share of contacts that do not happen is unknown, Beta-Bernoulli
Limits  places that are AWAY apart or less are taken for touching where nothing better is known
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.contact_constraint import Constraint
from handscope.estimators.data.held_contact import LEAST_ON_TABLE
from handscope.estimators.numerics.typing import Array

AWAY = 0.02  # m, standard deviation of each axis by which a place is away that does not touch; ours
# prior of the share of contacts that do not happen, as if so many had been seen: one in five, little known; ours
MISSED_BEFORE, HELD_BEFORE = 0.5, 2.0
ONE_LIFTED = 0.1  # share of contacts with a table in which one finger does not lie on it; ours
LEAST = 1e-3  # probability against the likeliest answer with which another is kept
MOST = 64  # answers that are kept


@dataclass(frozen=True)
class Answer:
    """What is assumed of a contact."""

    away: tuple[int, ...]  # its places that did not touch
    happened: bool
    missed: float  # m, how far the farthest place was from it before


@dataclass(frozen=True)
class Assumption:
    """An answer for one contact."""

    answer: Answer
    S: Array  # (m, m) covariance of the innovation under it
    log_probability: float  # up to what all have in common


@dataclass(frozen=True)
class Hypothesis:
    """What is assumed of the contacts so far, and the estimate under it."""

    answers: tuple[Answer, ...]
    log_probability: float  # up to what all have in common
    errors: Array  # (n,)
    P: Array  # (n, n)


def first_hypothesis(errors: Array, P: Array) -> list[Hypothesis]:
    """Before any contact."""
    return [Hypothesis((), 0.0, errors, P)]


def extend(
    hypotheses: Sequence[Hypothesis],
    measure: Callable[[Hypothesis], tuple[Constraint, Array]],
) -> list[Hypothesis]:
    """The likely hypotheses with one contact more."""
    found = [new for one in hypotheses for new in _extended(one, *measure(one))]
    found.sort(key=lambda h: -h.log_probability)
    least = found[0].log_probability + np.log(LEAST)
    return [h for h in found[:MOST] if h.log_probability > least]


def decide(hypotheses: Sequence[Hypothesis]) -> Hypothesis:
    """The likeliest, with the second moment of all about its estimate for its covariance."""
    best = max(hypotheses, key=lambda h: h.log_probability)
    shares = np.exp([h.log_probability - best.log_probability for h in hypotheses])
    off = np.array([h.errors - best.errors for h in hypotheses])
    P = sum(
        share * (h.P + np.outer(d, d))
        for share, h, d in zip(shares / shares.sum(), hypotheses, off)
    )
    return replace(best, P=np.asarray(P))


def weigh(constraint: Constraint, touching: Array, missed: int, looked_at: int) -> list[Assumption]:
    """What may be assumed of a contact of which the innovation has the covariance `touching` if all its places touch, after so many contacts of which so many were missed."""
    # a place that is away adds its scatter to the rows that it takes part in
    lifts = AWAY**2 * np.einsum("kma,kna->kmn", constraint.by_places, constraint.by_places)
    found = []
    for away, probability in _away(len(lifts), missed, looked_at):
        S = touching + lifts[list(away)].sum(axis=0)
        root = np.linalg.cholesky(S)
        whitened = np.linalg.solve(root, constraint.residual)
        likelihood = -0.5 * whitened @ whitened - np.log(np.diag(root)).sum()
        log_probability = float(np.log(probability) + likelihood)
        answer = Answer(away, len(away) < len(lifts), constraint.missed)
        found.append(Assumption(answer, S, log_probability))
    return found


def _away(count: int, missed: int, looked_at: int) -> Iterator[tuple[tuple[int, ...], float]]:
    """Which of so many places may be away, and how probable that is."""
    missing = (MISSED_BEFORE + missed) / (MISSED_BEFORE + HELD_BEFORE + looked_at)
    lifted = ONE_LIFTED if count > LEAST_ON_TABLE else 0.0
    yield (), (1 - missing) * (1 - lifted)
    if lifted:
        yield from (((k,), (1 - missing) * lifted / count) for k in range(count))
    yield tuple(range(count)), missing


def _extended(before: Hypothesis, constraint: Constraint, H: Array) -> Iterator[Hypothesis]:
    P, missed = before.P, sum(not a.happened for a in before.answers)
    touching = constraint.noise + H @ P @ H.T
    for assumed in weigh(constraint, touching, missed, len(before.answers)):
        new = replace(
            before,
            answers=(*before.answers, assumed.answer),
            log_probability=before.log_probability + assumed.log_probability,
        )
        if assumed.answer.happened:
            gain = np.linalg.solve(assumed.S, H @ P).T
            errors = before.errors - gain @ constraint.residual
            new = replace(new, errors=errors, P=P - gain @ H @ P)
        yield new
