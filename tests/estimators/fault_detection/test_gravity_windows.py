"""Gravity carried along by the gyroscope: derivatives, and truth recovered."""

import numpy as np
from scipy.spatial.transform import Rotation

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.fault_detection.single_sensors.cells import CHAIN, Cells, cells_of
from handscope.estimators.fault_detection.single_sensors.gravity_fit import (
    fit,
    information_of,
    priors,
)
from handscope.estimators.fault_detection.single_sensors.gravity_windows import (
    ARM,
    DELAY,
    MATRIX,
    windows_of,
)
from tests.estimators.fault_detection.recordings import moved_freely, with_readings

IDENTITY = np.eye(3)


def anyhow(seed: int = 1) -> Cells:
    """One sensor that turns anyhow and feels anything."""
    rng = np.random.default_rng(seed)
    smooth = np.cumsum(rng.normal(size=(2, CHAIN, 1, 3)), axis=1)
    return Cells(("hand",), 0.0, 0.1 * smooth[0], smooth[1], np.ones((CHAIN, 1), bool))


def test_the_slope_by_the_matrix_is_the_derivative():
    cells, slope, step = anyhow(), windows_of(anyhow(), IDENTITY).slope, 1e-6
    for k in range(9):
        change = np.zeros(9)
        change[k] = step
        ahead, back = (
            windows_of(cells, IDENTITY + sign * change.reshape(3, 3), False).force
            for sign in (1, -1)
        )
        np.testing.assert_allclose(
            slope[..., MATRIX][..., k],
            (ahead - back) / (2 * step),
            atol=1e-2 * np.abs(slope[..., MATRIX]).max(),
        )


def test_a_sensor_that_only_turns_keeps_gravity_where_it_is():
    block = turning(lever=0.0)
    windows = windows_of(cells_of([block]), IDENTITY, False)
    np.testing.assert_allclose(windows.force - windows.force[:, :, :1], 0.0, atol=0.01)


def test_the_lever_arm_takes_what_turns_about_a_fixed_centre():
    found = fit(
        information_of(windows_of(cells_of([turning(lever=0.08)]), IDENTITY)), priors(np.eye(9))
    )
    off = found.x[0, ARM] - [0.0, 0.08, 0.0]
    assert (np.abs(off) < 2 * np.sqrt(np.diag(found.cov[0, ARM, ARM]))).all() and np.abs(
        off
    ).max() < 0.02
    np.testing.assert_allclose(found.matrix[0], 0.0, atol=0.02)


def test_a_matrix_and_its_standard_deviation_are_honest():
    blocks, k = moved_freely(), 4
    true = np.array([[1.1, 0.02, 0.0], [0.0, 0.95, 0.05], [0.0, 0.0, 1.0]])
    spoilt = with_readings(blocks, GYR, lambda y: y @ np.linalg.inv(true).T)
    found = fit(information_of(windows_of(cells_of(spoilt), true - 0.02)), priors(np.eye(9)))
    off = (found.matrix - 0.02).reshape(-1, 9)
    squared = np.einsum("si,sij,sj->s", off, np.linalg.inv(found.cov[:, MATRIX, MATRIX]), off) / 9
    assert k < len(squared) and np.median(squared) < 1.5 and squared.max() < 3.5


def test_a_late_gyroscope_is_found_late():
    spoilt = with_readings(
        moved_freely(), GYR, lambda y: np.concatenate([np.repeat(y[:1], 15, axis=0), y[:-15]])
    )
    found = fit(information_of(windows_of(cells_of(spoilt), IDENTITY)), priors(delay=True))
    assert abs(np.median(found.x[:, DELAY]) - 0.15) < 0.04


def turning(lever: float) -> Block:
    """A sensor that turns about x and z, `lever` m along its y axis from a centre at rest, without errors."""
    t, h = np.arange(0.0, 12.0, 0.01), 1e-3

    def pose(t: np.ndarray) -> Rotation:
        return Rotation.from_rotvec(
            np.stack([0.8 * np.sin(1.3 * t), 0 * t, 0 * t], 1)
        ) * Rotation.from_rotvec(np.stack([0 * t, 0 * t, 1.1 * np.sin(2.1 * t)], 1))

    place = [pose(t + k * h).apply([0.0, lever, 0.0]) for k in (-1, 0, 1)]
    a = (place[2] - 2 * place[1] + place[0]) / h**2 + [0.0, 0.0, 9.80665]
    w = (pose(t - h).inv() * pose(t + h)).as_rotvec() / (2 * h)
    values = np.concatenate([w, pose(t).inv().apply(a)], axis=1)[:, None]
    return Block(Stream("imu", ("hand",), (GYR, ACC), 100.0), t, values)
