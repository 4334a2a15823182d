"""Missing samples filled in by cubics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.numerics.gap_interpolation import FREQUENCY, bridge_gaps, missed_variance

NOTHING = np.empty((0, 3))


def _known(n: int, first: int, length: int) -> np.ndarray:
    known = np.ones(n, bool)
    known[first : first + length] = False
    return known


@given(st.lists(st.floats(-5, 5), min_size=4, max_size=4), st.integers(2, 20), st.integers(1, 15))
def test_a_parabola_s_neighbours_and_a_straight_line_are_kept_exactly(
    line: list[float], first: int, length: int
) -> None:
    t = np.arange(40) / 100
    values = np.stack([line[0] + line[1] * t, line[2] + line[3] * t], axis=-1)
    known = _known(40, first, length)
    np.testing.assert_allclose(
        bridge_gaps(t, np.where(known[:, None], values, np.nan), known), values, atol=1e-12
    )


def test_a_movement_of_two_hertz_is_followed_through_a_tenth_of_a_second() -> None:
    t = np.arange(100) / 100
    values = np.sin(2 * np.pi * 2 * t)[:, None]
    known = _known(100, 40, 10)
    filled = bridge_gaps(t, np.where(known[:, None], values, np.nan), known)
    straight = np.interp(t, t[known], values[known, 0])
    assert np.abs(filled - values).max() < 0.2 * np.abs(straight - values[:, 0]).max()


def test_what_lies_before_the_first_or_behind_the_last_sample_stays_unknown() -> None:
    t = np.arange(10) / 100
    known = np.array([0, 0, 1, 1, 0, 1, 1, 1, 0, 0], bool)
    filled = bridge_gaps(t, np.where(known, 1.0, np.nan)[:, None], known)
    np.testing.assert_array_equal(np.isnan(filled[:, 0]), [True, True, *[False] * 6, True, True])


@pytest.mark.parametrize("where", [1, 8])
def test_without_a_second_sample_at_one_side_the_gap_s_own_slope_serves(where: int) -> None:
    t = np.arange(10) / 100
    values, known = (t**2)[:, None], _known(10, where, 1)
    np.testing.assert_allclose(
        bridge_gaps(t, np.where(known[:, None], values, np.nan), known), values, atol=1e-4
    )


def test_the_doubt_of_a_gap_covers_what_a_movement_of_that_frequency_hides() -> None:
    t = np.arange(400) / 400
    rate = 5.0 * np.sin(2 * np.pi * FREQUENCY * t)
    for first in range(20, 320, 7):
        known = _known(400, first, 40)
        filled = bridge_gaps(t, np.where(known, rate, np.nan)[:, None], known)[:, 0]
        lost = abs(np.sum(filled - rate) / 400)
        gyr = np.where(known, 5.0, np.nan)[:, None] * np.array([1.0, 0, 0])
        variance = missed_variance(t, gyr, known, NOTHING)
        assert lost <= np.sqrt(variance.max())
        assert np.flatnonzero(variance).tolist() == [first]


def _struck(n: int, rng: np.random.Generator) -> np.ndarray:
    """Rates (n, 3) of a finger that strikes by 25 deg within 0.1 s and goes back, now and then, at 80 Hz."""
    rates = np.zeros(n)
    bell = np.sin(np.pi * np.arange(1, 8) / 8) ** 2
    for at in np.cumsum(rng.integers(25, 60, n // 30)):
        if at + 14 < n:
            rates[at : at + 14] += 7.6 * np.concatenate([bell, -bell])
    return rates[:, None] * np.array([0.0, 0.6, 0.8])


@pytest.mark.parametrize("length", [1, 2, 4])
def test_what_was_missed_before_is_the_doubt_of_a_gap_between_strikes(length: int) -> None:
    rng, errors, variances = np.random.default_rng(3), [], []
    for first in range(500, 780, 2):
        t, gyr, known = np.arange(800) / 80, _struck(800, rng), _known(800, first, length)
        filled = bridge_gaps(t, np.where(known[:, None], gyr, np.nan), known)
        errors.append(np.sum((np.sum(filled - gyr, axis=0) / 80) ** 2))
        variances.append(missed_variance(t, gyr, known, NOTHING)[first])
    assert 0.5 < np.mean(errors) / np.mean(variances) < 2.0


def test_rates_before_the_first_row_tell_it_too_and_a_bias_does_not() -> None:
    rng = np.random.default_rng(4)
    t, gyr, known = np.arange(800) / 80, _struck(800, rng), _known(800, 700, 3)
    gyr[[650, 690]] = np.nan
    whole = missed_variance(t, gyr, known, NOTHING)[700]
    later = missed_variance(t[600:], gyr[600:], known[600:], gyr[:600])[100]
    biased = missed_variance(t, gyr + 0.1, known, NOTHING)[700]
    np.testing.assert_allclose([later, biased], whole, rtol=1e-9)
