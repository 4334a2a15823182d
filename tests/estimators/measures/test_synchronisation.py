"""Lags that were put in are found again, and nothing is found where there is nothing."""

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.measures.synchronisation import Signal, fit_at, interpolate, synchronise
from tests.estimators.measures.movements import movement, sampled
from tests.simulated import DEG


@pytest.mark.parametrize("clock", [0.0, 3.7, -11.0034, 0.0004])
@pytest.mark.parametrize("rates", [(100.0, 100.0), (100.0, 120.0), (200.0, 60.0), (60.0, 1000.0)])
def test_a_lag_is_found_below_a_tenth_of_a_millisecond_at_any_rates(
    clock: float, rates: tuple[float, float]
) -> None:
    move = movement(1)
    a, b = sampled(move, 0.0, 40.0, rates[0]), sampled(move, 2.0, 45.0, rates[1], clock)
    lag = synchronise(a, b)
    assert lag.seconds == pytest.approx(clock, abs=1e-4)
    assert lag.correlation > 0.9999
    assert lag.overlap == pytest.approx(38.0, abs=0.1)
    assert lag.rival is None


def test_offsets_other_sizes_and_noise_do_not_move_the_lag() -> None:
    move, rng = movement(2), np.random.default_rng(0)
    a, b = sampled(move, 0.0, 60.0, 100.0), sampled(move, 0.0, 60.0, 90.0, 1.23456)
    worse = Signal(
        b.t,
        0.8 * b.values + np.array([0.3, -2.0, 0.1]) + rng.normal(scale=0.05, size=b.values.shape),
    )
    lag = synchronise(a, worse)
    assert lag.seconds == pytest.approx(1.23456, abs=2e-3)
    assert 0.95 < lag.correlation < 0.999


def test_stretches_that_are_not_known_leave_the_lag_alone() -> None:
    move = movement(3)
    a, b = sampled(move, 0.0, 40.0, 100.0), sampled(move, 0.0, 40.0, 75.0, -2.5)
    a.values[500:900, 0] = np.nan
    b.values[1000:1400] = np.nan
    b.values[::17, 2] = np.nan
    lag = synchronise(a, b)
    assert lag.seconds == pytest.approx(-2.5, abs=1e-3)


def test_samples_left_out_are_a_gap_and_not_a_straight_line() -> None:
    move = movement(4)
    b = sampled(move, 0.0, 20.0, 100.0)
    kept = np.flatnonzero((b.t < 8.0) | (b.t > 9.0))
    thinned = Signal(b.t[kept], b.values[kept])
    at = np.linspace(0.0, 19.9, 777)
    values = interpolate(thinned, at)
    within = (at > 7.99) & (at < 9.01)
    assert np.isnan(values[within]).all()
    np.testing.assert_allclose(values[~within], move(at)[~within], atol=3e-5)
    assert synchronise(sampled(move, 0.0, 20.0, 100.0, 0.5), thinned).seconds == pytest.approx(
        -0.5, abs=1e-4
    )


def test_samples_come_back_as_they_are_and_nothing_stands_outside() -> None:
    a = sampled(movement(5), 1.0, 3.0, 50.0)
    a.values[10, 1] = np.nan
    np.testing.assert_array_equal(interpolate(a, a.t), a.values)
    assert np.isnan(interpolate(a, np.array([0.9, 3.1]))).all()


def test_a_periodic_movement_gives_the_lag_of_the_longest_overlap_and_names_the_rival() -> None:
    def swinging(t: np.ndarray) -> np.ndarray:
        return 0.5 * np.sin(np.pi * t)[:, None]  # 0.5 Hz, as by a metronome

    lag = synchronise(sampled(swinging, 0.0, 30.0, 100.0), sampled(swinging, 0.0, 30.0, 80.0, 0.37))
    assert lag.seconds == pytest.approx(0.37, abs=1e-3)
    assert lag.rival is not None
    assert abs(abs(lag.rival - 0.37) - 2.0) < 0.03
    assert (
        synchronise(
            sampled(swinging, 0.0, 30.0, 100.0), sampled(swinging, 0.0, 30.0, 80.0, 0.37), 1.0
        ).rival
        is None
    )


@pytest.mark.parametrize("seed", range(6))
def test_another_movement_is_refused(seed: int) -> None:
    a, b = (
        sampled(movement(10 + seed), 0.0, 40.0, 100.0),
        sampled(movement(50 + seed), 0.0, 40.0, 100.0),
    )
    with pytest.raises(
        InputError, match="do not fit each other at any lag: the best correlation is 0"
    ):
        synchronise(a, b)


@pytest.mark.parametrize("seed", range(4))
def test_a_slow_movement_is_known_again_although_it_drifts(seed: int) -> None:
    """Few independent values: chance alone would reach 0.97 here."""
    move, rng = movement(20 + seed, fastest=0.3), np.random.default_rng(seed)
    a, b = sampled(move, 0.0, 20.0, 100.0), sampled(move, 1.0, 19.0, 100.0, 3.0)
    drift = 3 * DEG * np.cumsum(rng.normal(size=b.values.shape), axis=0) / np.sqrt(len(b.t))
    assert synchronise(a, Signal(b.t, b.values + drift)).seconds == pytest.approx(3.0, abs=0.1)


def test_recordings_one_after_the_other_are_refused() -> None:
    move = movement(6)
    with pytest.raises(InputError, match="choose two recordings of one movement"):
        synchronise(sampled(move, 0.0, 20.0, 100.0), sampled(move, 25.0, 45.0, 100.0, 25.0))
    with pytest.raises(InputError, match="do not overlap at a lag of 100 s"):
        fit_at(sampled(move, 0.0, 20.0, 100.0), sampled(move, 0.0, 20.0, 100.0), 100.0)


def test_a_hand_that_does_not_move_cannot_be_synchronised() -> None:
    still = Signal(np.arange(0, 20, 0.01), np.full((2000, 3), 0.4))
    with pytest.raises(
        InputError, match="nothing moves in the channels that both recordings hold in B"
    ):
        synchronise(sampled(movement(7), 0.0, 20.0, 100.0), still)
    with pytest.raises(
        InputError, match="overlap nowhere by 25 %"
    ):  # neither the clock's lag nor any other within reach
        synchronise(
            sampled(movement(7), 0.0, 20.0, 100.0, 40.0),
            sampled(movement(7), 0.0, 20.0, 100.0),
            1.0,
        )


def test_ten_minutes_of_all_angles_take_a_few_seconds() -> None:
    import time

    few = movement(8, 3)
    a, b = (
        Signal(s.t, np.tile(s.values, 8))
        for s in (sampled(few, 0.0, 600.0, 100.0), sampled(few, 5.0, 605.0, 100.0, 5.0))
    )
    start = time.process_time()
    assert synchronise(a, b).seconds == pytest.approx(5.0, abs=1e-4)
    assert time.process_time() - start < 5.0  # 0.8 s when it was written


@pytest.mark.parametrize("clock", [3.0, 1.2375])
def test_noise_does_not_draw_the_lag_to_half_a_sample(clock: float) -> None:
    """Interpolated halfway between two samples noise is smaller and the correlation larger: without a low-pass 100 Hz against 100 Hz were 5 ms off."""
    move, rng = movement(9), np.random.default_rng(9)
    a, b = sampled(move, 0.0, 40.0, 100.0), sampled(move, 0.0, 40.0, 100.0, clock)
    a, b = (Signal(s.t, s.values + rng.normal(scale=1 * DEG, size=s.values.shape)) for s in (a, b))
    assert synchronise(a, b).seconds == pytest.approx(clock, abs=4e-4)


def test_the_lag_of_a_clock_that_counts_from_1970_is_as_exact() -> None:
    move = movement(1)
    a, b = sampled(move, 0.0, 40.0, 100.0), sampled(move, 2.0, 45.0, 60.0, -1.7e9)
    assert synchronise(a, b).seconds == pytest.approx(-1.7e9, rel=0, abs=1e-4)
