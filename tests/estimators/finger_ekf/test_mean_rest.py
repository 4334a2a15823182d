"""Rest of a hand that trembles: its mean rate measures the bias, and no slow movement counts as rest."""

import numpy as np
import pytest

from handscope.estimators.finger_ekf import filter as finger_ekf_filter
from handscope.estimators.finger_ekf import mean_rest
from handscope.estimators.finger_ekf.chain_state import BEGUN, NEWEST, SINCE, ChainState
from handscope.estimators.finger_ekf.filter import FilterParams, pack_params
from handscope.estimators.finger_ekf.samples import Samples
from handscope.estimators.finger_ekf.zero_rate_update import LONG
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from tests.estimators.finger_ekf.test_filter import _index, _samples
from tests.estimators.interpreted import interpreted

DEG = np.pi / 180
RATE = 100.0
BIAS = np.array([0.03, -0.02, 0.05]) * DEG  # rad/s
NUMBERS = pack_params(FilterParams())


def _turns(t: Array, size: float, hz: float, moved: Array | float = 0.0) -> Array:
    """Turns (n, 1, 4, 3) of the sensors of one chain that tremble by `size` deg about two axes out of phase, about a posture `moved` (n,) deg away."""
    phase = 2 * np.pi * hz * t[:, None] + np.array([0.0, 0.3, 0.6, 0.9])
    about = np.stack([np.sin(phase), 0.7 * np.cos(phase), 0.2 * np.sin(phase + 0.5)], axis=-1)
    slow = np.zeros((len(t), 1, 3))
    slow[:, 0, 2] = moved
    q = quat.multiply(quat.exp(slow * DEG), quat.exp(size * DEG * about))
    turn = quat.log(quat.relative(np.concatenate([q[:1], q[:-1]]), q))
    turn[1:] += BIAS / RATE
    return np.asarray(turn[:, None])


def _chain() -> ChainState:
    """One index finger at its start."""
    state = finger_ekf_filter._owned(_index(FilterParams()))
    return ChainState(*(getattr(state, name) for name in ChainState._fields))


def _accumulated(t: Array, turn: Array) -> ChainState:
    chains = _chain()
    interpreted(mean_rest.accumulate)(
        t, turn, np.full(turn.shape[:3], 1 / RATE), NUMBERS.rest_rate, chains
    )
    return chains


def _seconds(duration: float) -> Array:
    return np.arange(round(duration * RATE) + 1) / RATE


@pytest.mark.parametrize("hz", [4.0, 5.5])
def test_the_mean_rate_of_a_chain_that_trembles_in_place_is_its_bias(hz: float) -> None:
    """Two axes out of phase by 2 deg: the mean of the rates alone would be off by 0.5 deg/s and more."""
    t = _seconds(LONG)
    turn = _turns(t, 2.0, hz)
    chains = _accumulated(t, turn)
    assert chains.stay_clock[0, SINCE] == t[0]
    np.testing.assert_allclose(
        chains.stay_sums[0, :, 0] / DEG, np.tile(BIAS / DEG, (4, 1)), atol=0.01
    )
    by_rates = RATE * turn[1:, 0].mean(axis=0) - BIAS
    assert np.linalg.norm(by_rates, axis=1).min() > 0.5 * DEG


@pytest.mark.parametrize(("deg", "hz"), [(40.0, 0.05), (10.0, 0.1), (2.0, 0.3), (5.0, 0.05)])
def test_a_chain_that_moves_slowly_does_not_stay(deg: float, hz: float) -> None:
    """Beside the tremor; slower than the threshold of rest it is for one window at most, at its turning points."""
    t = _seconds(12.0)
    chains = _accumulated(t, _turns(t, 1.0, 5.0, deg * np.sin(2 * np.pi * hz * t)))
    clock = chains.stay_clock[0]
    assert clock[NEWEST] - clock[SINCE] < 0.5 * LONG


def test_a_long_window_measures_once_and_not_where_a_gyroscope_gave_nothing() -> None:
    """The third sensor's rotation is its fusion's."""
    t = _seconds(LONG + 0.3)
    samples: Samples = _samples(t, _turns(t, 1.0, 4.5))
    samples.bias_time[:, :, 2] = 0.0
    state, _ = finger_ekf_filter.step(FilterParams(), _index(FilterParams()), samples)
    measured = np.isfinite(state.previous_rest_rate[0]).all(axis=1)
    np.testing.assert_array_equal(measured, [True, True, False, True])
    assert state.stay_clock[0, BEGUN] > t[0] + LONG
    assert state.stay_clock[0, SINCE] == t[0]


def test_a_hand_that_creeps_is_measured_by_long_windows_once_it_has_stayed() -> None:
    """Without tremor: four short rests, then a long window; noise as large as rates of 0.05 deg/s and 20 s make it, not as their short differences."""
    t = _seconds(120.0)
    creep = 0.05 * 20 / (2 * np.pi) * np.sin(2 * np.pi * t / 20)
    state = _index(FilterParams())
    for first in range(0, len(t), 1000):
        part = _samples(t, _turns(t, 0.0, 4.0, creep)).between(slice(first, first + 1000))
        state, _ = finger_ekf_filter.step(FilterParams(), state, part)
    squares, number = state.rest_rate_scatter[0]
    assert number < 12 * (LONG / 1.5 + 120 / LONG)
    assert np.sqrt(squares / number) > 0.01 * DEG
    assert (state.rest_time == 0).all()


def test_errors_of_joints_are_alike_as_long_as_the_chain_stays() -> None:
    """Updates after 0.2 s each: at least the option, then the time that it has stayed."""
    lasts = interpreted(mean_rest.joint_correlation)
    assert lasts(NUMBERS, 0.2, np.full(4, np.nan)) == pytest.approx(5.0)
    assert lasts(NUMBERS, 0.2, np.array([10.0, 10.0, 10.4, 0.0])) == pytest.approx(5.0)
    assert lasts(NUMBERS, 0.2, np.array([10.0, 10.0, 70.0, 0.0])) == pytest.approx(300.0)


def test_biases_of_a_finger_that_trembles_are_found_however_its_samples_come() -> None:
    """A minute at 4.5 Hz: no rest is seen, and the vertical tells nothing of a turn about itself."""
    t = _seconds(60.0)
    turn = _turns(t, 1.5, 4.5)
    up = np.zeros(turn.shape)
    up[..., 0] = 9.81
    params = FilterParams(bias_sd=0.05)
    samples: Samples = _samples(t, turn, up)
    state, _ = finger_ekf_filter.step(params, _index(params), samples)
    assert np.isfinite(state.previous_rest_rate).all()
    assert np.abs(state.bias - BIAS).max() < 0.02 * DEG
    pieces = _index(params)
    for first in range(0, len(samples), 701):
        part = samples.between(slice(first, first + 701))
        pieces, _ = finger_ekf_filter.step(params, pieces, part)
    np.testing.assert_array_equal(pieces.bias, state.bias)
    np.testing.assert_array_equal(pieces.P, state.P)
