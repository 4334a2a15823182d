"""The table of ranges takes the furthest of the tasks that asked for an angle."""

import math
from dataclasses import replace

import numpy as np
import pytest

from handscope.app.language import ENGLISH
from handscope.app.report.content import Task
from handscope.app.report.sections.range_rows import (
    RangeRow,
    asks_full_range,
    by_task,
    over_tasks,
    range_rows,
)
from handscope.estimators.measures.assessment import TaskResult
from handscope.estimators.measures.range_of_motion import Range
from tests.app.report.simulated_sessions import report, session


def task(asked: frozenset[str] | None, *ranges: Range) -> Task:
    return Task(
        TaskResult("rom", "range_of_motion", 0.0, 1.0, list(ranges), ()),
        "Rom",
        "Range of motion",
        asked,
    )


def pip(smallest: float, largest: float, grade: str = "good", reason: str = "") -> Range:
    return Range(
        "index_pip",
        "flexion",
        math.radians(largest),
        math.radians(smallest),
        0.0,
        0.0,
        grade,
        reason,
    )  # type: ignore[arg-type]


def table(ranges: list[Range]) -> dict[tuple[str, str], RangeRow]:
    return {(r.group, r.joint): r for r in range_rows(ranges, full=True, language=ENGLISH)}


def test_the_furthest_of_several_tasks_counts() -> None:
    (furthest,) = over_tasks([task(None, pip(5, 80)), task(None, pip(10, 95))])
    np.testing.assert_allclose(
        np.degrees([furthest.smallest, furthest.largest]), [5, 95], atol=1e-9
    )


def test_trials_of_a_task_stand_together_in_the_order_of_the_tasks() -> None:
    done = ["open_close", "powerglove_01_index_mcp", "open_close", "rest"]
    trials = [
        replace(task(None), result=replace(task(None).result, task=name, onset=float(k)))
        for k, name in enumerate(done)
    ]
    assert [[t.result.onset for t in group] for group in by_task(trials)] == [
        [0.0, 2.0],
        [1.0],
        [3.0],
    ]
    assert by_task([]) == []


def test_a_task_that_did_not_ask_for_the_joint_does_not_count() -> None:
    asked, other = frozenset({"index_pip_flexion"}), frozenset({"wrist_flexion"})
    (furthest,) = over_tasks([task(asked, pip(5, 80)), task(other, pip(-20, 119))])
    np.testing.assert_allclose(
        np.degrees([furthest.smallest, furthest.largest]), [5, 80], atol=1e-9
    )
    assert over_tasks([task(other, pip(-20, 119))]) == []


def test_the_grade_is_the_worse_of_the_tasks_that_gave_the_ends() -> None:
    good, poor = task(None, pip(5, 80)), task(None, pip(10, 95, "poor", "samples missing"))
    (furthest,) = over_tasks([good, poor])
    assert (furthest.grade, furthest.reason) == ("poor", "samples missing")
    stretched = task(None, pip(-5, 70, "fair", "bridged"))
    assert (over_tasks([good, stretched])[0].grade, over_tasks([poor, stretched])[0].reason) == (
        "fair",
        "samples missing; bridged",
    )
    inner = task(None, pip(10, 70, "poor", "samples missing"))
    assert over_tasks([good, inner])[0].grade == "good"


def test_a_row_is_as_poor_as_its_worse_angle() -> None:
    side = Range("index_mcp", "deviation", 0.1, -0.1, 0.0, 0.0, "fair", "bridged")
    bend = replace(pip(0, 90), joint="index_mcp")
    (row,) = range_rows([bend, side], full=True, language=ENGLISH)
    assert (row.grade, row.reasons) == ("fair", ("bridged",))


def test_every_joint_of_a_whole_hand_has_a_row_and_the_thumbs_rotation_one_more() -> None:
    rows = table(over_tasks([t for t in report().tasks if t.result.measure == "range_of_motion"]))
    assert len(rows) == 17
    assert rows["Wrist", ""].extension == "45°"
    assert rows["Thumb", "CMC turn"].sideways.endswith("pronation")
    assert rows["Middle", "MCP"].sideways == ""  # no task asks the middle finger aside


@pytest.mark.parametrize("hand", ["left", "right"])
def test_the_movement_that_was_made_is_read_off_on_either_hand(hand: str) -> None:
    """Postures of the simulated tasks: fist 80/95/60, stretch -12, spread 17 and 40, wrist 50/-45; 5 deg is what misaligned sensors cost."""
    tasks = report(session(hand=hand)).tasks  # type: ignore[arg-type]
    ranges = {
        (r.joint, r.angle): r
        for r in over_tasks([t for t in tasks if t.result.measure == "range_of_motion"])
    }
    for joint, angle, low, high in (
        ("index_pip", "flexion", 0, 95),
        ("ring_dip", "flexion", 0, 60),
        ("middle_mcp", "flexion", -12, 80),
        ("wrist", "flexion", -45, 50),
        ("wrist", "deviation", -15, 25),
        ("index_mcp", "deviation", -17, 0),
        ("little_mcp", "deviation", 0, 40),
        ("thumb_ip", "flexion", -10, 65),
    ):
        r = ranges[joint, angle]
        np.testing.assert_allclose(
            np.degrees([r.smallest, r.largest]), [low, high], atol=5.0, err_msg=f"{joint} {angle}"
        )


@pytest.mark.parametrize(
    ("name", "full"),
    [
        ("rom", True),
        ("rom_fist", True),
        ("Range of motion", True),
        ("open_close", False),
        ("room", False),
    ],
)
def test_a_tasks_name_tells_whether_it_asked_for_the_full_range(name: str, full: bool) -> None:
    assert asks_full_range(name) is full
