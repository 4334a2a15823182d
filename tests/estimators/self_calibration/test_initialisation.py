"""Where self-calibration begins: headings that fusion turns away are followed."""

import numpy as np
import pytest

from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import initialisation
from handscope.estimators.self_calibration.problem import Noise, Z, axis_in_sensors
from tests.estimators.self_calibration.fingers import HINGED, readings, recorded

DRIFT = np.radians(0.6)  # rad/s, what fusion leaves of a gyroscope's bias


def _fitted(drift: float) -> tuple[Array, Array]:
    """The turn of the second sensor (n,), and both arms, where its heading was turned at so many rad/s."""
    recording = recorded(1, 60.0)
    read = readings(recording)
    q_GS = initialisation.fuse_sensors(read)
    q_GS[:, 1] = quat.turn_heading(q_GS[:, 1], drift * read.dt * np.arange(len(read)))
    flexing = axis_in_sensors(HINGED, recording.mounting, Z)
    _, turn, *arms = initialisation.fit_joint(Noise(), read, q_GS, 0, 1, flexing)
    return turn, np.concatenate(arms)


def test_a_heading_that_drifts_is_turned_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Within half of PART's drift and a step of headings."""
    (still, arms), (turn, same_arms) = _fitted(0.0), _fitted(DRIFT)
    drift = np.degrees(still - turn)
    expected = np.degrees(DRIFT) * np.linspace(0, 60.0, len(drift))
    off = (drift - expected + 180) % 360 - 180
    assert np.abs(off).max() < 8.0
    np.testing.assert_allclose(same_arms, arms, atol=5e-3)
    monkeypatch.setattr(initialisation, "PART", 1000.0)  # one heading for all
    assert np.abs(_fitted(DRIFT)[1] - arms).max() > 0.03
