"""All measures of a recording: what each task gives."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from estimators.measures import MEASURES
from estimators.measures.figure import Figure
from estimators.samples import Event
from estimators.trajectory import Trajectory


@dataclass(frozen=True)
class TaskResult:
    """One measure of one task performed."""

    task: str
    measure: str  # a name of MEASURES
    onset: float  # s
    end: float  # s
    details: Any  # what the measure's `measure` gave
    figures: tuple[Figure, ...]


def assess(trajectory: Trajectory, events: Sequence[Event]) -> list[TaskResult]:
    """Apply every measure to every task that it applies to; without any task, to the whole recording.

    A task with the detail `excluded` is left out, and of a task the stretches (start, stop) s in its detail `left_out`.
    """
    told = [e for e in events if e.trial_type == "task"]
    tasks = [e for e in told if not e.details.get("excluded")]
    if not told and len(trajectory):
        tasks = [Event(float(trajectory.t[0]), float(trajectory.t[-1] - trajectory.t[0]), "task", {"task_name": "whole recording"})]
    results = []
    for event in tasks:
        task, counted = str(event.details.get("task_name", "task")), trajectory.without(event.details.get("left_out", ()))
        for name, module in MEASURES.items():
            if module.applies(task):
                details = module.measure(module.Params(), counted, event.onset, event.end)
                results.append(TaskResult(task, name, event.onset, event.end, details, tuple(module.figures(details))))
    return results
