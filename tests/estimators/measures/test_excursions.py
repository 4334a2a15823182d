"""Repetitions found in movements whose repetitions are known: those that the simulator made."""

import numpy as np
import pytest

from handscope.estimators.measures.excursions import find_excursions, repetitions
from tests.app.report.simulated_sessions import session


@pytest.mark.parametrize("count", [1, 3, 12])
def test_every_excursion_is_found_and_they_touch_at_rest(count: int) -> None:
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 4.0 * count, 0.01)
    away = np.clip(np.sin(np.pi * (t % 4.0) / 3.0), 0.0, None) * (t % 4.0 < 3.0) * (
        0.8 + 0.4 * (t // 4.0 % 2)
    ) + 0.02 * rng.standard_normal(len(t))
    spans = find_excursions(t, away)
    assert len(spans) == count
    for k, (start, stop) in enumerate(spans):
        assert start < 4.0 * k + 1.0 and stop > 4.0 * k + 2.3
    np.testing.assert_allclose([s for s, _ in spans[1:]], [e for _, e in spans[:-1]])


@pytest.mark.parametrize("away", [np.empty(0), np.full(500, np.nan), np.zeros(500)])
def test_where_nothing_moves_there_is_none(away: np.ndarray) -> None:
    assert find_excursions(np.arange(len(away)) / 100, away) == []


def test_the_three_repetitions_of_each_range_of_motion_are_found() -> None:
    recording, processed, _ = session()
    for e in recording.events:
        if (task := str(e.details.get("task_name", ""))) in ("rom_fist", "rom_spread", "rom_thumb"):
            spans = repetitions(processed.trajectory, e.onset, e.end)
            assert len(spans) == 3, task
            assert all(e.onset <= a < b <= e.end + 0.02 for a, b in spans)


def test_taps_are_those_that_the_measure_counts() -> None:
    _, processed, results = session()
    (taps,) = [r for r in results if r.measure == "tapping"]
    found = repetitions(processed.trajectory, taps.onset, taps.end, [taps.details])
    assert len(found) == taps.details.count > 20
