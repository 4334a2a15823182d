"""Trials of BROAD: read, scored, missed. The trials here are made up in the data set's format; the real ones are not in the repository."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from handscope.app.report.units import DEG
from handscope.estimators.data.samples import ACC, GYR, MAG
from handscope.estimators.errors import InputError
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.orientation.fusion import FusionParams
from handscope.validation.papers import published
from handscope.validation.reproduce import Wanted
from handscope.validation.studies import broad

RATE, N = 100.0, 4000
FIELD = np.array([0.0, 18.0, -45.0])  # uT: north and down


@pytest.fixture
def turning(tmp_path: Path) -> Path:
    """A board that is turned to and fro about the vertical, without errors; the cameras lose it for a while."""
    t = np.arange(N) / RATE
    heading = 1.2 * np.sin(0.5 * t)
    q = quat.about(2, heading)
    seen = q.copy()
    seen[1000:1100] = np.nan
    content = {
        "imu_gyr": np.column_stack([np.zeros((N, 2)), 0.6 * np.cos(0.5 * t)]),
        "imu_acc": np.tile([0.0, 0.0, 9.81], (N, 1)),
        "imu_mag": quat.rotate(quat.conjugate(q), np.tile(FIELD, (N, 1))),
        "opt_quat": seen,
        "movement": (t > 5).astype(np.uint8),
        "sampling_rate": RATE,
    }
    path = tmp_path / "turning.mat"
    savemat(path, content)
    return path


def test_a_trial_is_read_in_the_units_of_the_house(turning: Path) -> None:
    trial = broad.read(turning)
    assert (trial.name, trial.rate, len(trial.gyr)) == ("turning", RATE, N)
    assert np.linalg.norm(trial.mag[0]) == pytest.approx(48.5e-6, abs=0.1e-6)  # T
    assert trial.movement.sum() == N - 501


def test_a_fusion_without_errors_is_scored_near_zero_where_the_cameras_see_the_board(
    turning: Path,
) -> None:
    trial = broad.read(turning)
    error = broad.score(trial, broad.estimate_orientation(trial, (GYR, ACC, MAG), FusionParams()))
    assert len(error.total) == N - 501 - 100
    assert DEG * np.abs(error.heading).max() < 0.5
    assert DEG * error.inclination.max() < 0.1


def test_a_heading_that_is_ten_degrees_off_counts_as_heading(turning: Path) -> None:
    trial = broad.read(turning)
    q_GS = quat.multiply(quat.about(2, np.radians(10.0)), np.nan_to_num(trial.q_ref))
    error = broad.score(trial, q_GS)
    np.testing.assert_allclose(DEG * error.heading, 10.0, atol=1e-6)
    np.testing.assert_allclose(DEG * error.inclination, 0.0, atol=1e-4)


def test_missing_trials_are_named_with_where_to_get_them(tmp_path: Path) -> None:
    first = next(iter(published.BROAD))
    with pytest.raises(
        InputError,
        match=rf"10 of 10 trials of BROAD are not in .*first {first}.mat.*github.com/dlaidig/broad.*--broad-data",
    ):
        broad.trials(Wanted(broad_data=tmp_path))


def test_a_file_that_is_no_trial_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mat").write_bytes(b"not a MATLAB file at all" * 20)
    with pytest.raises(InputError, match="cannot be read as a trial of BROAD"):
        broad.read(tmp_path / "a.mat")
    savemat(tmp_path / "b.mat", {"imu_gyr": np.zeros((3, 3))})
    with pytest.raises(InputError, match=r"b\.mat has no imu_acc"):
        broad.read(tmp_path / "b.mat")
