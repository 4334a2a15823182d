"""A sensor that sits otherwise from one sample to the next: told by the step of its readings, and by where gravity is afterwards."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from handscope.estimators.data.findings import whole_streams
from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.fault_detection.check import check_recording
from handscope.estimators.fault_detection.finding import Suspicion
from handscope.estimators.fault_detection.single_sensors.check_sensors import check_sensors
from handscope.estimators.fault_detection.single_sensors.sudden_turns import (
    _p_without,
    spikes,
    sudden_turns,
)
from handscope.estimators.fault_detection.words import as_findings
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.sessions.formats import recordings as formats
from handscope.validation.independent.simulator import daily_movements
from handscope.validation.independent.simulator.free_movement import Setup, written
from tests.estimators.fault_detection.recordings import moved_freely, performed

AT = 12.0  # s


def _turned(blocks: tuple[Block, ...], sensor: str, turn_deg: Array) -> list[Block]:
    R = quat.matrix(quat.exp(np.radians(turn_deg)))
    out = []
    for block in blocks:
        values, later = block.values.copy(), block.t >= AT
        if sensor in block.stream.sensors:
            k = block.stream.sensors.index(sensor)
            for first in range(0, 6, 3):
                part = slice(first, first + 3)
                values[later, k, part] = values[later, k, part] @ R
        out.append(replace(block, values=values))
    return out


def _lossy(blocks: list[Block]) -> list[Block]:
    rng = np.random.default_rng(12)
    return [
        replace(b, values=np.where(rng.random(len(b.t))[:, None, None] < 0.05, np.nan, b.values))
        for b in blocks
    ]


def test_a_turn_is_found_with_its_size_and_time() -> None:
    turn = np.array([3.0, -9.0, 6.0])
    (found,) = sudden_turns(_turned(moved_freely(), "ring_middle", turn))
    assert (found.message.code, found.sensors) == ("sensor.slipped", ("ring_middle",))
    assert found.spans[0][0] == pytest.approx(AT, abs=0.02)
    assert found.correction is not None
    mended = np.degrees(quat.log(np.asarray(found.correction["turn"])))
    np.testing.assert_allclose(mended, turn, atol=3.0)  # deg


def test_a_turn_is_found_among_lost_samples() -> None:
    lossy = _lossy(_turned(moved_freely(), "ring_middle", np.array([3.0, -14.0, 9.0])))
    assert [s.sensors for s in sudden_turns(lossy)] == [("ring_middle",)]


@pytest.mark.parametrize("sensor", ["index_proximal", "ring_proximal"])
def test_a_small_turn_is_found_while_fingers_open_and_close_fast(sensor: str) -> None:
    """Its force goes to and fro within the time in which a step has to last."""
    turned = _turned(performed("powerglove_13_open_close"), sensor, np.array([0.0, 0.0, 8.5]))
    assert [s.sensors for s in sudden_turns(turned)] == [(sensor,)]


@pytest.mark.parametrize("find", [sudden_turns, spikes])
@pytest.mark.parametrize(
    "blocks", [moved_freely(), performed("tapping"), performed("rom_fist", "open_close")]
)
def test_nothing_is_found_in_sensors_that_stay(
    blocks: tuple[Block, ...], find: Callable[[Sequence[Block]], list[Suspicion]]
) -> None:
    assert find(blocks) == []
    assert find(_lossy(list(blocks))) == []


def test_a_kink_of_the_rates_is_no_turn_about_the_vertical() -> None:
    """Fingers that begin to bend at once: a large turn about gravity's axis would explain their rates."""
    setup = Setup(10502, hand="right", fingers=FINGERS, duration=24.0, missed=np.radians(3.0))
    with TemporaryDirectory() as folder:
        at = Path(folder) / "recording"
        written(setup, at, daily_movements.movement("opposing", setup))
        blocks = whole_streams(list(formats.load(at).blocks()))
    assert sudden_turns(blocks) == []


def test_a_knock_is_no_turn() -> None:
    """30 m/s^2 for 40 ms, across gravity: behind it gravity is where it was."""
    blocks = []
    for block in moved_freely():
        values = block.values.copy()
        rows = np.flatnonzero((block.t >= AT) & (block.t < AT + 0.04))
        if "ring_middle" in block.stream.sensors:
            k = block.stream.sensors.index("ring_middle")
            force = values[rows, k, block.stream.axes(ACC)]
            across = np.cross(force, [1.0, 2.0, 3.0])
            force += 30.0 * across / np.linalg.norm(across, axis=1, keepdims=True)
            values[rows, k, block.stream.axes(ACC)] = force
        blocks.append(replace(block, values=values))
    assert sudden_turns(blocks) == []


def test_a_step_that_many_sensors_read_turns_none() -> None:
    """A hand that is stopped: one sensor reads what a turn of gravity would be, the others other steps."""
    turned = _turned(moved_freely(), "index_middle", np.array([3.0, -14.0, 9.0]))
    assert [s.sensors for s in sudden_turns(turned)] == [("index_middle",)]
    stopped = []
    for block in turned:
        values, later = block.values.copy(), block.t >= AT
        for k, sensor in enumerate(block.stream.sensors):
            if sensor != "index_middle":
                values[later, k, block.stream.axes(ACC)] *= 1.25
        stopped.append(replace(block, values=values))
    assert sudden_turns(stopped) == []


def test_a_stream_of_10_hz_is_asked_nothing() -> None:
    rng, t = np.random.default_rng(1), 0.1 * np.arange(300)
    values = 0.01 * rng.normal(size=(300, 1, 6)) + [0.3, 0.2, 0.1, 9.81, 0.0, 0.0]
    still = (Block(Stream("imu", ("ring_middle",), (GYR, ACC), 10.0), t, values),)
    assert sudden_turns(_turned(still, "ring_middle", np.array([3.0, -14.0, 9.0]))) == []


def test_rows_that_are_lost_turn_no_sensor() -> None:
    blocks = [
        replace(b, values=b.values[rows := (b.t < AT) | (b.t >= AT + 1.0)], t=b.t[: rows.sum()])
        for b in moved_freely()
    ]
    assert "sensor.slipped" not in [s.message.code for s in check_recording(blocks)]


def _spiked(blocks: tuple[Block, ...], sensor: str, angle_deg: float, width: int) -> list[Block]:
    """A gyroscope that sees its sensor turn about z within so many samples."""
    out = []
    for block in blocks:
        values = block.values.copy()
        if sensor in block.stream.sensors:
            k, axes = block.stream.sensors.index(sensor), block.stream.axes(GYR)
            first = int(np.searchsorted(block.t, AT))
            rate = np.radians(angle_deg) * block.stream.rate / width
            values[first : first + width, k, axes] += [0.0, 0.0, rate]
        out.append(replace(block, values=values))
    return out


@pytest.mark.parametrize("width", [1, 2])
@pytest.mark.parametrize("angle", [8.5, -17.0])
def test_a_turn_within_a_sample_or_two_is_told(width: int, angle: float) -> None:
    (found,) = check_sensors(_spiked(moved_freely(), "ring_distal", angle, width))
    assert [type(t) for t in as_findings([found])[0].spans[0]] == [float, float]  # as they print
    assert (found.message.code, found.sensors) == ("sensor.spike", ("ring_distal",))
    assert found.spans[0][0] == pytest.approx(AT, abs=0.03)
    assert found.message.values["angle_deg"] == pytest.approx(abs(angle), abs=1.5)


def _struck(stop: float, rate: float) -> Array:
    """Rates (n, 3) rad/s at 100 Hz of a finger that a table stops within `stop` s, once a second."""
    t = np.arange(0.0, 20.0, 0.01)
    since = t % 1.0
    flexing = rate * np.sin(np.pi * np.clip(since / 0.15, 0, 0.5))
    after = np.clip(1 - (since - 0.15) / stop, 0, 1)
    return np.stack([0 * t, 0 * t, np.where(since < 0.15, flexing, rate * after)], axis=1)


@pytest.mark.parametrize("stop", [1e-3, 0.02, 0.05])
def test_a_finger_that_a_table_stops_makes_no_spike(stop: float) -> None:
    rate = _struck(stop, np.radians(900.0))
    values = np.concatenate([rate, np.tile([0.0, 0.0, 9.81], (len(rate), 1))], axis=1)
    stream = Stream("imu", ("index_distal",), (GYR, ACC), 100.0)
    assert spikes([Block(stream, np.arange(len(rate)) / 100.0, values[:, None])]) == []


def _flicked(rate: float, lasting: float) -> Block:
    """A finger that is flicked by 40 deg within so many s, and back, once a second, sampled at every phase."""
    t = np.arange(0.0, 60.0, 1 / rate)
    since = t % 1.0137  # s
    course = np.clip(np.stack([since - 0.1, since - 0.6]) / lasting, 0.0, 1.0)
    forth, back = 30 * (course * (1 - course)) ** 2 / lasting  # of a minimum-jerk movement
    flexing = np.radians(40.0) * (forth - back)
    values = np.stack([0 * t, 0 * t, flexing, 0 * t, 0 * t, 9.81 + 0 * t], axis=1)
    return Block(Stream("imu", ("index_distal",), (GYR, ACC), rate), t, values[:, None])


@pytest.mark.parametrize("rate", [25.0, 30.0, 40.0, 50.0, 60.0, 100.0, 200.0])
@pytest.mark.parametrize("lasting", [0.05, 0.08])
def test_a_flick_makes_no_spike_at_any_rate(rate: float, lasting: float) -> None:
    assert spikes([_flicked(rate, lasting)]) == []


@pytest.mark.parametrize("rate", [60.0, 100.0])
def test_a_stroke_that_misses_a_sample_makes_no_spike(rate: float) -> None:
    """A drumming finger that falls within 0.05 s, once a second: of its few samples any one may be lost."""
    t = np.arange(0.0, 60.0, 1 / rate)
    since = t % 1.0137  # s
    falling = np.where(since < 0.05, since / 0.05, np.clip(1 - (since - 0.05) / 0.01, 0, 1))
    values = np.stack([0 * t, 0 * t, np.radians(900.0) * falling, 0 * t, 0 * t, 9.81 + 0 * t], 1)
    stream = Stream("imu", ("ring_distal",), (GYR, ACC), rate)
    for lost in range(7):
        lossy = values.copy()
        lossy[np.floor(since * rate) == lost] = np.nan
        assert spikes([Block(stream, t, lossy[:, None])]) == []


def test_a_turn_that_explains_little_of_a_step_is_none() -> None:
    """As at a keystroke, whose force lasts: a turn would make an eighth of it."""
    usual = np.random.default_rng(4).normal(0.0, 1.0, (40, 3))
    expected = np.array([0.0, 0.0, -1.0])
    struck = np.concatenate([[[0.0, 0.3, -7.3]], usual])
    assert _p_without(struck, np.array([0.0, 0.3, -6.2]), 1.8 * expected) is None
    turned = np.concatenate([[[0.2, 0.3, -3.0]], usual])
    p = _p_without(turned, np.array([0.2, 0.3, 0.1]), 3.1 * expected)
    assert p is not None and p < 0.05
    shaken = np.concatenate([[[0.2, 0.3, -3.0]], 4.5 * usual])
    assert _p_without(shaken, np.array([0.2, 0.3, 0.1]), 3.1 * expected) == 1.0  # tells nothing
