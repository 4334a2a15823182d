"""Joints refute faults that are not there, and never one that is."""

from collections.abc import Sequence

import numpy as np
import pytest

from handscope.estimators.data.samples import Block
from handscope.estimators.fault_detection.check import _without_explained
from handscope.estimators.fault_detection.finding import Message, Suspicion
from handscope.estimators.fault_detection.neighbours.check_neighbours import prepare_pairs
from handscope.estimators.fault_detection.neighbours.other_joints import Others
from handscope.estimators.hand.anatomy import CHAINS, FINGERS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.recording_checks.check import suspicions_of
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator import daily_movements, free_movement
from tests.estimators.fault_detection.joint_recordings import amplified, delayed, freely_moved

EVER = (-np.inf, np.inf)
LATE, GAIN = 0.1, 1.2


def _others(blocks: Sequence[Block]) -> Others:
    pairs = prepare_pairs(blocks, sized("left"), {}, [])
    assert pairs is not None
    return Others(pairs)


@pytest.mark.parametrize("sensors", [("ring_middle",), CHAINS["index"]])
def test_joints_refute_a_delay_unless_it_is_there(sensors: tuple[str, ...]) -> None:
    intact, late = freely_moved(), delayed(freely_moved(), sensors, LATE)
    assert _others(intact.blocks()).refute_delay(sensors, LATE, EVER)
    assert not _others(late).refute_delay(sensors, LATE, EVER)


@pytest.mark.parametrize("sensor", ["hand", "little_proximal"])
def test_joints_refute_a_gain_unless_it_is_there(sensor: str) -> None:
    intact, wrong = freely_moved(), amplified(freely_moved(), sensor, GAIN)
    assert _others(intact.blocks()).refute_rates(sensor, np.eye(3) / GAIN, EVER)
    assert not _others(wrong).refute_rates(sensor, np.eye(3) / GAIN, EVER)


def test_joints_that_are_odd_for_another_cause_refute_nothing() -> None:
    late = delayed(freely_moved(), ["ring_middle"], LATE)
    assert not _others(late).refute_rates("ring_middle", np.diag([-1.0, 1.0, 1.0]), EVER)


def test_joints_outside_the_span_are_not_asked() -> None:
    others = _others(freely_moved().blocks())
    assert not others.refute_delay(("ring_middle",), LATE, (100.0, 200.0))


@pytest.mark.parametrize("person", [11325, 11326, 11332])
def test_a_hand_that_reaches_is_not_suspected(person: int) -> None:
    """These people's delays and gains, their own or their arm's, are those of fault."""
    hand = "right" if person % 2 == 0 else "left"
    setup = free_movement.Setup(
        person, hand=hand, fingers=FINGERS, duration=24.0, missed=np.radians(3.0)
    )
    reaching, _ = write_and_load(setup, daily_movements.movement("reaching", setup))
    assert [s for s in suspicions_of(reaching) if s.message.severity != "info"] == []


def test_an_accelerometer_whose_gravity_is_off_explains_its_joints() -> None:
    def suspicion(code: str, *sensors: str) -> Suspicion:
        return Suspicion(Message(code, {}, "warning"), sensors, ((0.0, 9.0),), 1e-6)

    size = suspicion("sensor.accelerometer_size", "ring_middle")
    its, other = (
        suspicion("sensors.disagree", *s) for s in (CHAINS["ring"][1:], CHAINS["index"][1:])
    )
    assert _without_explained([size, its, other]) == [size, other]
