"""Rates of what moves together: a late sensor or strip is named with its lag, fingers that drum or tremble are not."""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.fault_detection.neighbours import check_neighbours as neighbours
from handscope.estimators.fault_detection.neighbours.rates import synchrony
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.movements import task_performance as tasks
from handscope.estimators.simulation.scenario import Simulated, simulate_performances
from handscope.estimators.simulation.sensors import SensorErrors
from tests.estimators.fault_detection.joint_recordings import delayed, delayed_from

GEOMETRY = sized("left")


@cache
def done(task: str) -> Simulated:
    """A task by a hand that rests."""
    performed = [tasks.TASKS[name](GEOMETRY) for name in ("initial_pose", task)]
    rng = np.random.default_rng(5)
    return simulate_performances(performed, "left", GEOMETRY, rng, SensorErrors())


def found(blocks: Sequence[Block]) -> list[tuple[str, tuple[str, ...]]]:
    suspected = neighbours.check(blocks, "left", GEOMETRY, {}, [], [])
    return [(s.message.code, s.sensors) for s in suspected if s.message.severity != "info"]


@pytest.mark.parametrize("late", [0.2, 0.1, -0.15])
def test_a_strip_that_is_late_against_fingers_that_move_with_it_is_named(late: float) -> None:
    strip, recording = CHAINS["ring"], done("open_close")
    suspected = neighbours.check(delayed(recording, strip, late), "left", GEOMETRY, {}, [], [])
    (one,) = [s for s in suspected if s.message.severity != "info"]
    assert one.message.code == ("sensors.late" if late > 0 else "sensors.early")
    assert one.sensors == strip
    assert one.correction is not None
    np.testing.assert_allclose(one.correction["delay"], late, atol=0.02)  # type: ignore[call-overload]


def test_a_strip_that_is_late_from_half_way_on_is_named_from_when_on() -> None:
    half = 12.0
    blocks = delayed_from(half, done("open_close"), CHAINS["index"], 0.2)
    suspected = neighbours.check(blocks, "left", GEOMETRY, {}, [], [])
    (one,) = [s for s in suspected if s.message.severity != "info"]
    assert one.sensors == CHAINS["index"]
    assert one.spans[0][0] == pytest.approx(half, abs=1.5)


def test_a_sensor_that_is_late_in_gentle_movement_is_named() -> None:
    assert found(delayed(done("rom_fist"), ["middle_middle"], 0.2)) == [
        ("sensors.late", ("middle_middle",))
    ]


def of_one_finger(rates: Sequence[Callable[[np.ndarray], np.ndarray]]) -> list[Block]:
    """A hand that rests but for the index finger, whose sensors turn at rates (rad/s) about the axis of flexion."""
    t, (rest,) = np.arange(2400) / 100.0, list(done("rest").blocks())
    rng = np.random.default_rng(4)
    values = np.zeros((len(t), len(rest.stream.sensors), 6))
    values[..., 3] = 9.81
    values += 0.01 * rng.normal(size=values.shape)
    for sensor, rate in zip(CHAINS["index"], rates):
        values[:, rest.stream.sensors.index(sensor), 2] += rate(t)
    return [Block(rest.stream, t, values)]


def bending(late: float, size: float) -> Callable[[np.ndarray], np.ndarray]:
    """A joint that bends and straightens every three seconds, `late` s behind."""
    return lambda t: size * np.sin(2 * np.pi * 0.7 * (t - late)) * (((t - late) % 3.0) < 1.43)


def test_the_two_others_of_its_finger_show_a_late_middle_sensor() -> None:
    one, two = bending(0.0, 1.0), bending(0.0, 2.0)
    blocks = of_one_finger((one, lambda t: two(t - 0.15), lambda t: 1.3 * two(t)))
    pairs = neighbours.prepare_pairs(blocks, GEOMETRY, {}, [])
    assert pairs is not None
    (late,) = synchrony.find(synchrony.signals_of(pairs))
    assert late.sensors == ("index_middle",) and late.p_value < synchrony.FALSE_ALARM
    assert late.late == pytest.approx(0.15, abs=0.02)


def test_a_strip_that_is_late_while_the_hand_turns_is_named_against_the_others() -> None:
    """Fingers bend half a second after the hand turns, one way: rates about the axis of flexion, less the hand's, bend together."""
    t, (rest,) = np.arange(2400) / 100.0, list(done("rest").blocks())
    rng = np.random.default_rng(4)
    values = np.zeros((len(t), len(rest.stream.sensors), 6))
    values[..., 3] = 9.81
    values += 0.01 * rng.normal(size=values.shape)
    size = dict(zip(("proximal", "middle", "distal"), (0.7, 1.4, 1.8)))
    for k, name in enumerate(rest.stream.sensors):
        at = t - 0.15 * (name in CHAINS["ring"])
        values[:, k, 0] += 0.8 * np.sin(2 * np.pi * 0.4 * at)
        values[:, k, 2] += 0.8 * np.cos(2 * np.pi * 0.4 * at)
        bends = size.get(name.partition("_")[2], 0.0) * (not name.startswith("thumb"))
        values[:, k, 2] += bends * np.sin(2 * np.pi * 0.4 * (at - 0.5))
    pairs = neighbours.prepare_pairs([Block(rest.stream, t, values)], GEOMETRY, {}, [])
    assert pairs is not None
    (late,) = [
        d for d in synchrony.find(synchrony.signals_of(pairs)) if d.p_value < synchrony.FALSE_ALARM
    ]
    assert late.sensors == CHAINS["ring"] and late.late == pytest.approx(0.15, abs=0.03)


@pytest.mark.parametrize("behind", [0.1, 0.2, -0.1, -0.2])
def test_joints_of_a_finger_that_follow_each_other_are_not_late(behind: float) -> None:
    """The knuckle first, or the joints of the finger first."""
    mcp, pip, dip = bending(0.0, 1.2), bending(behind, 1.2), bending(1.3 * behind, 0.6)
    blocks = of_one_finger((mcp, lambda t: mcp(t) + pip(t), lambda t: mcp(t) + pip(t) + dip(t)))
    pairs = neighbours.prepare_pairs(blocks, GEOMETRY, {}, [])
    assert pairs is not None
    assert [
        d for d in synchrony.find(synchrony.signals_of(pairs)) if d.p_value < synchrony.FALSE_ALARM
    ] == []


@pytest.mark.parametrize(
    "task", ["open_close", "rom_fist", "finger_independence", "tremor_posture", "tapping"]
)
def test_fingers_of_an_intact_glove_are_not_late(task: str) -> None:
    assert found(list(done(task).blocks())) == []


def test_fingers_that_drum_one_after_the_other_are_not_late() -> None:
    blocks = list(done("open_close").blocks())
    for k, finger in enumerate(("little", "ring", "middle", "index")):
        blocks = [_later(b, CHAINS[finger], 0.12 * k) for b in blocks]
    assert not any(len(sensors) > 1 for _, sensors in found(blocks))


def _later(block: Block, sensors: Sequence[str], by: float) -> Block:
    values = block.values.copy()
    for k in (block.stream.sensors.index(s) for s in sensors):
        values[:, k] = np.stack(
            [np.interp(block.t - by, block.t, c) for c in values[:, k].T], axis=1
        )
    return Block(block.stream, block.t, values)


def test_fingers_that_follow_a_turning_hand_by_a_phase_are_not_late() -> None:
    """Where the hand turns, too, segments of a finger that bends by another phase of the rhythm are out of phase with each other."""
    t, phase = np.arange(2400) / 100.0, 2 * np.pi * 0.4 * np.arange(2400) / 100.0
    blocks = []
    for block in done("rest").blocks():
        names, values = block.stream.sensors, np.zeros((len(t), len(block.stream.sensors), 6))
        values[..., 3] = 9.81
        for k, name in enumerate(names):
            bends = name.endswith(("middle", "distal"))
            values[:, k, 2] = np.sin(phase) + 0.7 * bends * np.cos(phase)
        blocks.append(Block(block.stream, t, values[:, :, : block.values.shape[2]]))
    pairs = neighbours.prepare_pairs(blocks, GEOMETRY, {}, [])
    assert pairs is not None
    assert synchrony.find(synchrony.signals_of(pairs)) == []


def _fast_fist(late: float) -> list[Block]:
    """All fingers and the thumb at 2.5 Hz by rates alone, the index strip late: a quarter of a period is 0.1 s, and the thumb's rates fit as well 0.1 s early, negated."""
    rng, t = np.random.default_rng(2), np.arange(0.0, 24.0, 0.01)
    sensors = ("hand", *(s for chain in CHAINS.values() for s in chain))
    values = rng.normal(size=(len(t), len(sensors), 6)) * [*[0.004] * 3, *[0.02] * 3]
    values[:, :, 3] += 9.81
    phase = 0.8 * np.sin(2 * np.pi * 0.13 * t)
    for k, name in enumerate(sensors[1:], 1):
        own = t - (late if name in CHAINS["index"] else 0.0)
        rate = 6.0 * (1 + k % 3) / 3 * np.sin(2 * np.pi * 2.5 * own + phase)
        values[:, k, 0 if name.startswith("thumb") else 2] += rate
    return [Block(Stream("imu", sensors, (GYR, ACC), 100.0), t, values)]


def test_a_rhythm_does_not_test_a_lag_of_half_its_period() -> None:
    pairs = neighbours.prepare_pairs(_fast_fist(0.0), GEOMETRY, {}, [])
    assert pairs is not None
    assert set(synchrony.comparable_fingers(synchrony.signals_of(pairs), (0.1, -0.1))) >= set(
        CHAINS
    ) - {"thumb"}
    assert synchrony.comparable_fingers(synchrony.signals_of(pairs), (0.2, -0.2)) == []


@pytest.mark.parametrize(("late", "named"), [(0.1, [CHAINS["index"]]), (0.0, [])])
def test_a_thumb_half_a_period_off_contradicts_no_lag_of_a_rhythm(
    late: float, named: list[tuple[str, ...]]
) -> None:
    pairs = neighbours.prepare_pairs(_fast_fist(late), GEOMETRY, {}, [])
    assert pairs is not None
    delays = [
        d for d in synchrony.find(synchrony.signals_of(pairs)) if d.p_value < synchrony.FALSE_ALARM
    ]
    assert [d.sensors for d in delays] == named
    assert all(abs(d.late - late) < 0.02 for d in delays)
