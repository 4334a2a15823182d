"""Variance components: found where groups tell them, left at the prior with its spread where not."""

import numpy as np

from handscope.estimators.numerics.typing import Array
from handscope.estimators.numerics.variance_components import Prior, fit_components

PRIOR = Prior(float(np.log(0.2)), 1.5, 0.5, 1.0)
TRUE = np.array([0.05, 2.0])


def _groups(count: int = 400) -> tuple[Array, Array]:
    """Nominal sizes of two components that differ from group to group, and mean squares that scatter about theirs."""
    rng = np.random.default_rng(4)
    nominal = rng.lognormal(0.0, 1.0, (count, 2))
    return nominal, nominal @ TRUE * rng.lognormal(0.0, 0.5, count)


def test_factors_are_found_within_what_their_covariance_says() -> None:
    found = fit_components(*_groups(), PRIOR)
    sd = np.sqrt(np.diag(found.covariance))
    assert np.all(np.abs(found.log - np.log(TRUE)) < 3 * sd)
    assert np.all(sd < 0.5)


def test_groups_of_another_cause_hardly_count() -> None:
    nominal, seen = _groups()
    spoilt = np.where(np.arange(len(seen)) % 8 == 0, 1e3 * seen, seen)
    off = fit_components(nominal, spoilt, PRIOR).log - fit_components(nominal, seen, PRIOR).log
    assert np.all(np.abs(off) < 0.3)


def test_a_component_that_no_group_has_keeps_its_prior() -> None:
    nominal, seen = _groups()
    nominal[:, 1] = 0.0
    found = fit_components(nominal, seen, PRIOR)
    assert np.isclose(found.log[1], PRIOR.log)
    assert np.isclose(found.spread(np.array([0.0, 1.0])), PRIOR.sd)
    assert found.spread(np.array([1.0, 0.0])) < 0.1


def test_without_groups_everything_is_the_prior() -> None:
    found = fit_components(np.empty((0, 2)), np.empty(0), PRIOR)
    assert np.allclose(found.expected(np.ones((1, 2))), 2 * np.exp(PRIOR.log))
