"""Gyroscopes that clip although no full scale is declared: told by every check, by one message."""

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.hand.geometry import measures_from, sized
from handscope.estimators.recording_checks.check import suspicions_of
from handscope.estimators.recording_checks.clipped_gyroscopes import clipped_gyroscopes
from handscope.sessions.files.recording import LoadedRecording

SENSORS = ("hand", "index_proximal")


def _turning(limit_deg: float, clipped: int = len(SENSORS)) -> Block:
    """Two sensors (3 s of rest, then 12 s) that turn to and fro by up to 400 deg/s; `clipped` of them read no more than a limit."""
    rng, t = np.random.default_rng(5), 0.01 * np.arange(1500)
    fast = np.where(t > 3, 400 * np.sin(2 * np.pi * 1.1 * (t - 3)), 0.0)
    gyr = np.radians(fast[:, None, None] * [[0.1, 0.2, 0.9], [0.2, 0.1, 0.95]])
    gyr = gyr + 0.002 * rng.normal(size=gyr.shape)
    gyr[:, :clipped] = np.clip(gyr[:, :clipped], *np.radians([-limit_deg, limit_deg]))
    acc = [9.81, 0.0, 0.0] + 0.02 * rng.normal(size=gyr.shape)
    return Block(Stream("imu", SENSORS, (GYR, ACC), 100.0), t, np.concatenate([gyr, acc], axis=2))


@pytest.mark.parametrize("clipped", [1, 2])
def test_gyroscopes_that_repeat_a_reading_and_never_exceed_it_are_told_together(
    clipped: int,
) -> None:
    block = _turning(250.0, clipped)
    recording = LoadedRecording("left", sized("left", measures_from({})), {}, {"imu": block}, ())
    (found,) = (s for s in suspicions_of(recording) if s.message.code.startswith("sensors.gyro"))
    assert found.sensors == SENSORS[:clipped]
    assert found.message.values["limit_deg"] == pytest.approx(250.0)
    assert found.spans[0][0] == pytest.approx(3.1, abs=0.1)


def test_gyroscopes_within_their_range_are_not_told() -> None:
    assert clipped_gyroscopes([_turning(2000.0)]) == []
