"""Faults of the file: times, frozen and lost rows, units of accelerometers, magnetometers."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, MAG, ORIENTATION, Block, Stream
from handscope.estimators.fault_detection.single_sensors.accelerometer_check import negated_in_pose
from handscope.estimators.fault_detection.single_sensors.check_sensors import check_sensors
from handscope.estimators.fault_detection.single_sensors.frozen_rows import (
    frozen_stretches,
    repeated_sensors,
)
from handscope.estimators.fault_detection.single_sensors.lost_rows import lost_rows
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.simulation.magnetic_field import homogeneous
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors
from tests.estimators.fault_detection.joint_recordings import freely_moved
from tests.estimators.fault_detection.recordings import (
    by_matrix,
    frozen,
    moved_freely,
    performed,
    with_readings,
    without_rows,
)
from tests.simulated import pose_and_wiggle


def codes(blocks):
    return [s.message.code for s in check_sensors(blocks)]


def test_accelerometers_in_g_are_told_once():
    found = check_sensors(
        with_readings(performed("initial_pose", "rom_fist"), ACC, lambda a: a / GRAVITY)
    )
    assert [(s.message.code, s.message.values["unit"]) for s in found] == [
        ("file.accelerometer_unit", "g")
    ]


def test_dead_accelerometers_are_judged_without_a_warning() -> None:
    with warnings.catch_warnings(action="error"):
        found = codes(with_readings(performed("initial_pose", "rom_fist"), ACC, np.zeros_like))
    assert "file.accelerometer_unit" not in found


def test_one_accelerometer_that_reads_too_much_at_rest_is_named():
    found = check_sensors(
        with_readings(
            performed("initial_pose", "rom_fist"), ACC, by_matrix(1.15 * np.eye(3)), "thumb_distal"
        )
    )
    assert ("sensor.accelerometer_size", ("thumb_distal",)) in [
        (s.message.code, s.sensors) for s in found
    ]


@pytest.mark.parametrize(("factor", "unit"), [(1 / GRAVITY, "g"), (1000 / GRAVITY, "mg")])
def test_some_accelerometers_in_another_unit_are_named_once(factor: float, unit: str):
    blocks = performed("initial_pose", "rom_fist")
    for sensor in ("thumb_distal", "index_middle"):
        blocks = with_readings(blocks, ACC, lambda a: factor * a, sensor)
    found = [s for s in check_sensors(blocks) if "accelerometer" in s.message.code]
    assert [(s.message.code, set(s.sensors), s.message.values["unit"]) for s in found] == [
        ("sensor.accelerometer_unit", {"thumb_distal", "index_middle"}, unit)
    ]


def test_readings_that_stand_still_are_told_with_their_span():
    (found,) = check_sensors(frozen(moved_freely(), 8.0, 9.5))
    assert found.message.code == "file.frozen"
    np.testing.assert_allclose(found.spans, [(8.0, 9.49)], atol=0.02)


def test_fingers_of_a_recording_without_noise_rest_while_the_thumb_moves() -> None:
    assert frozen_stretches(list(pose_and_wiggle("left").blocks())) == []


@pytest.mark.parametrize("still", [("index_middle",), CHAINS["index"]])
def test_sensors_that_stand_still_while_others_go_on_are_named(still: tuple[str, ...]) -> None:
    blocks = []
    for block, stopped in zip(moved_freely(), frozen(moved_freely(), 8.0, 9.5)):
        held = np.isin(block.stream.sensors, still)[:, None]
        blocks.append(replace(block, values=np.where(held, stopped.values, block.values)))
    (found,) = check_sensors(blocks)
    assert (found.message.code, found.sensors) == ("sensor.frozen", still)
    np.testing.assert_allclose(found.spans, [(8.0, 9.49)], atol=0.02)


def test_a_strip_that_stands_still_is_named_beside_samples_that_are_lost() -> None:
    rng, blocks = np.random.default_rng(6), []
    for block, stopped in zip(moved_freely(), frozen(moved_freely(), 8.0, 9.5)):
        held = np.isin(block.stream.sensors, CHAINS["index"])
        values = np.where(held[:, None], stopped.values, block.values)
        lost = rng.random(len(block.t)) < 0.12
        values[np.ix_(lost, held)] = np.nan
        blocks.append(replace(block, values=values))
    (found,) = frozen_stretches(blocks)
    assert (found.message.code, found.sensors) == ("sensor.frozen", CHAINS["index"])
    np.testing.assert_allclose(found.spans, [(8.0, 9.49)], atol=0.05)


def test_a_coarse_sensor_that_rests_repeats_its_readings() -> None:
    """Gyroscope to 0.5 deg/s, accelerometer to 0.1 m/s^2."""
    steps = np.array([*3 * [np.radians(0.5)], *3 * [0.1]])
    blocks = [
        replace(
            b,
            values=np.round(b.values[..., :6] / steps) * steps,
            stream=replace(b.stream, quantities=(GYR, ACC)),
        )
        for b in performed("rest", "rom_fist", "rest")
        if b.stream.inertial
    ]
    assert frozen_stretches(blocks) == []


def test_a_rest_without_noise_is_no_frozen_stretch():
    made = simulate(
        ["rest", "rom_fist", "rest"], "left", sized("left"), np.random.default_rng(1), IDEAL
    )
    assert frozen_stretches(list(made.blocks())) == []


def test_a_sensor_without_noise_that_rests_throughout_is_judged_without_a_warning():
    made = simulate(["rest"], "left", sized("left"), np.random.default_rng(1), IDEAL)
    blocks = [
        replace(block, values=np.broadcast_to(block.values[:1], block.values.shape))
        for block in made.blocks()
    ]
    frozen_stretches(blocks)


def swinging(held: slice = slice(0)) -> list[Block]:
    """Orientations without noise of a hand that rests, swings twice and rests, one stretch held."""
    t = np.arange(0.0, 9.0, 0.01)
    moved = (t > 2) & (t < 6.1415)
    angle = np.where(moved, 1 - np.cos(np.pi * np.round(t - 2, 6) / 2.07075), 0.0)
    values = quat.about(2, angle)[:, None].repeat(3, axis=1)
    values[held] = values[held.start] if held.stop else values[held]
    stream = Stream("imu", ("hand", "index_proximal", "index_middle"), (ORIENTATION,), 100.0)
    return [Block(stream, t, values)]


def test_orientations_without_noise_that_come_to_rest_are_no_frozen_stretch():
    assert frozen_stretches(swinging()) == []


def test_orientations_that_stand_still_while_the_hand_swings_are_frozen():
    (found,) = frozen_stretches(swinging(slice(280, 330)))
    np.testing.assert_allclose(found.spans, [(2.8, 3.29)], atol=0.02)


def test_dropped_rows_are_found_where_they_were():
    (found,) = [
        s
        for s in check_sensors(without_rows(moved_freely(), 8.0, 9.5))
        if s.message.code == "file.lost_rows"
    ]
    assert abs(found.spans[0][0] - 8.0) < 0.03


def test_a_stop_that_takes_several_samples_is_no_loss():
    """As a wrist makes it at the end of its range: rates and accelerations go within 40 ms to where they are behind."""
    (block,) = without_rows(moved_freely(), 8.0, 9.5)
    row = int(np.searchsorted(block.t, 8.0))
    values, share = block.values.copy(), np.linspace(0.0, 1.0, 5)[:, None, None]
    values[row - 2 : row + 3] = (1 - share) * values[row - 2] + share * values[row + 2]
    assert lost_rows([block]) != []
    assert lost_rows([replace(block, values=values)]) == []


def with_two_fingers_that_move():
    """Of a hand that moves freely thumb and index finger; the other sensors sway a little."""
    (block,) = moved_freely()
    values = block.values.copy()
    for k, name in enumerate(block.stream.sensors):
        if not name.startswith(("thumb", "index")):
            mean = np.array([0.01, -0.01, 0.0, 2.0, 9.0, 3.3])
            values[:, k] = mean + 0.02 * (values[:, k] - values[:, k].mean(axis=0))
    return [replace(block, values=values)]


def test_rows_dropped_while_two_fingers_move_only_are_found():
    """Most sensors rest: gravity is elsewhere in those of thumb and index finger."""
    (found,) = lost_rows(without_rows(with_two_fingers_that_move(), 8.0, 9.5))
    assert abs(found.spans[0][0] - 8.0) < 0.03


def with_a_thumb_that_moves_level():
    """Of a hand at rest the thumb, whose sensors see gravity all the time alike."""
    (block,) = with_two_fingers_that_move()
    values, still = block.values.copy(), np.random.default_rng(3)
    for k, name in enumerate(block.stream.sensors):
        values[:, k, 3:] = [2.0, 9.0, 3.3] + 0.02 * still.normal(size=(len(block.t), 3))
        if not name.startswith("thumb"):
            values[:, k, :3] = 0.002 * still.normal(size=(len(block.t), 3))
    return [replace(block, values=values)]


def test_rows_dropped_while_a_thumb_moves_level_are_found_by_rates_alone():
    assert lost_rows(with_a_thumb_that_moves_level()) == []
    (found,) = lost_rows(without_rows(with_a_thumb_that_moves_level(), 8.0, 9.5))
    assert abs(found.spans[0][0] - 8.0) < 0.03


def test_a_thumb_that_something_stops_within_a_sample_is_no_loss():
    """Its sensors feel what stops them."""
    (block,) = without_rows(with_a_thumb_that_moves_level(), 8.0, 9.5)
    row, values = int(np.searchsorted(block.t, 8.0)), block.values.copy()
    thumb = [k for k, s in enumerate(block.stream.sensors) if s.startswith("thumb")]
    values[row, thumb, 3:] += 40.0
    assert lost_rows([replace(block, values=values)]) == []


def test_a_knock_while_two_fingers_move_is_no_loss():
    def knocked(a):
        a = a.copy()
        a[700:703] += [30.0, -20.0, 15.0]
        return a

    assert lost_rows(with_readings(with_two_fingers_that_move(), ACC, knocked)) == []


def test_a_gap_that_the_times_show_is_no_loss():
    blocks = [
        replace(b, t=b.t[rows := (b.t < 8.0) | (b.t >= 9.5)], values=b.values[rows])
        for b in moved_freely()
    ]
    assert lost_rows(blocks) == []


def test_a_knock_that_all_sensors_feel_is_no_loss():
    def knocked(a):
        a = a.copy()
        a[700:703] += [30.0, -20.0, 15.0]
        return a

    assert lost_rows(with_readings(moved_freely(), ACC, knocked)) == []


def test_times_that_run_back_are_told():
    block = moved_freely()[0]
    t = block.t.copy()
    t[500:] -= 0.5
    assert codes([replace(block, t=t)]) == ["file.time_runs_back"]


def test_accelerometers_that_are_all_negated_show_in_a_pose():
    up = np.tile([1.0, 0.0, 0.0], (5, 1))
    names = ("hand", "index_proximal", "index_middle", "index_distal", "thumb_distal")
    assert negated_in_pose(names, GRAVITY * up, up, (0.0, 3.0)) == []
    (found,) = negated_in_pose(names, -GRAVITY * up, up, (0.0, 3.0))
    assert found.message.code == "file.accelerometer_negated"


def test_a_magnetometer_with_a_wrong_sign_is_named():
    made = simulate(
        ["initial_pose", "rom"],
        "left",
        sized("left"),
        np.random.default_rng(4),
        SensorErrors(),
        field=homogeneous(),
    )
    blocks = list(made.blocks())
    assert check_sensors(blocks) == []
    mag = [b for b in blocks if MAG in b.stream.quantities]
    spoilt = [b for b in blocks if MAG not in b.stream.quantities] + with_readings(
        mag, MAG, by_matrix(np.diag([1.0, -1, 1])), "hand"
    )
    assert [(s.message.code, s.sensors) for s in check_sensors(spoilt)] == [
        ("sensor.magnetometer_axes", ("hand",))
    ]


def test_nothing_recorded_is_nothing_wrong():
    assert check_sensors([]) == []
    assert check_sensors([replace(b, t=b.t[:1], values=b.values[:1]) for b in moved_freely()]) == []


def test_movement_between_the_rows_of_a_slow_stream_is_no_loss():
    """A person whose quick movements step, at 33 Hz, as a loss does at 100 Hz."""
    blocks = freely_moved(110).blocks()
    slow = [replace(b, t=b.t[::3], values=b.values[::3]) for b in blocks]
    assert lost_rows(slow) == []


@pytest.mark.parametrize("quantity", [GYR, ACC])
def test_a_sensor_whose_columns_are_read_for_two_segments_is_told(quantity):
    def twice(block: Block) -> Block:
        values, names = block.values.copy(), block.stream.sensors
        to, of = names.index("index_middle"), names.index("index_distal")
        axes = block.stream.axes(quantity)
        values[:, to, axes] = values[:, of, axes]
        return replace(block, values=values)

    found = check_sensors([twice(b) for b in moved_freely()])
    assert found[0].message.code == "sensors.identical"
    assert found[0].sensors == ("index_middle", "index_distal")


def test_segments_that_turn_together_without_noise_are_no_copies():
    performed_by = ["rest", "tapping", "rest"]
    ideal = simulate(performed_by, "left", sized("left"), np.random.default_rng(1), IDEAL)
    assert repeated_sensors(list(ideal.blocks())) == []
