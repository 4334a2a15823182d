"""The paired test keeps its probability of a false alarm."""

import numpy as np

from handscope.estimators.fault_detection.neighbours import paired_test


def test_false_alarms_are_as_rare_as_stated_where_windows_are_independent() -> None:
    rng = np.random.default_rng(4)
    p = np.array([paired_test.p_value(rng.normal(size=40), 0.0) for _ in range(4000)])
    assert 0.03 < (p < 0.05).mean() < 0.075


def test_a_clear_gain_is_certain_and_a_loss_is_not() -> None:
    gain = 1.0 + 0.1 * np.random.default_rng(1).normal(size=30)
    assert paired_test.p_value(gain, 0.1) < 1e-9
    assert paired_test.p_value(-gain, 0.1) > 0.99


def test_few_windows_tell_nothing() -> None:
    assert paired_test.p_value(np.full(paired_test.FEWEST - 1, 9.0), 0.0) == 1.0


def test_some_values_may_be_anything_to_a_trimmed_mean() -> None:
    values = np.array([-5.0, *np.linspace(0.9, 1.1, 12), 7.0, 9.0])
    assert paired_test.trimmed_p_value(values, 0.0) < 1e-6
    assert paired_test.trimmed_p_value(values, 1.2) > 0.95


def test_the_trimmed_mean_of_values_about_the_margin_is_as_rare_as_it_says() -> None:
    rng = np.random.default_rng(4)
    p = np.array([paired_test.trimmed_p_value(rng.standard_t(3, 15), 0.0) for _ in range(2000)])
    assert 0.03 < np.mean(p < 0.05) < 0.07
