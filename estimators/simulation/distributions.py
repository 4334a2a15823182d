"""How errors of a given standard deviation are distributed.

In      a random generator, the name of a distribution, a shape
Out     numbers of mean 0 and standard deviation 1
"""

import numpy as np

from handscope.estimators.numerics.typing import Array

DISTRIBUTIONS = ("normal", "uniform", "heavy-tailed")
FREEDOMS = 3.0  # of Student's t: the fewest whole number that has a variance


def draw(rng: np.random.Generator, distribution: str, size: tuple[int, ...]) -> Array:
    """Numbers of that shape; `heavy-tailed` is Student's t with three degrees of freedom."""
    if distribution == "uniform":
        return np.asarray(np.sqrt(3.0) * rng.uniform(-1, 1, size))
    if distribution == "heavy-tailed":
        return np.asarray(rng.standard_t(FREEDOMS, size) / np.sqrt(FREEDOMS / (FREEDOMS - 2)))
    return np.asarray(rng.normal(size=size))
