"""Kortier's chapter 3: the tasks stand in their groups, and what is said of them stands beside the study's figures and our targets."""

from handscope.estimators.simulation.movements.powerglove_tasks import MOVEMENTS
from handscope.validation.papers import kortier3, published
from handscope.validation.papers.kortier3 import FAST_GROUPS, GROUPS, TASKS, WITH, Found
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.experiments import Trial


def test_the_fifteen_tasks_are_in_their_groups() -> None:
    assert [int(name.split("_")[1]) for name in TASKS] == list(range(1, 16))
    assert [len(TASKS[where]) for where, _ in GROUPS.values()] == [9, 4, 1, 1]
    assert TASKS[13] in MOVEMENTS and "sideways" in TASKS[13]


def test_sensors_sit_up_to_thirty_degrees_off() -> None:
    turned = [
        kortier3.MOUNTED.misalignment + sign * kortier3.MOUNTED.misalignment_width
        for sign in (-1, 1)
    ]
    assert turned == [0.0, 30.0]


def test_targets_are_three_degrees_for_slow_and_five_for_fast_tasks() -> None:
    figures = {
        **dict.fromkeys(GROUPS, 4.0),
        **{f"{g} without offset": 1.0 for g in GROUPS},
        "fast PIP": 5.0,
        "amplitude": 20.0,
        "amplitude's range": 2.0,
        "consistency": 1.0,
    }
    found = kortier3.finding(
        Wanted(seeds=1), [(Trial("powerglove", 0), Found(dict.fromkeys(WITH, figures)))]
    )
    met = {v.what.split(",")[0]: v.met for v in found.verdicts}
    assert {group for group, ok in met.items() if ok} == set(FAST_GROUPS)
    beside = {row.name: row.theirs.get(WITH[0]) for row in found.tables[0].rows}
    assert beside["ab/adduction (14)"] == published.KORTIER_TASKS["ab/adduction (14)"] == 3.3
