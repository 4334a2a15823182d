"""Gyroscopes that clip though no full scale is told: each at its own largest value, bridged; where nothing is found that is said to be why."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.errors import InputError
from handscope.estimators.self_calibration import messages as self_calibration_messages
from handscope.estimators.self_calibration import mounting_shift, sample_preparation
from handscope.estimators.self_calibration.result import Requirements
from handscope.estimators.self_calibration.sample_preparation import DOUBTFUL
from handscope.estimators.self_calibration.solver import Solution
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
    t, read = sample_preparation.prepare_readings([block], SEGMENTS, 0.0, 16.0)
    at_limit = np.stack(
        [
            np.isclose(np.abs(block.of("gyr")[:, k]).max(axis=1), np.radians(LIMITS.get(k, 1e9)))
            for k in range(4)
        ],
        axis=1,
    )
    np.testing.assert_allclose(read.gyr_doubt[at_limit[: len(t)]], DOUBTFUL, rtol=1e-9)
    assert at_limit[:, 3].mean() > 0.2
    np.testing.assert_allclose(read.gyr_doubt[:, 0], 1.0, rtol=1e-9)
    assert np.abs(np.degrees(read.gyr[:, 1])).max() < LIMITS[1] + 1e-6


@pytest.mark.parametrize("rate", [50.0, 130.0, 200.0, 1000.0])
def test_turns_of_a_second_are_as_uncertain_at_every_rate(rate: float) -> None:
    """Noise of one density is made: what is left of it in a second is what doubt says against 100 Hz."""
    t = np.arange(int(400 * rate)) / rate
    noise = np.sqrt(rate / 100) * np.random.default_rng(5).normal(size=(len(t), 1, 6))
    stream = Stream("imu", ("hand",), (GYR, ACC), rate, "imu", {GYR: 100.0, ACC: 100.0})
    _, read = sample_preparation.prepare_readings([Block(stream, t, noise)], ("hand",), 0.0, 400.0)
    each = round(1 / read.dt)
    for values, doubt in ((read.gyr, read.gyr_doubt), (read.acc, read.acc_doubt)):
        seconds = values[: len(values) // each * each].reshape(-1, each, 3).sum(axis=1) / np.sqrt(
            each
        )
        np.testing.assert_allclose(np.sqrt(np.mean(seconds**2)), doubt[0, 0], rtol=0.05)


@pytest.mark.parametrize("rate", [100.0, 200.0, 1000.0])
def test_a_movement_is_read_alike_at_every_rate_and_from_a_clock_of_its_own(rate: float) -> None:
    """5 Hz, as fast fingers have: means as they come would be up to 0.4 % too small, straight lines between samples 1.2 %."""
    streams = {"imu": ("hand", rate, 0.0), "forearm": ("forearm", 100.0, 0.0037)}
    blocks = []
    for name, (sensor, own, late) in streams.items():
        t = np.arange(int(3 * own)) / own + late
        stream = Stream(name, (sensor,), (GYR, ACC), own, name, {GYR: 100.0, ACC: 100.0})
        blocks.append(Block(stream, t, np.repeat(np.sin(10 * np.pi * t)[:, None, None], 6, axis=2)))
    t, read = sample_preparation.prepare_readings(blocks, ("hand", "forearm"), 0.0, 3.0)
    inside = slice(3, -3)
    for values in (read.gyr, read.acc):
        np.testing.assert_allclose(values[inside, 0, 0], np.sin(10 * np.pi * t)[inside], atol=2e-4)
        np.testing.assert_allclose(values[inside, 1, 0], np.sin(10 * np.pi * t)[inside], atol=7e-4)


@pytest.mark.parametrize("scattered", ["stamps", "samples"])
def test_stamps_that_scatter_are_put_right_where_the_samples_do_not_scatter(scattered: str) -> None:
    """20 s of a lively sensor, half a second of it lost: the rates themselves say which it is."""
    rng, stream = np.random.default_rng(4), Stream("imu", ("hand",), (GYR, ACC), 100.0)
    even = np.delete(np.arange(2000) / 100.0, np.s_[700:750])
    stamps = even + np.clip(2e-3 * rng.standard_normal(len(even)), -4e-3, 4e-3)
    taken = even if scattered == "stamps" else stamps
    values = 3 * np.sin(
        2 * np.pi * np.array([0.4, 0.7, 1.1, 0.5, 0.9, 1.3]) * taken[:, None]
    ) + 0.002 * rng.standard_normal((len(even), 6))
    found = sample_preparation.resample_uniform(Block(stream, stamps, values[:, None])).t
    np.testing.assert_allclose(found, taken, atol=2e-4 if scattered == "stamps" else 0.0)


def test_where_nothing_is_found_clipping_is_said_to_be_why(
    solved: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mounting_shift, "find_mounting_shifts", lambda *others: [])
    read = readings(recorded(1, 16.0))
    often = read.gyr_doubt.copy()
    often[::4, 3] = DOUBTFUL
    lost, clipping = replace(solved, outcome="not converged"), replace(read, gyr_doubt=often)
    with pytest.raises(
        InputError,
        match=r"the gyroscope of index_distal was at its limit, or missing, in 25 % of the samples",
    ):
        self_calibration_messages.require_one_minimum(Requirements(), "index", clipping, lost)
    with pytest.raises(InputError, match="did not come to an end"):
        self_calibration_messages.require_one_minimum(Requirements(), "index", read, lost)
    self_calibration_messages.require_one_minimum(Requirements(), "index", clipping, solved)
