"""Compiled parts of the checks against references: scipy's splines, and one kernel against the other."""

import numpy as np
from scipy.interpolate import CubicSpline

from handscope.estimators.fault_detection.neighbours.window_kernels import (
    evaluate_spline,
    spline_slopes,
)
from handscope.estimators.fault_detection.single_sensors.cells import CHAIN, Cells
from handscope.estimators.fault_detection.single_sensors.gravity_windows import windows_of


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
