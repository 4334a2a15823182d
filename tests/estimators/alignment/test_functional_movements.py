"""Each step measured for itself: good ones have no problem, bad ones a sentence that says what to
do."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.estimators.alignment import functional_movements
from handscope.estimators.alignment.functional_movements import STEPS, CalibrationMovement
from handscope.estimators.data.samples import Block
from handscope.estimators.hand.geometry import sized
from handscope.estimators.methods import m2
from handscope.estimators.simulation.motion import make_posture, move_through
from handscope.estimators.simulation.movements import functional_calibration
from handscope.estimators.simulation.movements.functional_calibration import Carelessness
from handscope.estimators.simulation.movements.task_performance import Performance, flat, relaxed
from handscope.estimators.simulation.scenario import Simulated, simulate_performances
from tests.estimators.alignment.functional import ANYHOW, done, pieces
from tests.simulated import DEG

PARAMS = m2.Params()


def measured(performance: Performance, change: "object" = None) -> CalibrationMovement:
    """The one step of a performance."""
    rng = np.random.default_rng(9)
    made: Simulated = simulate_performances([performance], "left", sized("left"), rng, ANYHOW)
    (event,) = made.events
    blocks = list(made.samples.values())
    if callable(change):
        blocks = [change(b) for b in blocks]
    bias = dict(zip(made.sensors.segments, made.sensors.bias[:, :3]))
    return functional_movements.measure(
        PARAMS, event.trial_type, blocks, event.onset, event.end, bias
    )


def bent_to(step: str, times: int = 3, half: float = 1.4, **degrees: float) -> Performance:
    """From flat there and back, exactly so."""
    bent = make_posture(flat(), **degrees)
    points = [(0.0, relaxed()), (1.5, flat()), (1.8, flat())]
    points += [(1.8 + (k + 1) * half, bent if k % 2 == 0 else flat()) for k in range(2 * times)]
    event = functional_calibration._step(
        step, np.linspace(0, 1, 51), np.tile(flat(), (51, 1)), {}
    ).events[0]
    return Performance(
        move_through([*points, (points[-1][0] + 1.5, relaxed())]),
        (replace(event, duration=points[-1][0] - 1.5 + 0.2),),
    )


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("hand", ["left", "right"])
def test_an_ordinary_step_has_no_problem(step: str, hand: "object") -> None:
    piece = pieces(done(hand))[step]  # type: ignore[arg-type]
    assert piece.problems == ()
    assert piece.quality


def _one(piece: CalibrationMovement) -> str:
    (problem,) = piece.problems
    return problem


def test_a_flexion_with_sideways_movement_is_not_in_one_plane() -> None:
    mcp = {f"{f}_mcp_flexion": 45.0 for f in ("index", "middle", "ring", "little")}
    there = make_posture(flat(), **mcp)
    aside = {f"{f}_mcp_deviation": 30.0 for f in ("index", "middle", "ring", "little")}
    back = make_posture(flat(), **aside)
    points = [
        (0.0, relaxed()),
        (1.5, flat()),
        *((1.5 + 1.4 * (k + 1), (there, back, flat())[k % 3]) for k in range(9)),
    ]
    event = bent_to("flexion_mcp", **mcp).events[0]
    piece = measured(
        Performance(
            move_through([*points, (points[-1][0] + 1.5, relaxed())]),
            (replace(event, duration=points[-1][0] - 1.5),),
        )
    )
    assert "the MCP flexion at 1.5 s was not in one plane (" in _one(piece)
    assert _one(piece).endswith("%): rest the other joints and repeat it")
    assert piece.quality["planarity"] < 0.9


def test_a_small_flexion_is_to_be_done_further() -> None:
    piece = measured(
        bent_to(
            "flexion_mcp",
            **{f"{f}_mcp_flexion": 12.0 for f in ("index", "middle", "ring", "little")},
        )
    )
    assert "was small (" in _one(piece)
    assert "bend further and repeat it" in _one(piece)


def test_a_single_flexion_is_to_be_done_three_times() -> None:
    piece = measured(bent_to("flexion_thumb_ip", times=1, thumb_ip_flexion=60.0))
    assert "was done once (thumb_distal): bend and stretch three times" in _one(piece)


def test_a_hand_that_moves_along_is_told_to_rest() -> None:
    mcp = {f"{f}_mcp_flexion": 60.0 for f in ("index", "middle", "ring", "little")}
    piece = measured(bent_to("flexion_mcp", **mcp, forearm_flexion=35.0))
    assert "the hand moved with the MCP flexion" in _one(piece)
    assert "rest the hand and repeat it" in _one(piece)


def test_repetitions_about_different_axes_are_told() -> None:
    rng = np.random.default_rng(2)
    step = functional_calibration.flexion_thumb_ip(
        sized("left"), rng, Carelessness(pose=0.0, divergence=0.0, joints=0.0, hand=0.0)
    )

    def twist(block: Block) -> Block:
        """The sensor slips round by 25 deg after the second repetition."""
        values = block.values.copy()
        k, late = (
            block.stream.sensors.index("thumb_distal"),
            block.t > 1.5 + 0.3 + 4 * functional_calibration.HALF,
        )
        turn = np.array(
            [
                [np.cos(25 * DEG), -np.sin(25 * DEG), 0],
                [np.sin(25 * DEG), np.cos(25 * DEG), 0],
                [0, 0, 1],
            ]
        )
        values[late, k, :3] = values[late, k, :3] @ np.roll(np.roll(turn, 1, 0), 1, 1).T
        return replace(block, values=values)

    assert "was not the same each time (thumb_distal:" in _one(measured(step, twist))


def test_a_hand_that_is_not_still_is_told_by_its_worst_sensor() -> None:
    step = functional_calibration.flat_hand(sized("left"), np.random.default_rng(3), Carelessness())

    def tremble(block: Block) -> Block:
        values = block.values.copy()
        values[:, block.stream.sensors.index("ring_middle"), 1] += np.where(
            block.t > 3.0, 6 * DEG, 0.0
        )
        return replace(block, values=values)

    problem = _one(measured(step, tremble))
    assert problem.startswith("the flat hand at 1.5 s was not still (ring_middle turned at")
    assert problem.endswith("lay it down and repeat it")


def test_a_figure_of_eight_about_one_axis_tells_too_little() -> None:
    points = [(0.0, relaxed()), (1.5, flat())]
    points += [
        (1.5 + 0.8 * (k + 1), make_posture(flat(), forearm_deviation=25.0 * (-1) ** k))
        for k in range(6)
    ]
    eight = functional_calibration.figure_eight(
        sized("left"), np.random.default_rng(1), Carelessness()
    )
    piece = measured(Performance(move_through([*points, (7.8, relaxed())]), eight.events))
    assert any(
        "was nearly about one axis" in p and "tilt and turn the hands" in p for p in piece.problems
    )


def test_fingers_that_move_in_the_figure_of_eight_are_named() -> None:
    eight = functional_calibration.figure_eight(
        sized("left"), np.random.default_rng(1), Carelessness(joints=60.0)
    )
    assert any(
        "moved on the hand in the figure of eight" in p and "press the hands together" in p
        for p in measured(eight).problems
    )


@pytest.mark.parametrize("step", ["flat_hand", "flexion_mcp", "figure_eight"])
def test_a_step_without_samples_is_to_be_recorded_again(step: str) -> None:
    piece = functional_movements.measure(
        PARAMS, step, list(done("left").samples.values()), 5000.0, 5004.0, {}
    )
    assert "record it again" in _one(piece)


def test_a_sensor_that_misses_many_samples_has_no_axis() -> None:
    step = functional_calibration.flexion_mcp(
        sized("left"), np.random.default_rng(4), Carelessness()
    )

    def silent(block: Block) -> Block:
        values = block.values.copy()
        values[200:400, block.stream.sensors.index("ring_distal")] = np.nan
        return replace(block, values=values)

    piece = measured(step, silent)
    assert piece.problems == ()
    assert "ring_distal" not in piece.bent
    assert "ring_middle" in piece.bent
