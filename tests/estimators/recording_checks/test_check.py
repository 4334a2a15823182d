"""Faults of sensors in a recording that a method was run over: said, flagged, and never under a good figure."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.data.mounting_change import MountingChange
from handscope.estimators.data.samples import ACC, GYR, Block
from handscope.estimators.data.trajectory import Flag
from handscope.estimators.fault_detection.words import sentence
from handscope.estimators.hand.anatomy import FLEXION, JOINT, SEGMENT
from handscope.estimators.measures.accuracy import DEFAULT, with_sd
from handscope.estimators.measures.figure import grade_of
from handscope.estimators.messages.sentence import codes_of
from handscope.estimators.methods import ekf, m2
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.mounting_changes import of_change
from handscope.estimators.pipeline.process import process
from handscope.estimators.recording_checks.check import check_processed, suspicions_of
from handscope.estimators.simulation.experiments import EXPERIMENTS, PersonErrors, record_experiment
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from tests.simulated import pose_and_wiggle

SENSOR = "index_middle"


def with_readings(
    recording: Simulated, change: Callable[[Array], Array], quantity: str = GYR
) -> Simulated:
    """The recording with other readings (n, 3) of SENSOR."""
    samples = {}
    for name, block in recording.samples.items():
        values = block.values.copy()
        if SENSOR in block.stream.sensors and quantity in block.stream.quantities:
            k, axes = block.stream.sensors.index(SENSOR), block.stream.axes(quantity)
            values[:, k, axes] = change(values[:, k, axes])
        samples[name] = Block(block.stream, block.t, values)
    return replace(recording, samples=samples)


@pytest.fixture(scope="module")
def intact() -> Simulated:
    return pose_and_wiggle("left", SensorErrors())


def test_an_intact_recording_is_left_as_it_is(intact: Simulated) -> None:
    made = process(m2, m2.Params(), intact)
    flags = made.trajectory.flags.copy()
    checked = check_processed(made, intact)
    assert (checked.suspicions, checked.warnings) == ((), made.warnings)
    np.testing.assert_array_equal(checked.trajectory.flags, flags)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda w: w * [1, 1, -1], "sensor.gyroscope_sign"),
        (lambda w: w[:, [2, 1, 0]], "sensor.gyroscope_exchange"),
    ],
)
def test_a_gyroscope_at_fault_is_named_and_its_figures_are_not_good(
    intact: Simulated, change: Callable[[Array], Array], code: str
) -> None:
    wrong = with_readings(intact, change)
    checked = check_processed(process(m2, m2.Params(), wrong), wrong)
    (suspicion,) = [s for s in checked.suspicions if s.sensors == (SENSOR,)]
    assert suspicion.message.code == code
    flags = checked.trajectory.flags[:, [SEGMENT[SENSOR]]]
    assert (flags & (Flag.FAULTY | Flag.DOUBTFUL)).all()
    assert grade_of(flags)[0] == "poor"
    sd = with_sd(checked.trajectory, DEFAULT)[0].angles_sd
    assert sd is not None
    assert (sd[:, JOINT["index_pip"], FLEXION] > np.radians(20.0)).all()
    assert (sd[:, JOINT["ring_pip"], FLEXION] < np.radians(10.0)).all()
    assert any(SENSOR in warning for warning in checked.warnings)


@pytest.mark.parametrize(("sensor", "told"), [(SENSOR, False), ("ring_middle", True)])
def test_a_sensor_at_fault_throughout_is_not_said_to_have_turned_as_well(
    intact: Simulated, sensor: str, told: bool
) -> None:
    wrong = with_readings(intact, lambda w: w * [1, 1, -1])
    made = process(m2, m2.Params(), wrong)
    end = float(made.trajectory.t[-1])
    turned = of_change(MountingChange((sensor,), 0.4 * end, 0.5 * end, 0.5, 1e-9))
    words = sentence(turned.message)
    noticed = replace(made, suspicions=(turned,), warnings=(*made.warnings, words))
    checked = check_processed(noticed, wrong)
    assert (turned in checked.suspicions, words in checked.warnings) == (told, told)


def test_an_accelerometer_in_g_is_said_once(intact: Simulated) -> None:
    wrong = with_readings(intact, lambda a: a / GRAVITY, ACC)
    checked = check_processed(process(m2, m2.Params(), wrong), wrong)
    codes = [c for w in checked.warnings if SENSOR in w for c in codes_of(w)]
    assert "sensor.accelerometer_unit" in codes
    assert not {"calibration.resting_gravity", "sensor.accelerometer_size"} & {*codes}


def exchanged(recording: Simulated, a: str, b: str) -> Simulated:
    """The recording with the readings of two sensors in each other's place."""
    samples = {}
    for name, block in recording.samples.items():
        values, names = block.values.copy(), block.stream.sensors
        if a in names and b in names:
            i, j = names.index(a), names.index(b)
            values[:, [i, j]] = values[:, [j, i]]
        samples[name] = Block(block.stream, block.t, values)
    return replace(recording, samples=samples)


def test_sensors_in_each_others_place_are_named_and_their_figures_are_not_good() -> None:
    tapping = record_experiment(
        EXPERIMENTS["tapping"],
        np.random.default_rng(12),
        SensorErrors(),
        None,
        "left",
        person=PersonErrors(pose_deg=2.5),
    )
    wrong = exchanged(tapping, "index_middle", "index_distal")
    checked = check_processed(process(m2, m2.Params(), wrong), wrong)
    (suspicion,) = checked.suspicions
    assert (suspicion.message.code, set(suspicion.sensors)) == (
        "sensors.exchanged",
        {"index_middle", "index_distal"},
    )
    assert grade_of(checked.trajectory.flags[:, [SEGMENT["index_distal"]]])[0] == "poor"
    assert any("1000000 recordings" in warning for warning in checked.warnings)


def test_accelerometers_that_are_all_negated_are_asked_about(intact: Simulated) -> None:
    samples = {}
    for name, block in intact.samples.items():
        values = block.values.copy()
        values[..., block.stream.axes(ACC)] *= -1.0
        samples[name] = Block(block.stream, block.t, values)
    wrong = replace(intact, samples=samples)
    (asked,) = [s for s in suspicions_of(wrong) if s.message.severity == "info"]
    assert asked.message.code == "file.accelerometer_negated"


def test_where_the_rate_is_wrong_no_sensor_is_said_to_have_turned() -> None:
    pinch = record_experiment(
        EXPERIMENTS["P1 F1-F2"], np.random.default_rng(12), SensorErrors(), None, "left"
    )
    samples = {n: replace(b, t=2.0 * b.t) for n, b in pinch.samples.items()}
    events = tuple(replace(e, onset=2.0 * e.onset, duration=2.0 * e.duration) for e in pinch.events)
    wrong = replace(pinch, samples=samples, events=events)
    made = process(ekf, ekf.Params(), wrong)
    assert "sensor.turned" in {s.message.code for s in made.suspicions}
    checked = check_processed(made, wrong)
    assert [s.message.code for s in checked.suspicions if s.message.severity != "info"] == [
        "file.rate"
    ]
    assert not any("sensor.turned" in codes_of(w) for w in checked.warnings)
