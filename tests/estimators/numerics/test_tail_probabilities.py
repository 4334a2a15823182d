"""Survival functions against those of scipy.stats."""

import numpy as np
from scipy import stats

from handscope.estimators.numerics.tail_probabilities import chi2_sf, f_sf, normal_sf, student_sf

X = np.concatenate([np.linspace(-40.0, 40.0, 401), [np.inf, -np.inf]])
FREEDOMS = (1, 2, 3, 7, 30.5, 1000)


def test_the_probabilities_are_those_of_scipy_stats_to_the_last_bit() -> None:
    np.testing.assert_array_equal(normal_sf(X), stats.norm.sf(X))
    for n in FREEDOMS:
        np.testing.assert_array_equal(student_sf(X, n), stats.t.sf(X, n))
        np.testing.assert_array_equal(chi2_sf(X, n), stats.chi2.sf(X, n))
        np.testing.assert_array_equal(f_sf(X, 3, n), stats.f.sf(X, 3, n))


def test_what_is_not_known_has_no_probability() -> None:
    assert np.isnan([normal_sf(np.nan), chi2_sf(np.nan, 3), f_sf(np.nan, 3, 4)]).all()
