"""One clock on another from late arrivals: drift followed, jitter removed, and back again."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.sessions.wire.clock_mapping import WINDOW, ClockMap

PPM = 1e-6
DRIFT = st.floats(-100 * PPM, 100 * PPM)
SEED = st.integers(0, 2**32 - 1)
LEAST = 0.005  # s that every pair is late; no map can see it


def _followed(
    drift: float, delays: np.ndarray, rate: float = 25.0
) -> tuple[np.ndarray, np.ndarray, ClockMap]:
    """Times (n,) and the errors (n,) of the map at the newest pair, s: how much later than the least delay it puts it."""
    clock, t, error = ClockMap(), np.arange(len(delays)) / rate, np.empty(len(delays))
    for k, (true, delay) in enumerate(zip(t, delays)):
        remote = 1000.0 + true * (1 + drift)
        clock.update(remote, 5.0 + true + LEAST + delay)
        error[k] = clock.local(remote) - (5.0 + true + LEAST)
    return t, error, clock


@given(DRIFT, SEED)
def test_drift_and_jitter_are_removed(drift: float, seed: int) -> None:
    """25 pairs a second, late by 10 ms on average: within 1.5 ms after 10 s, 0.5 ms after 30 s, 0.3 ms after a minute."""
    t, error, _ = _followed(drift, np.random.default_rng(seed).exponential(0.010, 25 * 80))
    for after, bound in ((10, 1.5e-3), (30, 0.5e-3), (60, 0.3e-3)):
        assert np.abs(error[t >= after]).max() < bound


@given(DRIFT)
def test_without_jitter_the_map_is_exact_but_for_the_drift_within_a_second(drift: float) -> None:
    t, error, clock = _followed(drift, np.zeros(25 * 30))
    assert np.abs(error[t < 6]).max() <= 6 * abs(drift) + 1e-9  # before a drift is believed
    assert np.abs(error[t > 7]).max() < 1e-9
    assert clock.rate == pytest.approx(1 / (1 + drift), abs=1e-9)


@given(DRIFT, SEED, st.floats(20, 40), st.floats(0.02, 0.2))
def test_ten_seconds_of_a_busy_line_do_not_move_it(
    drift: float, seed: int, busy: float, late: float
) -> None:
    rng = np.random.default_rng(seed)
    delays = rng.exponential(0.002, 25 * 60)
    t = np.arange(len(delays)) / 25
    delays[(t > busy) & (t < busy + 10)] += late
    _, error, _ = _followed(drift, delays)
    assert np.abs(error[t > 15]).max() < 3e-3


@given(DRIFT, SEED, st.floats(0, 2000))
def test_remote_undoes_local(drift: float, seed: int, remote: float) -> None:
    _, _, clock = _followed(drift, np.random.default_rng(seed).exponential(0.01, 300))
    assert clock.remote(clock.local(remote)) == pytest.approx(remote, abs=1e-9)


def test_a_drift_that_changes_is_followed() -> None:
    clock, remote = ClockMap(), 0.0
    rng = np.random.default_rng(3)
    for k in range(25 * 600):
        t = k / 25
        remote += (1 + (80 * PPM if t < 300 else -80 * PPM)) / 25
        clock.update(remote, t + rng.exponential(0.005))
    assert clock.rate == pytest.approx(1 + 80 * PPM, abs=5 * PPM)
    assert abs(clock.local(remote) - 600.0) < 0.05


def test_no_more_is_kept_than_the_window() -> None:
    clock = ClockMap()
    for k in range(20_000):
        clock.update(k / 10, k / 10)
    assert len(clock._best) <= WINDOW + 2


def test_the_first_pair_is_enough_to_map() -> None:
    clock = ClockMap()
    clock.update(10.0, 110.5)
    assert clock.local(12.0) == 112.5
    assert clock.remote(112.5) == 12.0


def test_a_later_pair_that_came_quicker_corrects_at_once() -> None:
    clock = ClockMap()
    clock.update(10.0, 110.5)
    clock.update(10.1, 110.2)
    assert clock.local(10.1) == pytest.approx(110.2)
    clock.update(10.2, 110.9)
    assert clock.local(10.2) == pytest.approx(110.3)
