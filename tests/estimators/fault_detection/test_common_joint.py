"""The joint between two sensors is found where it is, with an honest standard deviation, whatever the sensors' seats."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.fault_detection.neighbours import common_joint, joint_windows, slips
from handscope.estimators.fault_detection.neighbours.other_joints import Others
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from tests.estimators.fault_detection.joint_recordings import freely_moved


def pairs(acc_bias: Mapping[str, Array] = {}) -> Pairs:
    blocks = []
    for block in freely_moved().blocks():
        values = block.values.copy()
        for sensor in set(acc_bias) & set(block.stream.sensors):
            values[:, block.stream.sensors.index(sensor), block.stream.axes(ACC)] += acc_bias[
                sensor
            ]
        blocks.append(replace(block, values=values))
    series = joint_windows.common_series(blocks, {})
    assert series is not None
    return Pairs(series, sized("left"), dict.fromkeys(series.sensors, quat.IDENTITY))


def test_the_joint_lies_where_the_simulator_put_it() -> None:
    worn = freely_moved().sensors
    k = worn.segments.index("index_proximal")
    joint = pairs().joint("index_proximal", "index_middle")
    true = quat.rotate(
        quat.conjugate(worn.q_BS[k]), -worn.p_BS[k]
    )  # the segment's origin is its distal joint
    np.testing.assert_allclose(
        joint.place[:2], true[:2], atol=4e-3
    )  # along the hinge it is not determined


def test_unrelated_sensors_leave_far_more_than_neighbours() -> None:
    p = pairs()
    near, far = p.joint("index_proximal", "index_middle"), p.joint("index_proximal", "ring_middle")
    assert np.median(far.rest) > 20 * np.median(near.rest)


def test_a_region_holds_the_joint() -> None:
    p = pairs()
    region = p.expected("index_middle", "index_distal", ("index_middle", "index_distal"))
    far = common_joint.Region(region.centre + 0.05, np.array([0.01, 0.01]))
    couple = p.couple("index_middle", "index_distal")
    found = common_joint.fit(couple, np.ones(len(couple.noise)), far)
    assert (np.linalg.norm((found.place - far.centre).reshape(2, 3), axis=1) <= 0.0101).all()


def test_what_a_joint_leaves_hardly_grows_with_a_large_bias_of_either_accelerometer() -> None:
    joint = ("hand", "ring_proximal")  # which turn against each other, and so do their biases
    plain = pairs().joint(*joint)
    for sensor in joint:
        biased = pairs({sensor: np.array([0.5, -0.3, 0.2])}).joint(*joint)
        assert biased.rest.mean() < 2 * plain.rest.mean()


def keystrokes(lost: bool) -> list[Block]:
    """A middle phalanx that strikes twice a second on a proximal one that rocks; a radio loses four samples of every other stroke."""
    t = np.arange(0.0, 20.0, 0.01)
    after = np.mod(t, 0.5) - 0.25  # s, from the middle of a stroke
    angle = np.radians(40.0) * np.exp(-0.5 * (after / 0.025) ** 2)
    rock = np.radians(20.0) * np.sin(2 * np.pi * 0.7 * t)
    values = np.zeros((len(t), 2, 6))
    for k, turned in enumerate((rock, rock + angle)):
        rate = np.gradient(turned, t, edge_order=2)
        x, y = (0.0, 0.02) if k == 0 else (0.0, -0.012)  # m, of the joint from the sensor
        change = np.gradient(rate, t, edge_order=2)
        values[:, k, 2] = rate
        # specific force of the joint, less what the arm from the sensor to it adds
        values[:, k, 3] = 9.81 * np.cos(turned) - (-change * y - rate**2 * x)
        values[:, k, 4] = -9.81 * np.sin(turned) - (change * x - rate**2 * y)
    if lost:
        gone = (np.abs(np.mod(t, 1.0) - 0.27) < 0.018) & (t > 1.0)
        values[gone] = np.nan
    stream = Stream("imu", ("index_proximal", "index_middle"), (GYR, ACC), 100.0)
    return [Block(stream, t, values)]


def test_samples_that_are_lost_within_a_stroke_are_no_misfit() -> None:
    left = {}
    for lost in (False, True):
        series = joint_windows.common_series(keystrokes(lost), {})
        assert series is not None
        p = Pairs(series, sized("left"), dict.fromkeys(series.sensors, quat.IDENTITY))
        joint, use = p.joint("index_proximal", "index_middle"), p.use(*p.joints[0])
        assert np.count_nonzero(use) > 10
        left[lost] = float(np.median((joint.rest / joint.noise)[use]))
    assert left[True] < max(2 * left[False], 0.1)


def test_no_spline_bridges_a_sample_that_is_cut_off() -> None:
    """One lost sample is bridged; one at the limit read more than anything beside it."""
    (block,) = keystrokes(lost=False)
    values, row = block.values.copy(), 1003
    values[row, 0, block.stream.axes(ACC)] = [100.0, 0.0, 0.0]
    for full_scale, is_bridged in (({ACC: 100.0}, False), ({}, True)):
        stream = replace(block.stream, full_scale=full_scale)
        series = joint_windows.common_series([replace(block, stream=stream, values=values)], {})
        assert series is not None
        beside = np.abs(series.t - block.t[row]) < 0.009
        assert (series.whole[beside, 0] == is_bridged).all()
        assert series.whole[beside, 1].all()


def test_of_a_window_the_longest_piece_without_a_gap_counts() -> None:
    whole = np.ones((3, 25), bool)
    whole[1, [6, 20]] = False  # leaves instants 7 to 19
    whole[2, [4, 9, 14, 19]] = False  # four at most in a row
    weight = joint_windows.longest_pieces(whole)
    np.testing.assert_array_equal(weight[0], 1.0)
    np.testing.assert_array_equal(np.flatnonzero(weight[1]), np.arange(7, 20))
    assert (weight[1] ** 2).mean() == pytest.approx(1.0)
    assert not weight[2].any()


def test_what_is_between_samples_counts_as_noise_where_they_are_few() -> None:
    (block,) = keystrokes(lost=False)
    doubt = {}
    for step in (1, 2):
        sampled = replace(block, t=block.t[::step], values=block.values[::step])
        series = joint_windows.common_series([sampled], {})
        assert series is not None
        p = Pairs(series, sized("left"), dict.fromkeys(series.sensors, quat.IDENTITY))
        couple = p.couple("index_proximal", "index_middle")
        doubt[step] = float(np.median(couple.doubt))
        assert couple.noise.min() > (common_joint.ARM * couple.doubt.min()) ** 2
    assert doubt[1] < 0.01 * float(np.median(couple.turning))
    assert doubt[2] > 8 * doubt[1]  # errors go by the cube of the interval


def test_strokes_that_are_hardly_sampled_are_no_turn_of_a_sensor() -> None:
    """Two strokes a second of its neighbour leave much at three instants each, where nothing tells what happened between samples; the same left elsewhere would be a turn."""
    (block,) = keystrokes(lost=False)
    sampled = replace(block, t=block.t[::2], values=block.values[::2])
    series = joint_windows.common_series([sampled], {})
    assert series is not None
    p = Pairs(series, sized("left"), dict.fromkeys(series.sensors, quat.IDENTITY))
    window = slips._Window.of(p, Others(p), "index_proximal", 9)
    assert window is not None
    strokes = np.isin(np.arange(25), [5, 6, 7, 17, 18, 19])
    still, turned = np.where(strokes, 20.0, 0.3), np.full(25, 0.3)
    assert window.log_ratio(still, turned) < slips.CONVINCING
    assert window.log_ratio(np.roll(still, 6), turned) > slips.CONVINCING
