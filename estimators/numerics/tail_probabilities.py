"""How probable a statistic is at least as large, for the distributions that tests use.

In      values (...,), and degrees of freedom
Out     survival functions P(X > x), (...,)
Source  scipy.special, which `scipy.stats` calls for the same; that package takes longer to import
        than all else that processing a recording needs
Limits  negative values of chi-squared and F, which rounding makes, count as zero
"""

from typing import Any

import numpy as np

from handscope.estimators.numerics.optional_imports import not_by_star
from handscope.estimators.numerics.typing import Array

# 0.05 s of every start: scipy copies all names of numpy, and so would import what translates Fortran, tests and masks
with not_by_star(np, "char", "core", "ctypeslib", "f2py", "ma", "rec", "strings", "testing"):
    from scipy.special import chdtrc, fdtrc, ndtr, stdtr


def normal_sf(x: Any) -> Array:
    """Of the standard normal distribution."""
    return np.asarray(ndtr(-np.asarray(x)))


def student_sf(x: Any, freedom: Any) -> Array:
    """Of Student's t distribution."""
    return np.asarray(stdtr(freedom, -np.asarray(x)))


def chi2_sf(x: Any, freedom: Any) -> Array:
    """Of the chi-squared distribution."""
    return np.asarray(chdtrc(freedom, np.maximum(x, 0.0)))


def f_sf(x: Any, above: Any, below: Any) -> Array:
    """Of the F distribution with the degrees of freedom above and below the line."""
    return np.asarray(fdtrc(above, below, np.maximum(x, 0.0)))
