"""Rates that neighbours have in common: exact of hinges, whatever the sensors' tilt, and of no other gain or delay."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from handscope.estimators.data.samples import GYR, Block
from handscope.estimators.fault_detection.neighbours import joint_windows
from handscope.estimators.fault_detection.neighbours.check_neighbours import (
    FALSE_ALARM,
    prepare_pairs,
)
from handscope.estimators.fault_detection.neighbours.rates import isolated_turns, rate_tests
from handscope.estimators.fault_detection.neighbours.rates.common_rates import CommonRates
from handscope.estimators.fault_detection.neighbours.rates.kernels import (
    SIZE,
    cosine,
    fit_rates,
    leave_rates,
    sine,
)
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.hand.anatomy import CHAINS, FINGERS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import whole_of
from handscope.estimators.recording_checks.check import suspicions_of
from handscope.sessions.files.recording import LoadedRecording
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator import daily_movements
from handscope.validation.independent.simulator.free_movement import Setup
from tests.estimators.fault_detection.joint_recordings import amplified, delayed, freely_moved

DT, M, WINDOWS = 0.02, 50, 20
PRIOR = np.tile(np.repeat([0.1, 0.01], 2) ** -2.0, 2)


def _rates_at_a_joint(abduction: float, tilt_deg: float = 0.0) -> tuple[Array, Array]:
    """Rates (n, 3) rad/s of a parent that tumbles and of a child that bends and abducts on it, the child's sensor tilted; by differences of rotations."""
    t, h = DT * np.arange(M * WINDOWS), 1e-4

    def parent(t: Array) -> Array:
        return quat.multiply(
            quat.about(0, 0.9 * np.sin(2.1 * t)), quat.about(1, 0.7 * np.sin(1.3 * t + 0.5))
        )

    def child(t: Array) -> Array:
        flexed = quat.about(2, 0.8 + 0.7 * np.sin(2.7 * t))
        return quat.multiply(
            parent(t), quat.multiply(flexed, quat.about(0, abduction * np.sin(1.7 * t)))
        )

    def rate(q_of: object) -> Array:
        before, after = q_of(t - h), q_of(t + h)  # type: ignore[operator]
        return np.asarray(quat.log(quat.multiply(quat.conjugate(before), after)) / (2 * h))

    tilt = quat.exp(np.radians(tilt_deg) * np.array([0.6, -0.8, 0.0]))
    return rate(parent), quat.rotate(tilt, rate(child))


def _left(a: Array, b: Array, has_abduction: bool) -> Array:
    weight = np.full(len(a), 0.01**-2)  # 0.01 rad/s
    _, rest = fit_rates(a, b, weight, M, DT, has_abduction, np.zeros(SIZE), PRIOR, 20)
    return np.asarray(rest)


@pytest.mark.parametrize("tilt_deg", [0.0, 12.0])
def test_nothing_is_left_of_a_hinge_whose_sensor_is_tilted(tilt_deg: float) -> None:
    assert _left(*_rates_at_a_joint(0.0, tilt_deg), has_abduction=False).max() < 0.5


@pytest.mark.parametrize("abduction", [0.0, 0.3])
def test_no_more_is_left_at_the_unknowns_of_a_fit_than_the_fit_leaves(abduction: float) -> None:
    a, b = _rates_at_a_joint(abduction, tilt_deg=5.0)
    weight, has_abduction = np.full(len(a), 0.01**-2), abduction > 0
    x, rest = fit_rates(a, b, weight, M, DT, has_abduction, np.zeros(SIZE), PRIOR, 20)
    left = leave_rates(a, b, weight, M, DT, has_abduction, x)
    assert (left < rest + 0.01).all()
    assert (
        _left(a, b, has_abduction).sum()
        < leave_rates(a, b, weight, M, DT, has_abduction, 0 * x).sum()
    )


@pytest.mark.parametrize("x", [0.0, 1e-6, 0.1, -0.4, 1.0, -3.0])
def test_sine_and_cosine_of_a_walk_are_those_of_the_library(x: float) -> None:
    np.testing.assert_allclose([sine(x), cosine(x)], [np.sin(x), np.cos(x)], atol=1e-11)


def test_nothing_is_left_of_a_joint_that_abducts() -> None:
    a, b = _rates_at_a_joint(0.3)
    assert np.median(_left(a, b, has_abduction=True)) < 0.5
    assert np.median(_left(a, b, has_abduction=False)) > 10.0


@pytest.mark.parametrize("has_abduction", [False, True])
def test_a_gain_is_left_over(has_abduction: bool) -> None:
    a, b = _rates_at_a_joint(0.3 if has_abduction else 0.0)
    assert np.median(_left(a, 1.2 * b, has_abduction)) > 20.0


def _rates(blocks: list[Block]) -> CommonRates:
    pairs = prepare_pairs(blocks, sized("left"), {}, [])
    assert pairs is not None
    return CommonRates(pairs)


def test_intact_hinges_leave_no_more_than_their_noise() -> None:
    rates = _rates(list(freely_moved().blocks()))
    hinges = [j for j in rates.joints if j[0] != "hand"]
    assert max(float(np.nanmedian(rates.left(j))) for j in hinges) < 1.0
    assert rate_tests.find_gain(rates) is None
    assert rate_tests.find_delays(rates) == []


@pytest.mark.parametrize("lost", [0.0, 0.12])
def test_noise_of_coarse_gyroscopes_is_learnt_from_the_recording(lost: float) -> None:
    rng, blocks = np.random.default_rng(4), []
    for block in freely_moved().blocks():
        values, axes = block.values.copy(), block.stream.axes(GYR)
        values[..., axes] += rng.normal(0, 0.006, values[..., axes].shape)  # rad/s
        values[rng.random(len(values)) < lost] = np.nan
        blocks.append(Block(block.stream, block.t, values))
    rates = _rates(blocks)
    assert 0.0035**2 < rates.noise["ring_middle"] < 0.006**2  # of means of two readings
    assert [u for u in rate_tests.find_unexplained(rates) if u.p_value < FALSE_ALARM] == []


@pytest.mark.parametrize("gain", [1.15, 0.8])
def test_a_gain_is_named_with_its_sensor_and_size(gain: float) -> None:
    found = rate_tests.find_gain(_rates(amplified(freely_moved(), "ring_middle", gain)))
    assert found is not None and found.sensor == "ring_middle"
    assert found.gain == pytest.approx(gain, abs=0.03)
    assert found.p_value < 1e-4


@pytest.mark.parametrize("sensors", [("ring_distal",), CHAINS["ring"]])
def test_what_is_late_is_named_with_its_delay(sensors: tuple[str, ...]) -> None:
    found = rate_tests.find_delays(_rates(delayed(freely_moved(), sensors, 0.1)))
    assert [d.sensors for d in found] == [sensors]
    assert found[0].late == pytest.approx(0.1, abs=0.02)


def test_exchanged_axes_are_left_over_at_both_hinges_of_a_sensor() -> None:
    blocks = []
    for block in freely_moved().blocks():
        values, k = block.values.copy(), block.stream.sensors.index("ring_middle")
        axes = block.stream.axes(GYR)
        values[:, k, axes] = values[:, k, axes][:, [1, 0, 2]]
        blocks.append(Block(block.stream, block.t, values))
    found = [u for u in rate_tests.find_unexplained(_rates(blocks)) if u.p_value < 1e-4]
    assert {u.joint for u in found} == {
        ("ring_proximal", "ring_middle"),
        ("ring_middle", "ring_distal"),
    }


def test_sensors_whose_seats_are_not_known_are_not_doubted() -> None:
    """Each turned by some right angle against what is declared: no hinge is where it seems to be."""
    rng, blocks = np.random.default_rng(8), []
    for block in freely_moved().blocks():
        values = block.values.copy()
        for k in range(len(block.stream.sensors)):
            R = quat.matrix(quat.normalize(rng.standard_normal(4)))
            values[:, k, :3], values[:, k, 3:6] = values[:, k, :3] @ R, values[:, k, 3:6] @ R
        blocks.append(Block(block.stream, block.t, values))
    rates = _rates(blocks)
    assert not rates.explains
    assert rate_tests.find_gain(rates) is None
    assert rate_tests.find_delays(rates) == []
    assert list(rate_tests.find_unexplained(rates)) == []


@cache
def _drumming(**more: Any) -> LoadedRecording:
    """Fingers that strike one after the other, by the other simulator, a hand that rests."""
    setup = Setup(20003, fingers=FINGERS, duration=24.0, missed=np.radians(3.0), **more)
    return write_and_load(setup, daily_movements.movement("drumming", setup))[0]


@pytest.mark.parametrize("more", [{"law": "trailing", "skin": 2.0}, {"means": True}])
def test_skin_that_trails_and_mean_rates_are_no_fault(more: dict[str, Any]) -> None:
    assert [s for s in suspicions_of(_drumming(**more)) if s.message.severity != "info"] == []


@pytest.mark.parametrize("means", [False, True])
def test_joints_tell_whether_rates_are_means(means: bool) -> None:
    """What they leave is as little, and the readings are taken for what they are."""
    drumming = _drumming(means=means)
    blocks = whole_of(drumming)
    pairs = prepare_pairs(blocks, drumming.geometry, drumming.mounting, [])
    assert pairs is not None
    series = joint_windows.common_series(blocks, {}, 0.5 if means else 0.0)
    assert series is not None
    np.testing.assert_array_equal(pairs.series.gyr, series.gyr)


def _flexing(sensors: Sequence[str], angle: float) -> Pairs:
    """Sensors that flex by an angle (rad) within 0.2 s from 3.4 s on, all others at rest."""
    pairs = prepare_pairs(list(freely_moved().blocks()), sized("left"), {}, [])
    assert pairs is not None
    series, gyr = pairs.series, np.zeros_like(pairs.series.gyr)
    rate = angle * isolated_turns.turn_rate(series.t - series.t[0], 3.4, 0.2)
    for sensor in sensors:
        gyr[:, series.sensors.index(sensor), 2] = rate
    return Pairs(replace(series, gyr=gyr), pairs.geometry, pairs.q_BS)


def test_a_turn_that_neighbours_do_not_share_is_found_with_its_size() -> None:
    pairs = _flexing(["index_middle"], -0.3)
    (found,) = isolated_turns.find(pairs, "index_middle")
    assert found.window == 3
    assert found.middle == pytest.approx(0.5, abs=0.08)
    assert found.angle == pytest.approx(-0.3, rel=0.1)
    seen, _ = isolated_turns.share_seen(
        pairs, "index_middle", 3, np.array([0.0, 0.0, -0.3]), 0.4, 0.2
    )
    assert seen == pytest.approx(1.0, abs=0.1)


def test_a_finger_that_flexes_as_a_whole_turns_no_sensor_by_itself() -> None:
    """Nor does its last phalanx, which goes with the one before."""
    pairs = _flexing(CHAINS["index"], 0.3)
    assert [t for s in CHAINS["index"][1:] for t in isolated_turns.find(pairs, s)] == []
    seen, _ = isolated_turns.share_seen(
        pairs, "index_distal", 3, np.array([0.0, 0.0, 0.3]), 0.4, 0.2
    )
    assert abs(seen) < 0.2
