"""Gyroscopes that clip though no full scale is told: each at its own largest value, bridged; where nothing is found that is said to be why."""

from dataclasses import replace

import numpy as np
import pytest

from estimators.errors import InputError
from estimators.samples import Block
from estimators.self_calibration import recordings, steadiness, words
from estimators.self_calibration.findings import Asked
from estimators.self_calibration.recordings import DOUBTFUL
from estimators.self_calibration.solver import Solution
from tests.estimators.self_calibration.fingers import SEGMENTS, readings, recorded

LIMITS = {1: 250.0, 2: 150.0, 3: 190.0}  # deg/s by row


def clipped() -> Block:
    block = recorded(2, 16.0, skin=True).samples["imu"]
    values = block.values.copy()
    for row, limit in LIMITS.items():
        values[:, row, :3] = np.clip(values[:, row, :3], -np.radians(limit), np.radians(limit))
    return Block(replace(block.stream, full_scale={}), block.t, values)


def test_each_sensor_is_bridged_where_it_stands_at_its_own_largest_value() -> None:
    block = clipped()
    t, read = recordings.readings([block], SEGMENTS, 0.0, 16.0)
    at_limit = np.stack([np.isclose(np.abs(block.of("gyr")[:, k]).max(axis=1), np.radians(LIMITS.get(k, 1e9))) for k in range(4)], axis=1)
    assert (read.gyr_doubt[at_limit[: len(t)]] == DOUBTFUL).all()
    assert at_limit[:, 3].mean() > 0.2
    assert (read.gyr_doubt[:, 0] == 1.0).all()
    assert np.abs(np.degrees(read.gyr[:, 1])).max() < LIMITS[1] + 1e-6


def test_where_nothing_is_found_clipping_is_said_to_be_why(solved: Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steadiness, "slips", lambda found: [])
    read = readings(recorded(1, 16.0))
    often = read.gyr_doubt.copy()
    often[::4, 3] = DOUBTFUL
    lost, clipping = replace(solved, outcome="not converged"), replace(read, gyr_doubt=often)
    with pytest.raises(InputError, match=r"the gyroscope of index_distal was at its limit, or missing, in 25 % of the samples"):
        words.require_one_minimum(Asked(), "index", clipping, lost)
    with pytest.raises(InputError, match="did not come to an end"):
        words.require_one_minimum(Asked(), "index", read, lost)
    words.require_one_minimum(Asked(), "index", clipping, solved)
