"""Lengths and mountings that were known before: they speak where movement does not, and give way where they are wrong."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import messages as self_calibration_messages
from handscope.estimators.self_calibration import segments, solver
from handscope.estimators.self_calibration.problem import Noise, Problem, Unknowns, with_lengths
from handscope.estimators.self_calibration.result import Finger
from handscope.estimators.self_calibration.segments import Segments
from handscope.estimators.self_calibration.solver import Limits, Solution
from handscope.estimators.self_calibration.uncertainty import monte_carlo
from handscope.estimators.simulation.artificial_finger import HINGES, SEGMENTS
from handscope.estimators.simulation.scenario import Simulated
from tests.estimators.self_calibration.fingers import cold, recorded

MEASURED = Noise(length=0.2)  # mm


def _quick() -> tuple[Problem, Unknowns]:
    return cold(_between(2.5, 6.0), MEASURED)


def _between(start: float, stop: float) -> Simulated:
    made = recorded(1, 16.0)
    return replace(made, samples={"imu": made.samples["imu"].between(start, stop)})


def _segments(problem: Problem, guess: Unknowns) -> Segments:
    return segments.of_solution(
        solver.solve_with_noise(problem, guess), "left", recorded(1, 16.0).mounting
    )


def test_measured_lengths_make_a_short_recording_sure() -> None:
    problem, guess = _quick()
    told = _segments(with_lengths(problem, dict.fromkeys(SEGMENTS, HINGES)), guess)
    alone = _segments(problem, guess)
    for name in SEGMENTS[1:3]:
        assert told.lengths[name] == pytest.approx(HINGES, abs=0.5e-3)
        assert told.lengths_sd[name] < 0.8 * alone.lengths_sd[name]


@pytest.mark.slow
def test_a_length_that_was_measured_wrongly_and_a_mounting_that_is_not_so_give_way() -> None:
    """0.2 mm was said, it is 12 mm; sensors are said to sit within 5 deg, and sit 40 deg off."""
    problem, guess = cold(_between(2.5, 9.0), MEASURED)
    wrong = with_lengths(
        _mounted_otherwise(problem, quat.about(0, np.radians(40.0))), {SEGMENTS[1]: 0.042}
    )
    found = solver.solve_with_noise(wrong, guess)
    told = segments.of_solution(found, "left", recorded(1, 16.0).mounting)
    assert found.outcome == "converged"
    assert found.problem.length_sd[1] > 0.008
    assert (np.degrees(found.problem.mounting_sd) > 25.0).sum() >= 3
    for name in SEGMENTS[1:3]:
        assert told.lengths[name] == pytest.approx(HINGES, rel=0.01)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("row", [1, 2])
def test_a_sensor_put_on_the_other_way_round_is_seated_by_its_bone_and_its_neighbours(
    solved: Solution, row: int, axis: int
) -> None:
    nominal = recorded(1, 16.0).mounting
    name, told = SEGMENTS[row], segments.of_solution(solved, "left", nominal)
    turned = {**nominal, name: quat.multiply(quat.about(axis, np.pi), np.asarray(nominal[name]))}
    round_ = segments.of_solution(solved, "left", turned)
    for segment, q in told.q_BS.items():
        assert quat.angle(quat.relative(q, round_.q_BS[segment])) < 1e-6
    to_sensor = quat.conjugate(turned[name])
    problem = replace(
        solved.problem, flexing=solved.problem.flexing.copy(), distal=solved.problem.distal.copy()
    )
    problem.flexing[row], problem.distal[row] = (
        quat.rotate(to_sensor, np.eye(3)[k]) for k in (2, 1)
    )
    worn = Finger("index", np.zeros(1), replace(solved, problem=problem), round_, None)  # type: ignore[arg-type]
    (said,) = self_calibration_messages._describe_reversed_sensors(worn)
    assert said.startswith(f"the sensor of {name} sits 1")
    assert (
        self_calibration_messages._describe_reversed_sensors(
            replace(worn, solution=solved, segments=told)
        )
        == []
    )


def test_a_hand_whose_sensor_sits_the_other_way_round_is_refused(solved: Solution) -> None:
    told = segments.of_solution(solved, "left", recorded(1, 16.0).mounting)
    self_calibration_messages.require_possible(Finger("index", np.zeros(1), solved, told, None))  # type: ignore[arg-type]
    for axis in range(3):
        turned = {**told.q_GB, "hand": quat.multiply(told.q_GB["hand"], quat.about(axis, np.pi))}
        with pytest.raises(
            InputError, match="as the sensor of hand is said to sit, index_mcp would be bent"
        ):
            self_calibration_messages.require_possible(
                Finger("index", np.zeros(1), solved, replace(told, q_GB=turned), None)
            )  # type: ignore[arg-type]


def _mounted_otherwise(problem: Problem, q: Array) -> Problem:
    return replace(
        problem, flexing=quat.rotate(q, problem.flexing), distal=quat.rotate(q, problem.distal)
    )


def test_a_hand_mounted_otherwise_has_its_skin_pulled_from_another_zero(
    with_skin: Solution,
) -> None:
    """By 12 deg about the MCP joint's axis: where the next sensor's joints and hinge lie follows from how soft its skin is."""
    before, links, turn = with_skin.problem, with_skin.problem.chain, np.radians(12.0)
    distal = before.distal.copy()
    distal[0] = quat.rotate(quat.exp(turn * before.flexing[0]), distal[0])
    other = solver.solve(replace(before, distal=distal), with_skin.at, Limits(iterations=4)).at
    zero = monte_carlo.straighten(other, links, np.array([-turn, 0.0, 0.0]))
    for name in ("near", "far", "axis_far"):
        here, there, back = (
            getattr(at, name)[1 if name != "near" else 0] for at in (with_skin.at, other, zero)
        )
        assert np.linalg.norm(back - here) < 0.3 * np.linalg.norm(there - here)
