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
