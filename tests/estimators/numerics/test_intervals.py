"""Runs of true flags at the edges that their callers depend on."""

import numpy as np
import pytest

from handscope.estimators.numerics.intervals import find_runs


def _flags(marks: str) -> np.ndarray:
    return np.array([c == "x" for c in marks], bool)


@pytest.mark.parametrize(
    ("marks", "runs"),
    [
        ("", []),
        ("...", []),
        ("xxx", [(0, 3)]),
        ("x..xx", [(0, 1), (3, 5)]),
        (".xx.x.", [(1, 3), (4, 5)]),
    ],
)
def test_runs_are_half_open_and_reach_both_ends(marks: str, runs: list[tuple[int, int]]) -> None:
    """sensors/fault_detection.py, stuck_axes.py and static_segments.py; force/contact.py crosses a
    level at `stop`."""
    assert find_runs(_flags(marks)) == runs


@pytest.mark.parametrize(
    ("gap", "runs"), [(0, [(0, 1), (2, 3), (5, 6)]), (1, [(0, 3), (5, 6)]), (2, [(0, 6)])]
)
def test_runs_that_lie_within_the_gap_are_one(gap: int, runs: list[tuple[int, int]]) -> None:
    """self_calibration/outliers.py joins what one impact leaves."""
    assert find_runs(_flags("x.x..x"), gap) == runs


def test_the_interval_of_a_run_selects_it_alone() -> None:
    """force/sensor.py, force/zero.py and magnet/array/bench_readings.py write into `[first:stop]`
    and count `stop - first`."""
    flags = np.random.default_rng(3).random(200) < 0.5
    written = np.zeros(200, bool)
    for first, stop in find_runs(flags):
        written[first:stop] = True
    np.testing.assert_array_equal(written, flags)
    assert sum(stop - first for first, stop in find_runs(flags)) == flags.sum()


def test_numbers_of_an_interval_are_plain() -> None:
    assert all(type(k) is int for run in find_runs(_flags("x.xx")) for k in run)
