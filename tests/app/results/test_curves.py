"""Curves for pages: thinned without losing a peak, and two results on one clock."""

import numpy as np
import pytest

from handscope.app.results.curves import LEAD, MatchedTask, at_other, thinned


def test_thinning_loses_no_peak_and_keeps_the_order() -> None:
    t = np.arange(36_000) / 60
    tapping = 30 + 30 * np.cos(
        2 * np.pi * 2.5 * t
    )  # ten minutes: every 24th sample would show a slow beat
    spike = np.where(t == t[20_001], 500.0, 0.0)
    places, (a, b) = thinned(t, [tapping, spike], 1500)
    assert len(places) <= 1500 and (np.diff(places) > 0).all()
    assert (a.max(), a.min()) == pytest.approx((60.0, 0.0), abs=0.2)
    assert np.ptp(a.reshape(-1, 10), axis=1).min() > 55
    assert b.max() == 500.0
    assert abs(places[b.argmax()] - t[20_001]) < 2 * 36_000 / 1500 / 60


@pytest.mark.parametrize("count", [0, 1, 2, 99, 100, 101, 1001])
def test_any_number_of_samples_is_thinned_to_the_number_wanted(count: int) -> None:
    t = np.arange(count) / 10.0
    places, (values,) = thinned(t, [t], 100)
    assert len(places) == len(values) <= max(100, 0)
    assert np.nanmin(values, initial=0.0) == 0.0


def test_what_is_not_known_stays_so() -> None:
    t = np.arange(1000) / 10.0
    values = np.where(t < 50, np.nan, 1.0)
    _, (found,) = thinned(t, [values], 100)
    assert np.isnan(found[:48]).all() and (found[52:] == 1.0).all()


def test_two_recordings_run_task_by_task_in_step() -> None:
    steps = (
        MatchedTask(10.0, 100.0, 5.0),
        MatchedTask(20.0, 90.0, 8.0),
    )  # the other did the second task first
    assert at_other((), 3.7) == 3.7
    t = np.arange(0.0, 40.0, 0.01)
    other = np.array([at_other(steps, float(x)) for x in t])
    for step in steps:
        inside = (t >= step.onset) & (t <= step.onset + step.length)
        np.testing.assert_allclose(other[inside] - step.other, t[inside] - step.onset, atol=1e-9)
    assert other.min() >= 90.0 - LEAD and other.max() <= 105.0 + LEAD
    assert (
        np.count_nonzero(np.abs(np.diff(other)) > 0.1) == 1
    )  # it jumps once, before the second task
