"""One movement between two rests: gravity arrives where the accelerometer sees it, or the gyroscope is at fault."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.fault_detection.single_sensors.cells import cells_of
from handscope.estimators.fault_detection.single_sensors.check_sensors import check_sensors
from handscope.estimators.fault_detection.single_sensors.rest_turns import find, without_bias
from handscope.estimators.fault_detection.single_sensors.significance import FALSE_ALARMS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array

NAMES = ("hand", "index_proximal", "index_middle", "index_distal")
BENT = np.radians([0.0, 25.0, 50.0, 65.0])  # of each sensor about AXIS, from rest to rest
RIGHT = np.eye(3)
AXIS = np.array([2.0, 1.0, 0.5]) / np.sqrt(5.25)


def bent_once(
    wrong: Array = RIGHT, sensor: str = "index_middle", tremor: float = 0.0, bias: float = 0.014
) -> list[Block]:
    """Ten seconds in which a finger bends once, in two seconds, and rests else; noise and biases of a usual sensor, its gyroscope's a standard deviation of `bias` rad/s."""
    rng, t = np.random.default_rng(2), np.arange(1000) / 100.0
    share = np.clip((t - 4.0) / 2.0, 0.0, 1.0)
    angle = (share**3 * (10 - 15 * share + 6 * share**2))[:, None] * BENT
    angle = angle + tremor * np.sin(2 * np.pi * 5.5 * t)[:, None]
    rate = np.gradient(angle, t, axis=0)[..., None] * AXIS
    q_start = quat.normalize(rng.normal(size=(len(NAMES), 4)))
    q = quat.multiply(q_start, quat.exp(angle[..., None] * AXIS))
    acc = quat.rotate(quat.conjugate(q), np.array([0.0, 0.0, GRAVITY]))
    rate[:, NAMES.index(sensor)] = rate[:, NAMES.index(sensor)] @ wrong.T
    rate = rate + bias * rng.normal(size=(len(NAMES), 3)) + 0.001 * rng.normal(size=rate.shape)
    acc = acc + 0.1 * rng.normal(size=(len(NAMES), 3)) + 0.01 * rng.normal(size=acc.shape)
    stream = Stream("imu", NAMES, (GYR, ACC), 100.0)
    return [Block(stream, t, np.concatenate([rate, acc], axis=2))]


def test_a_right_gyroscope_turns_gravity_to_the_next_rest() -> None:
    assert check_sensors(bent_once()) == []
    cells = cells_of(bent_once())
    turns = find(cells, np.ones(4, bool))
    assert len(turns) == 3  # the hand rests all the time
    assert max(t.off for t in turns) < np.radians(3.0)


@pytest.mark.parametrize("bias", np.radians([3.0, 6.0]))
def test_a_gyroscope_that_nobody_calibrated_is_right_and_a_wrong_one_is_found(bias: float) -> None:
    assert check_sensors(bent_once(bias=bias)) == []
    (found,) = check_sensors(bent_once(np.diag([-1.0, 1.0, 1.0]), bias=bias))
    assert found.sensors == ("index_middle",)


def test_the_bias_is_known_of_a_sensor_whose_accelerometer_is_badly_calibrated() -> None:
    (block,) = bent_once(bias=0.0)
    values = block.values.copy()
    values[:, 1, :3] += [0.18, 0.0, -0.1]
    values[:, 1, 3:] *= 0.93
    cells = without_bias(cells_of([replace(block, values=values)]))
    np.testing.assert_allclose(cells.gyr[:100, 1].mean(axis=0), 0.0, atol=0.01)


@pytest.mark.parametrize(
    "wrong", [np.diag([-1.0, 1.0, 1.0]), -np.eye(3), np.eye(3)[[1, 0, 2]], 1.6 * np.eye(3)]
)
def test_one_movement_is_enough_to_doubt_a_gyroscope(wrong: Array) -> None:
    (found,) = check_sensors(bent_once(wrong))
    assert found.sensors == ("index_middle",) and found.p_value < FALSE_ALARMS
    assert found.message.code.startswith("sensor.gyroscope_") and found.message.severity == "fault"


def test_a_hand_that_trembles_rests_where_it_is_on_average() -> None:
    tremor = np.radians(1.5)
    assert check_sensors(bent_once(tremor=tremor)) == []
    assert len(find(cells_of(bent_once(tremor=tremor)), np.ones(4, bool))) >= 3
    found = check_sensors(bent_once(np.diag([-1.0, 1.0, 1.0]), tremor=tremor))
    assert [s.sensors for s in found] == [("index_middle",)]


def test_what_has_no_name_is_said_with_the_two_rests() -> None:
    (found,) = check_sensors(bent_once(1.6 * np.eye(3)))
    assert found.message.code == "sensor.gyroscope_rests"
    assert 2.0 < float(found.message.values["start"]) < 4.2
    assert 5.8 < float(found.message.values["stop"]) < 8.0
    assert (
        15.0 < float(found.message.values["off_deg"]) < 31.0
    )  # 30 deg too far, gravity inclined to the axis


def test_chance_is_as_rare_as_it_is_said_to_be() -> None:
    """Of directions that err by REST_SD, a pair passes p in a share of p of all cases."""
    from handscope.estimators.fault_detection.single_sensors.rest_turns import REST_SD

    rng = np.random.default_rng(1)
    off = np.hypot(*(np.sqrt(2) * REST_SD * rng.normal(size=(2, 200_000))))
    p = np.exp(-0.5 * (off / (np.sqrt(2) * REST_SD)) ** 2)
    assert np.mean(p < 0.01) == pytest.approx(0.01, rel=0.1)


def test_a_long_way_without_a_rest_tells_nothing_of_a_gain() -> None:
    (block,) = bent_once(1.3 * np.eye(3))
    shaken = block.values.copy()
    swing = 8.0 * np.sin(2 * np.pi * 2.0 * block.t) * ((block.t > 4.0) & (block.t < 6.0))
    shaken[:, 2, :3] += swing[:, None] * np.array([0.0, 0.0, 1.0])
    turns = find(cells_of([Block(block.stream, block.t, shaken)]), np.arange(4) == 2)
    assert all(t.p_value > FALSE_ALARMS for t in turns)


def test_a_sensor_that_creeps_while_it_seems_to_rest_is_right() -> None:
    rng, t = np.random.default_rng(4), np.arange(3000) / 100.0
    creeps, moves = (t > 12.0) & (t < 24.0), (t > 14.0) & (t < 22.0)
    turns = np.where(moves, np.radians(30.0) * np.sin(0.5 * np.pi * (t - 14.0)), 0.0)
    rate = np.where(creeps & ~moves, np.radians(3.7), turns)
    q = quat.exp(np.cumsum(rate)[:, None] / 100.0 * AXIS)
    acc = quat.rotate(quat.conjugate(q), np.array([0.0, GRAVITY, 0.0]))[:, None]
    gyr = (rate[:, None] * AXIS)[:, None] + 0.001 * rng.normal(size=(len(t), 1, 3))
    values = np.concatenate([gyr, acc + 0.01 * rng.normal(size=acc.shape)], axis=2)
    cells = cells_of([Block(Stream("imu", ("hand",), (GYR, ACC), 100.0), t, values)])
    (turn,) = find(cells, np.ones(1, bool))
    assert turn.p_value > 0.01
