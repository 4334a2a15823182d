"""The live meter is honest: it grows with movement, stays empty for what does not move, and promises nothing that self-calibration does not find."""

from dataclasses import replace

import numpy as np
import pytest

from estimators import joint_observability as meter
from estimators import quaternions as quat
from estimators.hand_anatomy import SEGMENT
from estimators.joint_observability import ObservabilityParams
from estimators.quaternions import Array
from tests.estimators.self_calibration.fingers import recorded

PARAMS = ObservabilityParams()
DT = 0.01


SENSORS = ("hand", "index_proximal", "index_middle", "index_distal")


def told(part: slice, before: int, behind: int) -> Array:
    """Information from a stretch of an artificial finger's sensors (hand, proximal, middle, distal)."""
    made = recorded(2, 16.0, skin=True)
    gyr = made.samples["imu"].of("gyr")[part]
    q_p, q_c = (made.truth.q_GS[part, SEGMENT[SENSORS[k]]] for k in (before, behind))
    return meter.information(PARAMS, gyr[:, before], gyr[:, behind], quat.relative(q_p, q_c), DT)


def test_the_joints_place_changes_the_acceleration_as_the_formula_says() -> None:
    t = np.arange(200) * 1e-4
    gyr = np.array([1.0, 2.0, -0.5]) * np.sin(7 * t)[:, None] + np.array([0.3, -1.0, 2.0])
    turning = np.gradient(gyr, 1e-4, axis=0)[100]

    def at(r: Array) -> Array:
        return np.cross(gyr[100], np.cross(gyr[100], r)) + np.cross(turning, r)

    np.testing.assert_allclose(meter._lever(gyr, 1e-4)[100], np.stack([at(e) for e in np.eye(3)], axis=1), atol=1e-9)


def test_information_of_stretches_adds_up_and_never_falls() -> None:
    halves = told(slice(200, 801), 1, 2), told(slice(800, 1401), 1, 2)
    sds = [meter.place_sd(PARAMS, np.zeros((6, 6))), meter.place_sd(PARAMS, halves[0]), meter.place_sd(PARAMS, halves[0] + halves[1])]
    assert sds[0] == pytest.approx(0.1)
    assert sds[0] > 20 * sds[1] > 20 * sds[2]
    np.testing.assert_allclose(halves[0] + halves[1], told(slice(200, 1401), 1, 2), rtol=0.02)


def test_two_sensors_on_one_stiff_piece_tell_nothing_of_a_joint_between_them() -> None:
    gyr = recorded(2, 16.0).samples["imu"].of("gyr")[200:1400, 1]
    stiff = meter.information(PARAMS, gyr, gyr, np.tile(quat.IDENTITY, (1200, 1)), DT)
    assert meter.place_sd(PARAMS, stiff) > 0.05
    seen = meter.observed(PARAMS, "index_pip", told(slice(200, 1400), 1, 2), np.full(1200, 0.02))
    assert (seen.excursion, seen.share) == (0.0, 0.0)


def test_missing_samples_tell_nothing_and_spoil_nothing() -> None:
    gyr = recorded(2, 16.0, skin=True).samples["imu"].of("gyr").copy()
    gyr[300:350] = np.nan
    q_pc = np.tile(quat.IDENTITY, (len(gyr), 1))
    found = meter.information(PARAMS, gyr[:, 1], gyr[:, 2], q_pc, DT)
    assert np.isfinite(found).all()
    assert found.any()
    assert not meter.information(PARAMS, gyr[:2, 1], gyr[:2, 2], q_pc[:2], DT).any()


def test_enough_is_said_only_of_a_joint_that_was_bent_and_placed() -> None:
    sure = np.eye(6) * 1e8
    half = meter.observed(PARAMS, "index_pip", sure, np.radians([0.0, 15.0]))
    whole = meter.observed(PARAMS, "index_pip", sure, np.radians(np.linspace(0.0, 40.0, 500)))
    assert (half.share, whole.share) == (pytest.approx(0.49, abs=0.02), 1.0)
    unsure = replace(PARAMS, enough=1e-4)
    assert meter.observed(unsure, "index_pip", np.eye(6), np.radians(np.linspace(0.0, 40.0, 500))).share < 0.01
