"""Vibration that all segments of a hand share: a late strip is named while the hand rests, fingers that tremble by themselves are not."""

from functools import cache

import numpy as np
import pytest

from handscope.estimators.data.samples import ACC, Block
from handscope.estimators.fault_detection.coverage import untested
from handscope.estimators.fault_detection.neighbours import check_neighbours as neighbours
from handscope.estimators.fault_detection.neighbours import vibration
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.movements import task_performance as tasks
from handscope.estimators.simulation.scenario import Simulated, simulate_performances
from handscope.estimators.simulation.sensors import SensorErrors
from tests.estimators.fault_detection.joint_recordings import delayed, delayed_from

GEOMETRY = sized("left")
TREMOR = 0.15  # m/s^2, root mean square of an axis


@cache
def done(task: str, size: float = TREMOR, band: tuple[float, float] = (8.0, 12.0)) -> Simulated:
    """A task by a hand that trembles as it is held, all of it together."""
    performed = [tasks.TASKS[name](GEOMETRY) for name in ("initial_pose", task)]
    made = simulate_performances(
        performed, "left", GEOMETRY, np.random.default_rng(5), SensorErrors()
    )
    for block in made.blocks():
        shaken = size * tremor(block.t, *band)
        for k, name in enumerate(block.stream.sensors):
            q_GS = made.truth.q_GS[:, made.sensors.segments.index(name)]
            at = np.clip(np.searchsorted(made.truth.t, block.t), 0, len(made.truth.t) - 1)
            q_BS = made.sensors.q_BS[made.sensors.segments.index(name)]
            felt = quat.rotate(quat.conjugate(quat.multiply(q_GS[at], q_BS)), shaken)
            block.values[:, k, block.stream.axes(ACC)] += felt
    return made


def tremor(t: Array, low: float, high: float) -> Array:
    """White noise (n, 3) between two frequencies (Hz), root mean square 1."""
    spectrum = np.fft.rfft(np.random.default_rng(9).normal(size=(len(t), 3)), axis=0)
    f = np.fft.rfftfreq(len(t), float(t[1] - t[0]))
    made = np.fft.irfft(spectrum * ((f > low) & (f < high))[:, None], len(t), axis=0)
    return np.asarray(made / made.std(axis=0))


def found(blocks: list[Block]) -> list[tuple[str, tuple[str, ...]]]:
    suspected = neighbours.check(blocks, "left", GEOMETRY, {}, [], [])
    return [(s.message.code, s.sensors) for s in suspected if s.message.severity != "info"]


@pytest.mark.parametrize(("finger", "late"), [("index", 0.2), ("index", -0.14), ("ring", 0.1)])
def test_a_strip_that_is_late_is_named_while_the_hand_rests(finger: str, late: float) -> None:
    """Fingers move each by itself, so that none tells of another."""
    blocks = delayed(done("tapping"), CHAINS[finger], late)
    suspected = neighbours.check(blocks, "left", GEOMETRY, {}, [], [])
    (one,) = [s for s in suspected if s.message.severity != "info"]
    assert one.message.code == ("sensors.late" if late > 0 else "sensors.early")
    assert one.sensors == CHAINS[finger]
    assert one.correction is not None
    assert one.correction["delay"] == pytest.approx(late, abs=0.01)


def test_a_single_sensor_that_is_late_in_slow_movement_is_named() -> None:
    blocks = delayed(done("finger_independence"), ["ring_middle"], 0.1)
    assert found(blocks) == [("sensors.late", ("ring_middle",))]


def test_it_is_named_from_when_on() -> None:
    half = 12.0
    blocks = delayed_from(half, done("tapping"), CHAINS["index"], 0.2)
    suspected = neighbours.check(blocks, "left", GEOMETRY, {}, [], [])
    (one,) = [s for s in suspected if s.message.severity != "info"]
    assert one.sensors == CHAINS["index"]
    assert one.spans[0][0] == pytest.approx(half, abs=2.5)


@pytest.mark.parametrize("task", ["tapping", "finger_independence", "tremor_posture", "rest"])
def test_nothing_is_late_in_an_intact_glove(task: str) -> None:
    assert found(list(done(task).blocks())) == []


def test_a_hand_that_does_not_vibrate_tells_nothing() -> None:
    pairs = neighbours.prepare_pairs(
        delayed(done("tapping", 0.0), CHAINS["ring"], 0.2), GEOMETRY, {}, []
    )
    assert pairs is not None
    assert vibration.find(vibration.Vibration(pairs)) == []


def test_vibration_of_one_frequency_tells_no_lag_of_its_period() -> None:
    """Segments that shake at 10 Hz look in time 0.1 s later."""
    blocks = list(done("rest", TREMOR, (9.98, 10.02)).blocks())
    pairs = neighbours.prepare_pairs(blocks, GEOMETRY, {}, [])
    assert pairs is not None
    shaking, joint = vibration.Vibration(pairs), ("hand", "ring_proximal")
    assert vibration.p_value_of(shaking, joint, 0.2) == 1.0
    assert vibration.p_value_of(shaking, joint, 0.14) < 1e-3


def test_a_strip_counts_as_tested_where_the_hand_vibrates() -> None:
    shaken, still = done("tapping"), done("tapping", 0.0)
    assert untested(list(shaken.blocks()), shaken).strips == ()
    assert set(untested(list(still.blocks()), still).strips) >= {"index", "thumb"}
