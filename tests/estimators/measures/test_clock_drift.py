"""Clocks of known drift are found out, equal ones left alone, and the standard deviation is as large as the error."""

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.measures.clock_drift import synchronised_clocks, with_drift
from handscope.estimators.measures.synchronisation import Signal, synchronise
from tests.estimators.measures.movements import movement
from tests.schedule import swept

PPM = 1e-6


def pair(
    seed: int,
    length: float,
    drift: float,
    rate: float = 128.0,
    noise: float = 0.005,
    offset: float = 5.0,
) -> tuple[Signal, Signal]:
    """One movement told by A at 100 Hz and by B, whose clock reads (1 + drift) t - offset, starts 3 s later and ends 6 s later."""
    move, rng = movement(seed), np.random.default_rng(seed)
    t_a, t_b = np.arange(0.0, length, 0.01), np.arange(3.0, length + 6.0, 1 / rate)
    a = Signal(t_a, move(t_a) + rng.normal(scale=0.5 * noise, size=(len(t_a), 3)))
    return a, Signal(
        t_b * (1 + drift) - offset,
        0.9 * move(t_b) + 0.1 + rng.normal(scale=noise, size=(len(t_b), 3)),
    )


@pytest.mark.parametrize(
    ("drift", "rate"),
    [(-500 * PPM, 60.0), (50 * PPM, 128.0), (100 * PPM, 100.0), (500 * PPM, 200.0)],
)
def test_a_drift_is_found_and_every_instant_is_right(drift: float, rate: float) -> None:
    lag = synchronised_clocks(*pair(1, 90.0, drift, rate))
    assert lag.drift is not None and lag.drift.applied
    assert abs(lag.drift.value - drift) < 4 * lag.drift.sd < 60 * PPM
    assert lag.at == pytest.approx(3.0, abs=0.05)
    at = np.array([3.0, 45.0, 90.0])
    np.testing.assert_allclose(lag.on_b(at), at * (1 + drift) - 5.0, atol=1.5e-3)
    np.testing.assert_allclose(lag.on_a(lag.on_b(at)), at, atol=1e-9)


@pytest.mark.parametrize("pairs", swept([6, 12], kept=[6]))
def test_equal_clocks_are_left_alone_and_the_standard_deviation_is_honest(pairs: int) -> None:
    lags = [
        with_drift(a, b, synchronise(a, b))
        for a, b in (pair(seed, 45.0, 0.0) for seed in range(pairs))
    ]
    assert not any(lag.rate for lag in lags)
    off = [lag.drift.value / lag.drift.sd for lag in lags if lag.drift]
    assert len(off) == pairs
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_windows_that_are_hidden_spoilt_or_still_do_not_bend_the_line() -> None:
    a, b = pair(2, 90.0, 200 * PPM)
    b.values[2000:3500] = np.nan
    b.values[6000:7000] = np.random.default_rng(0).normal(scale=0.2, size=(1000, 3))
    a.values[:1500] = b.values[:1000].mean()
    lag = synchronised_clocks(a, b)
    assert lag.rate == pytest.approx(200 * PPM, abs=30 * PPM)


def test_a_long_one_that_fits_nowhere_as_a_whole_is_followed_from_its_busiest_minutes() -> None:
    a, b = pair(3, 1000.0, 900 * PPM, 60.0)
    a, b = Signal(a.t[::2], a.values[::2]), b
    with pytest.raises(InputError, match="do not fit each other"):
        synchronise(a, b)
    lag = synchronised_clocks(a, b)
    at = np.array([3.0, 500.0, 1000.0])
    np.testing.assert_allclose(lag.on_b(at), at * (1 + 900 * PPM) - 5.0, atol=4e-3)
    assert lag.overlap == pytest.approx(997.0, abs=1.0)


def test_too_short_for_a_line_says_nothing_of_the_clocks() -> None:
    assert synchronised_clocks(*pair(4, 13.0, 0.0)).drift is None  # 10 s in common
