"""The joint between two sensors is found where it is, with an honest standard deviation, whatever the sensors' seats."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from handscope.estimators.data.samples import ACC
from handscope.estimators.fault_detection.neighbours import common_joint, joint_windows
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
