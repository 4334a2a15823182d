"""Tremor of known frequency and extent, in noise, and hands that do not tremble."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENT, SEGMENTS
from handscope.estimators.measures import tremor
from handscope.estimators.measures.tremor import NO_PEAK, Params
from handscope.estimators.messages.sentence import codes_of
from handscope.estimators.numerics import quaternions as quat
from tests.estimators.measures.trajectories import by_name, made

DEG = np.pi / 180
T = np.arange(0, 30, 0.01)


def _rates(frequency: float, amplitude: float, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Turning to and fro by `amplitude` rad about an axis askew."""
    axis = np.array([0.6, 0.0, 0.8])
    rate = 2 * np.pi * frequency * amplitude * np.cos(2 * np.pi * frequency * T)
    return rate[:, None] * axis + np.random.default_rng(seed).normal(0, noise, (len(T), 3))


@given(st.floats(3.6, 14.0), st.floats(0.2, 5.0), st.integers(0, 1000))
def test_frequency_and_amplitude_of_a_sine_are_found_in_noise(
    frequency: float, degrees: float, seed: int
) -> None:
    found = tremor.of_rates(
        T, _rates(frequency, degrees * DEG, 0.05 * 2 * np.pi * frequency * degrees * DEG, seed)
    )
    assert found.frequency == pytest.approx(frequency, abs=0.05)
    assert found.amplitude == pytest.approx(degrees * DEG, rel=0.06)
    assert found.rate_rms == pytest.approx(
        2 * np.pi * frequency * degrees * DEG / np.sqrt(2), rel=0.06
    )
    assert found.time_share == 1.0


def test_the_power_of_a_whole_spectrum_is_the_signals_variance() -> None:
    rates = _rates(5.0, 2 * DEG)
    found = tremor.of_rates(T, rates)
    assert found.density.sum() * found.f[1] == pytest.approx(rates.var(axis=0).sum(), rel=0.01)


def test_a_tremor_for_half_the_time_is_said_to_be_so() -> None:
    rates = _rates(5.0, 2 * DEG, 0.002)
    rates[T > 15] = np.random.default_rng(1).normal(0, 0.002, ((T > 15).sum(), 3))
    assert tremor.of_rates(T, rates).time_share == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("seed", range(20))
def test_noise_and_slow_movement_are_no_tremor(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for rates in (
        rng.normal(0, 0.01, (len(T), 3)),
        np.cumsum(rng.normal(0, 0.01, (len(T), 3)), axis=0),
    ):
        found = tremor.of_rates(T, rates)
        assert np.isnan([found.frequency, found.amplitude]).all()
        assert found.reason == NO_PEAK


def test_a_segment_that_trembles_is_found_in_a_trajectory_and_its_figures_have_a_standard_deviation() -> (
    None
):
    turned = 2 * DEG * np.sin(2 * np.pi * 6 * T)
    q_GS = np.full((len(T), len(SEGMENTS), 4), np.nan)
    q_GS[:, SEGMENT["hand"]] = quat.multiply(
        np.array([0.5, 0.5, -0.5, 0.5]), quat.exp(turned[:, None] * np.array([0.0, 1.0, 0.0]))
    )
    (found,) = tremor.measure(Params(), made(len(T), q_GS=q_GS), 0.0, 30.0)
    f = by_name(tremor.figures([found]))
    assert f["hand_tremor_frequency"].value == pytest.approx(6.0, abs=0.02)
    assert f["hand_tremor_amplitude"].value == pytest.approx(2 * DEG, rel=0.05)
    assert f["hand_tremor_log_amplitude"].value == pytest.approx(np.log10(2), abs=0.03)
    assert all(x.sd is not None for x in f.values())
    (spectrum,) = tremor.shown([found]).curves
    assert (spectrum.x_unit, spectrum.name) == ("Hz", "hand_spectrum")
    assert spectrum.x[np.argmax(spectrum.y)] == pytest.approx(6.0, abs=0.2)


@pytest.mark.parametrize(
    ("t", "reason"),
    [
        (np.arange(0, 2, 0.01), "shorter than a window"),
        (np.arange(0, 30, 0.05), "sampled at 20 Hz: too slow for tremor up to 15 Hz"),
        (T, "% of the time without samples"),
    ],
)
def test_what_cannot_show_a_tremor_says_why_with_a_code(t: np.ndarray, reason: str) -> None:
    rates = np.sin(2 * np.pi * 5 * t)
    if t is T:
        rates[(t > 5) & (t < 15)] = np.nan
    found = tremor.of_rates(t, rates)
    assert found.grade == "poor"
    assert reason in found.reason
    assert codes_of(found.reason)
    assert np.isnan([f.value for f in tremor.figures([found])]).all()


def test_rates_that_go_with_no_times_are_refused() -> None:
    with pytest.raises(InputError, match="do not go with"):
        tremor.of_rates(T, np.zeros((5, 3)))
