"""All measures of a recording: what each task gives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from handscope.estimators.data.samples import Event
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import MEASURES
from handscope.estimators.measures.accuracy import DEFAULT, Accuracy, with_sd
from handscope.estimators.measures.figure import Figure
from handscope.estimators.measures.plot_data import NOTHING, PlotData
from handscope.estimators.measures.task_request import TaskRequest, parse_request


@dataclass(frozen=True)
class TaskResult:
    """One measure of one task performed."""

    task: str
    measure: str  # a name of MEASURES
    onset: float  # s
    end: float  # s
    details: Any  # what the measure's `measure` gave
    figures: tuple[Figure, ...]
    shown: PlotData = NOTHING  # what to draw of it
    sd_basis: str = ""  # where the figures' standard deviations come from


def assess(
    trajectory: Trajectory,
    events: Sequence[Event],
    geometry: HandGeometry | None = None,
    accuracy: Accuracy = DEFAULT,
    options: Mapping[str, Any] | None = None,
) -> list[TaskResult]:
    """Apply every measure to every task that it applies to; without any task, to the whole recording. `options` are Params by measure.

    A task with the detail `excluded` is left out, and of a task the stretches (start, stop) s in its detail `left_out` and its pauses.
    """
    declared = [e for e in events if e.trial_type == "task"]
    tasks = [e for e in declared if not e.details.get("excluded")]
    if not declared and len(trajectory):
        tasks = [
            Event(
                float(trajectory.t[0]),
                float(trajectory.t[-1] - trajectory.t[0]),
                "task",
                {"task_name": "whole recording"},
            )
        ]
    known, basis = with_sd(trajectory, accuracy)
    results = []
    for event in tasks:
        asked = parse_request(event, events)
        counted = known.without([*event.details.get("left_out", ()), *asked.pauses])
        for name in requested_measures(asked):
            module = MEASURES[name]
            params = (options or {}).get(name) or module.Params()
            details = module.measure(params, counted, event.onset, event.end, geometry, asked)
            figures = tuple(module.figures(details))
            results.append(
                TaskResult(
                    asked.task,
                    name,
                    event.onset,
                    event.end,
                    details,
                    figures,
                    module.shown(details),
                    basis,
                )
            )
    return results


def requested_measures(asked: TaskRequest) -> list[str]:
    """The measures that the event's `measures` name (a list, or words); without that, those that apply to a task of that name."""
    named = asked.details.get("measures")
    if named is None:
        return [name for name, module in MEASURES.items() if module.applies(asked.task)]
    wanted = named.replace(",", " ").split() if isinstance(named, str) else [str(n) for n in named]
    return [name for name in MEASURES if name in wanted]
