"""Standard deviations where a method has none of its own."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.calibration import (
    Calibration,
    CalibrationSource,
    SensorQuality,
)
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.hand.anatomy import JOINT, JOINTS, SEGMENT
from handscope.estimators.hand.geometry import sized
from handscope.estimators.measures.accuracy import (
    ANGLE,
    ANGLE_UNPOSED,
    CMC,
    DEG,
    OWN,
    TIP,
    accuracy_of,
    with_sd,
)
from tests.estimators.measures.trajectories import made


def _calibration(tilt: float) -> Calibration:
    return Calibration(
        "left",
        sized("left"),
        0.0,
        3.0,
        {},
        {},
        {},
        CalibrationSource.OTHER_RECORDING,
        {"index_middle": SensorQuality(0.0, tilt, 0.0, 0.0)},
    )


def test_without_a_pose_a_default_is_the_methods_and_the_calibration_adds_its_tilt() -> None:
    moved, basis = with_sd(
        made(10), accuracy_of("m2", [_calibration(3 * DEG), _calibration(1 * DEG)])
    )
    assert moved.angles_sd is not None
    assert moved.tips_sd is not None
    assert "table6" in basis
    sd = moved.angles_sd[0, :, 0]
    assert sd[JOINT["ring_pip"]] == pytest.approx(ANGLE)
    assert sd[JOINT["thumb_cmc"]] == pytest.approx(CMC)
    assert (
        sd[JOINT["index_pip"]] == sd[JOINT["index_dip"]] == pytest.approx(np.hypot(ANGLE, 3 * DEG))
    )
    assert np.sqrt((moved.tips_sd[0, 1] ** 2).sum()) == pytest.approx(TIP)


def test_a_segment_without_a_pose_is_as_unsure_as_a_method_without_one() -> None:
    moved = made(10)
    moved.flags[:, SEGMENT["index_middle"]] = Flag.UNCALIBRATED
    known, _ = with_sd(moved, accuracy_of("m2"))
    assert known.angles_sd is not None
    assert known.angles_sd[0, JOINT["index_pip"], 0] == pytest.approx(ANGLE_UNPOSED)
    assert known.angles_sd[0, JOINT["ring_pip"], 0] == pytest.approx(ANGLE)


def test_a_methods_own_standard_deviations_stay() -> None:
    moved = replace(made(10), angles_sd=np.ones((10, len(JOINTS), 3)), tips_sd=np.ones((10, 5, 3)))
    assert with_sd(moved, accuracy_of("ekf")) == (moved, OWN)
