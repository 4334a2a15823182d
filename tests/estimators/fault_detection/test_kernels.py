"""What the checks make of every sample against references: scipy's splines, one kernel against the other, a part of a long recording against all of it."""

import tracemalloc

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.fault_detection.neighbours import joint_windows
from handscope.estimators.fault_detection.neighbours.joint_windows import common_series, cut
from handscope.estimators.fault_detection.neighbours.window_kernels import (
    evaluate_spline,
    spline_slopes,
)
from handscope.estimators.fault_detection.single_sensors import cells
from handscope.estimators.fault_detection.single_sensors.cells import CHAIN, Cells
from handscope.estimators.fault_detection.single_sensors.gravity_windows import windows_of
from handscope.estimators.hand.anatomy import SEGMENTS

SENSORS = SEGMENTS[:4]


def test_splines_are_those_of_scipy_between_samples_at_any_instants():
    rng = np.random.default_rng(1)
    at, values = np.cumsum(rng.uniform(0.005, 0.1, 50)), rng.normal(size=(50, 4))
    t = np.sort(rng.uniform(at[0], at[-1], 300))
    after = np.clip(np.searchsorted(at, t), 1, len(at) - 1)
    reference = CubicSpline(at, values)
    value, change = evaluate_spline(at, values, spline_slopes(at, values), t, after)
    np.testing.assert_allclose(value, reference(t), atol=1e-11)
    np.testing.assert_allclose(change, reference(t, 1), atol=1e-9)


def test_forces_are_the_same_without_their_slopes_also_where_a_sensor_spins():
    rng = np.random.default_rng(2)
    gyr = np.cumsum(rng.normal(size=(CHAIN, 2, 3)), axis=0)
    gyr[100:120] *= 20.0  # turns within a cell for which no series is used
    cells = Cells(("a", "b"), 0.0, gyr, rng.normal(size=gyr.shape), np.ones((CHAIN, 2), bool))
    M = np.diag([1.0, -1.0, 1.0])
    both, force = windows_of(cells, M), windows_of(cells, M, False)
    np.testing.assert_allclose(force.force, both.force, atol=1e-11)
    np.testing.assert_array_equal(force.path, both.path)


def _shaken(seconds: float, sensors: tuple[str, ...] = SENSORS) -> Block:
    """Sensors that turn at random, more from minute to minute."""
    t = np.arange(round(100 * seconds)) / 100.0
    values = np.random.default_rng(3).normal(0.0, 1.0, (len(t), len(sensors), 6))
    return Block(
        Stream("imu", sensors, (GYR, ACC), 100.0), t, values * (1 + t // 60)[:, None, None]
    )


def _gapped(seconds: float) -> Block:
    """One sensor misses other samples than the rest."""
    block = _shaken(seconds)
    block.values[::7, 1] = np.nan
    return block


def test_windows_of_a_long_recording_are_those_of_all_its_samples(monkeypatch: pytest.MonkeyPatch):
    blocks = [_gapped(150.4)]
    part = common_series(blocks, {})
    monkeypatch.setattr(joint_windows, "_rows_about", lambda chosen, n: (np.arange(n), chosen))
    whole = common_series(blocks, {})
    assert part is not None and whole is not None
    assert len(part.t) < 0.6 * len(whole.t) and part.count == len(whole.t)
    assert part.span == whole.span == (whole.t[0], whole.t[-1])
    for around, later in ((0, 0), (10, 3)):
        for one, other in zip(
            cut(part, SENSORS, around, later), cut(whole, SENSORS, around, later)
        ):
            for name in ("t", "force", "arm", "turned", "rate", "share"):
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)


def test_sensors_a_few_at_a_time_are_those_of_all_at_once(monkeypatch: pytest.MonkeyPatch):
    blocks = [_gapped(70.0)]
    series, grid = common_series(blocks, {}), cells.cells_of(blocks)
    monkeypatch.setattr(cells, "AT_ONCE", 1)
    again, regrid = common_series(blocks, {}), cells.cells_of(blocks)
    assert series is not None and again is not None
    for name in ("gyr", "change", "acc", "whole", "chosen"):
        np.testing.assert_array_equal(getattr(series, name), getattr(again, name), name)
    for name in ("gyr", "acc", "valid"):
        np.testing.assert_array_equal(getattr(grid, name), getattr(regrid, name), name)


@pytest.mark.parametrize("made", [lambda b: common_series(b, {}), cells.cells_of])
def test_what_is_made_of_a_long_recording_takes_hardly_more_memory_than_it(made):
    block = _shaken(600.0, SEGMENTS)
    tracemalloc.start()
    try:
        made([block])
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 1.5 * block.values.nbytes
