"""Gyroscopes with a fault, and right ones."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.samples import GYR
from handscope.estimators.fault_detection.single_sensors.check_sensors import check_sensors
from handscope.estimators.fault_detection.single_sensors.common_fault import beyond_the_others
from handscope.estimators.fault_detection.single_sensors.gyroscope_check import (
    GAINED,
    Judged,
    Verdict,
)
from handscope.estimators.fault_detection.single_sensors.gyroscope_faults import (
    SHARES,
    Fault,
    discrete_faults,
    share_of,
)
from handscope.estimators.fault_detection.single_sensors.significance import FALSE_ALARMS
from handscope.estimators.hand.anatomy import FINGERS
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator import daily_movements, free_movement
from tests.estimators.fault_detection.recordings import (
    by_matrix,
    moved_freely,
    performed,
    with_readings,
)

WRONG = {
    "sensor.gyroscope_sign": np.diag([1.0, -1.0, 1.0]),
    "sensor.gyroscope_negated": -np.eye(3),
    "sensor.gyroscope_exchange": np.eye(3)[[1, 0, 2]],
    "sensor.gyroscope_unit": np.degrees(1.0) * np.eye(3),
    "sensor.gyroscope_gain": 1.5 * np.eye(3),
}
OF_ALL = {
    "file.gyroscope_sign": np.diag([1.0, 1.0, -1.0]),
    "file.gyroscope_negated": -np.eye(3),
    "file.gyroscope_unit": np.radians(1.0) * np.eye(3),
}


@pytest.mark.parametrize(
    "tasks",
    [
        ("initial_pose", "rom_fist"),
        ("initial_pose", "tapping"),
        ("initial_pose", "reach"),
        ("rest",),
    ],
)
def test_nothing_is_said_of_right_sensors(tasks):
    assert check_sensors(performed(*tasks)) == []


def test_nothing_is_said_of_right_sensors_that_move_freely():
    assert check_sensors(moved_freely()) == []


@pytest.mark.parametrize("code", WRONG)
def test_the_fault_of_one_sensor_is_named_and_can_be_mended(code):
    spoilt = with_readings(moved_freely(), GYR, by_matrix(WRONG[code]), "ring_middle")
    (found,) = check_sensors(spoilt)
    assert (found.message.code, found.sensors) == (code, ("ring_middle",))
    assert found.p_value < FALSE_ALARMS and found.correction is not None
    mended = with_readings(
        spoilt, GYR, by_matrix(np.asarray(found.correction["gyr"])), "ring_middle"
    )
    assert check_sensors(mended) == []


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_gain_of_one_axis_is_named_where_all_three_turn(axis):
    wrong = by_matrix(np.diag(np.where(np.arange(3) == axis, 3.0, 1.0)))
    (found,) = check_sensors(with_readings(moved_freely(), GYR, wrong, "ring_middle"))
    assert found.message.code == "sensor.gyroscope_axis_gain"
    assert found.message.values["axis"] == "xyz"[axis]
    assert found.message.values["gain"] == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize(
    ("blocks", "sensor", "gains", "code"),
    [
        (moved_freely(), "index_middle", [1.0, 1.0, 1.5], "sensor.gyroscope_gain_somewhere"),
        (
            performed("initial_pose", "pronation_supination"),
            "index_proximal",
            [-1.0, 1.0, -1.0],
            "sensor.gyroscope_unclear",
        ),
    ],
)
def test_a_cause_that_the_movement_does_not_tell_is_left_open(blocks, sensor, gains, code):
    """The gain of one axis, which a gain of all explains nearly as well, and another sign where the hand turns about one axis only."""
    (found,) = check_sensors(with_readings(blocks, GYR, by_matrix(np.diag(gains)), sensor))
    assert (found.message.code, found.sensors) == (code, (sensor,))
    assert found.message.severity == "fault"


@pytest.mark.parametrize("code", OF_ALL)
def test_a_fault_that_all_sensors_share_is_told_once_of_the_file(code):
    (found,) = check_sensors(with_readings(moved_freely(), GYR, by_matrix(OF_ALL[code])))
    assert found.message.code == code and len(found.sensors) == 16


@pytest.mark.parametrize("told", [0.5, 0.9, 2.0])
def test_a_rate_told_wrong_is_a_fault_of_the_file(told):
    (found,) = check_sensors([replace(b, t=b.t / told) for b in moved_freely()])
    assert found.message.code == "file.rate"
    assert abs(float(found.message.values["factor"]) / told - 1) < 0.05


def test_a_sensor_is_found_wrong_beside_a_fault_of_all():
    spoilt = with_readings(
        with_readings(moved_freely(), GYR, by_matrix(-np.eye(3))),
        GYR,
        by_matrix(np.diag([-1.0, 1, 1])),
        "index_distal",
    )
    assert [s.message.code for s in check_sensors(spoilt)] == [
        "file.gyroscope_negated",
        "sensor.gyroscope_sign",
    ]


def test_a_fault_from_half_way_on_is_told_from_there_on():
    (found,) = check_sensors(
        with_readings(
            moved_freely(), GYR, by_matrix(np.diag([1.0, 1, -1])), "little_distal", since=10.0
        )
    )
    ((start, stop),) = found.spans
    assert (
        found.message.code == "sensor.gyroscope_sign" and abs(start - 10.0) <= 2.5 and stop > 19.0
    )


def sign_of(sensors, axis, blocks):
    """Recordings in which one axis of some gyroscopes has the wrong sign."""
    for sensor in sensors:
        wrong = by_matrix(np.diag([1.0 - 2.0 * (k == axis) for k in range(3)]))
        blocks = with_readings(blocks, GYR, wrong, sensor)
    return blocks


def test_what_sensors_of_several_strips_show_and_none_contradicts_is_said_once_of_all():
    """A rotation of all about the vertical hides the axis in those that do not turn about it."""
    blocks = performed("initial_pose", "open_close")
    mounted = [turned_mounting(b) for b in blocks]
    spoilt = with_readings(mounted, GYR, by_matrix(np.diag([1.0, 1.0, -1.0])))
    (found,) = check_sensors(spoilt)
    assert found.message.code == "file.gyroscope_sign"
    assert found.message.values["axis"] == "z" and "sensor" not in found.message.values
    assert len(found.sensors) == len(blocks[0].stream.sensors)


def turned_mounting(block):
    """The samples of sensors of which every other one sits turned by a right angle, so that it bends about another of its axes."""
    values = block.values.copy()
    for k in range(0, values.shape[1], 2):
        for first in (0, 3):
            values[:, k, first : first + 3] = values[:, k, first : first + 3][:, [2, 0, 1]]
    return replace(block, values=values)


@pytest.mark.parametrize("moved", [lambda: performed("initial_pose", "rom_fist"), moved_freely])
def test_a_fault_of_one_strip_is_not_said_of_all(moved):
    strip = ("ring_proximal", "ring_middle", "ring_distal")
    found = check_sensors(sign_of(strip, 2, moved()))
    assert [(s.message.code, s.sensors) for s in found] == [
        ("sensor.gyroscope_sign", (s,)) for s in strip
    ]


def test_a_hand_at_rest_tells_nothing_of_an_axis():
    assert (
        check_sensors(
            with_readings(performed("rest"), GYR, by_matrix(np.diag([-1.0, 1, 1])), "hand")
        )
        == []
    )


def test_the_shares_of_all_faults_sum_to_one():
    discrete = sum(share_of(f.code) for f in discrete_faults() if f.code)
    free = (
        SHARES["gyroscope_gain"]
        + SHARES["gyroscope_axis_gain"]
        + SHARES["gyroscope_delay"]
        + SHARES["gyroscope_matrix"]
    )
    assert abs(discrete + free - 1.0) < 1e-9


def test_every_order_and_sign_of_axes_is_looked_at_once():
    matrices = {
        tuple(np.rint(f.matrix).astype(int).ravel())
        for f in discrete_faults()
        if "unit" not in f.code
    }
    assert len(matrices) == 48


def test_what_an_accelerating_arm_does_to_every_sensor_is_no_fault_of_any():
    setup = free_movement.Setup(8058, hand="right", fingers=FINGERS, duration=24.0, missed=0.05)
    reaching, _ = write_and_load(setup, daily_movements.movement("reaching", setup))
    assert check_sensors(list(reaching.blocks())) == []


def test_evidence_counts_beyond_what_the_other_sensors_have():
    def judged(evidence):
        fault = Fault("gyroscope_gain", (("gain", 1.3),), 1.3 * np.eye(3))
        return Judged((Verdict(fault, (0, 4), evidence, 0.1),), 0.0)

    alike = [judged(e) for e in (9.0, 10.0, 11.0, 12.0, 12.0, 13.0)]
    assert max(v.evidence for j in beyond_the_others(alike) for v in j.verdicts) < 5.0
    *_, apart = beyond_the_others([*alike, judged(40.0)])
    assert apart.surest.evidence == pytest.approx(40.0 - 12.0 + GAINED)
    one_strip = [judged(40.0), judged(40.0), *[Judged((), 0.0)] * 6]
    assert beyond_the_others(one_strip) == one_strip
    assert beyond_the_others(alike[:5]) == alike[:5]
