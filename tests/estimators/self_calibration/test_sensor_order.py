"""Sensors that were exchanged are named where movement shows it; of a recording in its own order, slipped sensor or not, nothing is said."""

from dataclasses import replace

import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.self_calibration import messages as self_calibration_messages
from handscope.estimators.self_calibration import mounting_shift, sensor_order
from handscope.estimators.self_calibration.problem import Noise, Problem, Readings
from handscope.estimators.self_calibration.result import Requirements
from handscope.estimators.self_calibration.solver import Solution
from tests.estimators.self_calibration.fingers import (
    DURATION,
    HINGED,
    cold,
    readings,
    recorded,
    slipped,
)


@pytest.fixture(scope="module")
def problem() -> Problem:
    return cold(recorded(1, DURATION))[0]


def _sitting(read: Readings, rows: list[int]) -> Readings:
    return replace(read, gyr=read.gyr[:, rows], acc=read.acc[:, rows])


@pytest.mark.parametrize("rows", [[0, 2, 1, 3], [0, 3, 2, 1], [3, 1, 2, 0]])
def test_exchanged_sensors_are_named_and_nothing_else_is_said(
    problem: Problem, rows: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    read = _sitting(readings(recorded(1, DURATION)), rows)
    assert sensor_order.find_sensor_order(HINGED, Noise(), read, problem.flexing) == tuple(
        HINGED.sensors[k] for k in rows
    )
    monkeypatch.setattr(mounting_shift, "find_mounting_shifts", lambda *others: [])
    found = Solution(None, problem, "not converged", (), None)  # type: ignore[arg-type]
    elsewhere = [HINGED.sensors[k] for k in range(4) if rows[k] != k]
    with pytest.raises(
        InputError,
        match=f"index: the sensors of {elsewhere[0]} and {elsewhere[1]} seem to be exchanged",
    ):
        self_calibration_messages.require_one_minimum(Requirements(), "index", read, found)


@pytest.mark.parametrize("seed", [1, 2])
def test_sensors_in_their_order_are_left_alone(problem: Problem, seed: int) -> None:
    made = recorded(seed, DURATION)
    for one in (made, *(slipped(made, row, 25.0) for row in (1, 2))):
        assert sensor_order.find_sensor_order(HINGED, Noise(), readings(one), problem.flexing) == ()
