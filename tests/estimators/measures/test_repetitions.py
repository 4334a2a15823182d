"""Counting repetitions: as many as were made, from wherever they began, tremor and gaps left aside."""

import numpy as np
import pytest

from handscope.estimators.measures.repetitions import count

RATE = 60.0  # Hz
LEAST = 8.0  # deg


def moved(times: int, phase: float, tremor: float = 0.0) -> np.ndarray:
    """Rest, then `times` turns of 2 s between 0 and 70 deg, rest at the end: phase 0 begins straight, 1/4 in the middle, 1/2 bent."""
    t = np.arange(0.0, 2.0 * times, 1 / RATE)
    turns = 35.0 * (1 - np.cos(2 * np.pi * (0.5 * t + phase)))
    whole = np.concatenate([np.full(90, turns[0]), turns, np.full(90, turns[0])])
    return whole + tremor * np.sin(2 * np.pi * 6.0 * np.arange(len(whole)) / RATE)


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5])
@pytest.mark.parametrize("times", [1, 3, 10])
def test_as_many_as_were_made_wherever_they_began(times: int, phase: float) -> None:
    assert count(moved(times, phase), LEAST) == times
    assert count(-moved(times, phase), LEAST) == times


def test_tremor_at_an_end_is_no_repetition() -> None:
    assert count(moved(10, 0.0, tremor=6.0), LEAST) == 10


def test_a_hand_at_rest_repeats_nothing() -> None:
    assert count(20.0 + 3.0 * np.sin(np.arange(0.0, 60.0, 0.5)), LEAST) == 0
    assert count(np.empty(0), LEAST) == 0
    assert count(np.full(100, np.nan), LEAST) == 0


def test_what_was_not_measured_is_left_out() -> None:
    values = moved(10, 0.0)
    values[200:260] = np.nan  # half a repetition
    assert count(values, LEAST) == 10


def test_holds_count_like_quick_movements() -> None:
    held = np.repeat(np.tile([0.0, 94.0], 5), 6 * int(RATE))
    assert count(held, LEAST) == 5
