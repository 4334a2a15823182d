"""A whole recording: backwards before the first pose, one calibration after the other."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data import trajectory
from handscope.estimators.data.samples import Block
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import m2
from handscope.estimators.pipeline import run
from handscope.estimators.simulation.scenario import Simulated, simulate
from handscope.estimators.simulation.sensors import IDEAL
from tests.simulated import (
    DEG,
    INSTANT,
    STRIPS,
    Samples,
    assert_same,
    calibrated,
    in_strips,
    pose_and_wiggle,
    tracked,
)


def _wiggle_first() -> Simulated:
    return simulate(
        ["wiggle", "initial_pose"],
        "left",
        sized("left"),
        np.random.default_rng(5),
        IDEAL,
        rate=100.0,
        forearm_rate=60.0,
    )


def test_what_lies_before_the_pose_is_recovered_backwards() -> None:
    recording = _wiggle_first()
    moved = tracked(recording)
    assert calibrated(recording).t > 9.0
    np.testing.assert_array_equal(moved.t, recording.truth.t)
    assert np.nanmax(np.abs(moved.angles - recording.truth.angles)) < 0.15 * DEG
    assert np.abs(moved.tips - recording.truth.tips).max() < 0.15e-3


def test_backwards_a_bias_has_the_other_sign() -> None:
    recording = _wiggle_first()
    biased = {}
    for name, block in recording.samples.items():
        values = block.values.copy()
        values[..., :3] += 2 * DEG * np.array([1.0, -0.5, 0.7])
        biased[name] = Block(block.stream, block.t, values)
    moved = tracked(
        replace(recording, samples=biased), replace(INSTANT, rest_bias=False, motion_bias=False)
    )
    assert np.nanmax(np.abs(moved.angles - recording.truth.angles)) < 0.15 * DEG


def test_every_sample_of_the_reference_makes_one_row_and_order_is_kept() -> None:
    moved = tracked(in_strips("left"))
    np.testing.assert_array_equal(moved.t, in_strips("left").samples["hand"].t)


def test_each_calibration_serves_until_the_next() -> None:
    recording = simulate(
        ["initial_pose", "wiggle", "initial_pose"],
        "left",
        sized("left"),
        np.random.default_rng(5),
        IDEAL,
    )
    events = [e for e in recording.events if e.trial_type == "initial_pose"]
    blocks, params = list(recording.samples.values()), INSTANT
    both = [
        initial_pose.calibrate(
            params, "left", recording.geometry, {}, blocks, initial_pose.pose_of(e)
        )
        for e in events
    ]
    moved = trajectory.join(list(run.run(m2, params, both, recording)), "left")
    alone = trajectory.join(list(run.run(m2, params, both[:1], recording)), "left")
    np.testing.assert_array_equal(moved.t, recording.truth.t)
    second = moved.t >= both[1].t
    assert_same(moved.between(-np.inf, both[1].t), alone.between(-np.inf, both[1].t))
    assert not np.array_equal(moved.q_GS[second], alone.q_GS[second])
    assert np.nanmax(np.abs(moved.angles - recording.truth.angles)) < 0.15 * DEG


def test_empty_blocks_and_streams_without_samples_change_nothing() -> None:
    recording = pose_and_wiggle("left")
    blocks = list(recording.blocks())
    nothing = [b.between(1e9, 2e9) for b in blocks]
    params, found = INSTANT, calibrated(recording)
    padded = Samples(recording.streams, (*nothing, *blocks, *nothing))
    assert_same(
        trajectory.join(list(run.run(m2, params, [found], padded)), "left"), tracked(recording)
    )


def test_strips_and_one_big_stream_give_the_same_bits() -> None:
    assert set(in_strips("left").samples) == set(STRIPS)
    assert_same(tracked(in_strips("left")), tracked(pose_and_wiggle("left")))


def test_backwards_mean_rates_turn_from_the_sample_behind() -> None:
    """Gyroscopes that read the mean since the sample before: exact both ways, up to the pose and from it on."""
    recording = _wiggle_first()
    averaged = {}
    for name, block in recording.samples.items():
        values = block.values.copy()
        values[1:, :, :3] = 0.5 * (block.values[1:, :, :3] + block.values[:-1, :, :3])
        averaged[name] = Block(block.stream, block.t, values)
    moved = tracked(replace(recording, samples=averaged), replace(INSTANT, gyr_reading="mean"))
    assert np.nanmax(np.abs(moved.angles - recording.truth.angles)) < 0.15 * DEG


@pytest.mark.parametrize("gyr_reading", ["instant", "mean"])
def test_what_lies_before_the_pose_may_be_cut_anywhere(gyr_reading: str) -> None:
    recording = _wiggle_first()
    params, found = replace(INSTANT, gyr_reading=gyr_reading), calibrated(recording)
    whole = tuple(recording.samples.values())
    edges = [-np.inf, 0.013, 2.5, 2.51, 7.0, np.inf]
    cut = tuple(b.between(*span) for span in zip(edges, edges[1:]) for b in whole)
    made = [
        trajectory.join(run.run(m2, params, [found], Samples(recording.streams, blocks)), "left")
        for blocks in (whole, cut)
    ]
    assert_same(*made)
