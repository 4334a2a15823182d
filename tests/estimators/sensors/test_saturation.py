"""Full scales found from what clips, and clipped rates bridged although the recording does not tell
its full scale."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import process
from handscope.estimators.sensors import saturation
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import IDEAL
from tests.simulated import DEG, INSTANT, with_samples

STREAM = Stream("imu", ("hand", "index_distal"), (GYR, ACC), 100.0)


def _block(rate: np.ndarray) -> Block:
    """A sensor that rests and one that turns at `rate` rad/s about x; noise makes every value its
    own."""
    values = np.random.default_rng(2).normal(0, 1e-3, (len(rate), 2, 6))
    values[:, 1, 0] += rate
    return Block(STREAM, np.arange(len(rate)) / 100.0, values)


def _swinging(peak: float) -> np.ndarray:
    return np.radians(peak) * np.sin(2 * np.pi * 2.0 * np.arange(500) / 100.0)


@pytest.mark.parametrize("limit", [150.0, 500.0, 1870.0])
def test_equal_largest_readings_in_a_row_are_a_limit(limit: float) -> None:
    block = _block(_swinging(1.5 * limit))
    clipped = replace(block, values=np.clip(block.values, -np.radians(limit), np.radians(limit)))
    assert saturation.find_full_scales([clipped]) == {
        "imu": {GYR: pytest.approx(np.radians(limit))}
    }
    np.testing.assert_allclose(saturation.find_limits(clipped, GYR), [np.inf, np.radians(limit)])


def test_single_clipped_peaks_are_a_limit_near_a_usual_full_scale_only() -> None:
    for peak, seen in ((2000.0, True), (1700.0, False)):
        block = _block(_swinging(0.8 * peak))
        block.values[[50, 150, 250], 1, 0] = np.radians(peak)
        assert bool(saturation.find_full_scales([block])) is seen


def test_what_does_not_clip_has_no_limit() -> None:
    assert saturation.find_full_scales([_block(_swinging(1990.0))]) == {}
    assert np.isinf(saturation.find_limits(_block(_swinging(1990.0)), ACC)).all()


def test_coarse_readings_that_repeat_at_the_top_of_a_peak_are_no_limit() -> None:
    step = np.radians(2000.0 / 2**15)
    rate = step * np.round(_swinging(260.0)[:500] / step)
    rate[[150, 151, 152]] = rate.max() + step  # as a peak is at 200 Hz
    block = _block(np.zeros(500))
    block.values[:, 1, 0] = rate
    assert saturation.find_full_scales([block]) == {}


def test_clipped_rates_are_bridged_as_if_the_full_scale_were_declared() -> None:
    made = simulate(
        ("initial_pose", "tapping"), "left", sized("left"), np.random.default_rng(4), IDEAL
    )
    block = made.samples["imu"]
    limit = 0.9 * np.abs(block.of(GYR)).max()
    assert limit > np.radians(240.0)
    values = block.values.copy()
    values[..., :3] = np.clip(values[..., :3], -limit, limit)
    untold, declared = (
        with_samples(
            made,
            {
                **made.samples,
                "imu": Block(replace(block.stream, full_scale=scale), block.t, values),
            },
        )
        for scale in ({}, {GYR: limit})
    )
    moved, reference = (process(m2, INSTANT, r).trajectory for r in (untold, declared))
    np.testing.assert_array_equal(moved.angles, reference.angles)
    assert ((moved.flags & Flag.SATURATED) != 0).any()
    assert np.nanmax(np.abs(moved.angles - made.truth.angles)) < 2.0 * DEG


def test_samples_tell_what_was_found_and_keep_what_they_told() -> None:
    block = _block(_swinging(750.0))
    clipped = replace(
        block,
        values=np.clip(block.values, -np.radians(500.0), np.radians(500.0)),
        stream=replace(STREAM, full_scale={ACC: 78.0}),
    )
    (declared,) = saturation.declare_full_scales({"imu": clipped}).values()
    assert declared.stream.full_scale == {ACC: 78.0, GYR: pytest.approx(np.radians(500.0))}
    assert declared.at_limit(GYR)[:, 1].mean() > 0.3
