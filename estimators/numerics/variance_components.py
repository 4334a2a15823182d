"""Variance components by the sums of squares that they leave: how many times its nominal size each is.

In      nominal mean squares of every component in each group of samples; the mean squares that were seen
Out     factors of the components, with covariance of their logarithms
Source  ours: logarithms of mean squares, which err alike however large they are, fitted by Gauss-Newton with the weights of Cauchy's distribution, so that groups that have another cause
        count little; a lognormal prior for what the groups do not tell
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.numerics.typing import Array

STEPS, CLOSE = 20, 1e-3
LEAST = 1e-9  # smallest mean square


@dataclass(frozen=True)
class Prior:
    """Of the logarithm of a factor, and how the groups err about it."""

    log: float
    sd: float
    scatter: float  # of the logarithm of a group's mean square
    dependent: float  # groups that err together, and count as one


@dataclass(frozen=True)
class Components:
    """Factors of variance components."""

    log: Array  # (C,)
    covariance: Array  # (C, C)

    def expected(self, nominal: Array) -> Array:
        """Mean squares (K,) of groups with nominal ones (K, C)."""
        return np.asarray(nominal @ np.exp(self.log))

    def spread(self, nominal: Array) -> float:
        """Standard deviation of the logarithm of what is expected of one group (C,)."""
        share = nominal * np.exp(self.log)
        share = share / share.sum()
        return float(np.sqrt(share @ self.covariance @ share))


def fit_components(nominal: Array, seen: Array, prior: Prior) -> Components:
    """Components of groups (N, C) by their mean squares (N,); the prior where there are none."""
    count = nominal.shape[1]
    x, known = np.full(count, prior.log), np.eye(count) / prior.sd**2
    logs, normal = np.log(np.maximum(seen, LEAST)), known
    for _ in range(STEPS):
        parts = nominal * np.exp(x)
        total = parts.sum(axis=1)
        share, off = parts / total[:, None], logs - np.log(total)
        weight = 1.0 / (prior.dependent * (prior.scatter**2 + off**2))
        normal = (share * weight[:, None]).T @ share + known
        step = np.linalg.solve(normal, share.T @ (weight * off) - known @ (x - prior.log))
        x = x + np.clip(step, -1.0, 1.0)
        if np.abs(step).max() < CLOSE:
            break
    return Components(x, np.asarray(np.linalg.inv(normal), float))
