"""Assessment plans: which tasks are asked of a patient with a diagnosis, in which order, how often, how long, in which words.

One JSON file each in this folder; a clinic's own versions are stored in the database (sessions/assessment_plans) and
go from house to house as the same files. The fields are those of `Plan`.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from handscope.app.input_mistakes import describe_mistake
from handscope.app.protocols import STRICT, Count, Line, Protocol, Seconds, Word
from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import with_code

LARGEST = 40  # tasks of a plan
Words = Annotated[str, Field(max_length=300)]


@dataclass(frozen=True, kw_only=True)
class PlannedTask:
    """A task of a plan, with what differs from the task's own file."""

    __pydantic_config__ = STRICT

    task: Word
    trials: Count | None = None
    seconds: Seconds | None = None  # of a task that ends by time
    repetitions: Count | None = None  # of a paced task
    title: Words = ""
    instruction: Words = ""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is asked of a patient with a diagnosis."""

    __pydantic_config__ = STRICT

    name: Word
    version: Annotated[int, Field(ge=1)] = 1
    title: Line
    sources: Annotated[tuple[Line, ...], Field(min_length=1, max_length=20)]
    note: Annotated[str, Field(max_length=600)] = ""  # what to mind before it begins
    tasks: Annotated[tuple[PlannedTask, ...], Field(min_length=1, max_length=LARGEST)]


_READER = TypeAdapter(Plan)


@cache
def built_in() -> Mapping[str, Plan]:
    """The plans of this folder by name, by title."""
    inside = [e for e in files(__name__).iterdir() if e.name.endswith(".json")]
    plans = [_with_codes(_READER.validate_json(entry.read_text("utf-8"))) for entry in inside]
    return {p.name: p for p in sorted(plans, key=lambda p: p.title)}


def _with_codes(p: Plan) -> Plan:
    sources = tuple(
        with_code(f"plan_source.{p.name}_{k + 1}", source) for k, source in enumerate(p.sources)
    )
    title, note = (
        with_code(f"plan_title.{p.name}", p.title),
        with_code(f"plan_note.{p.name}", p.note),
    )
    return replace(p, title=title, note=note, sources=sources)


def plan_of(content: Any, protocols: Mapping[str, Protocol] | None) -> Plan:
    """A plan from a file's content, checked against the tasks there are, where they are given; InputError names the field."""
    try:
        plan = _READER.validate_json(json.dumps(content))
    except ValidationError as problem:
        first = problem.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(
            "plan.invalid", field=where or "plan", problem=describe_mistake(first)
        ) from None
    for error in _mistakes(plan, protocols) if protocols is not None else ():
        raise error
    return plan


def content_of(plan: Plan) -> dict[str, Any]:
    """A plan as its file holds it; what a task leaves as it is does not stand in it."""
    content = asdict(plan)
    tasks = [{key: value for key, value in task.items() if value} for task in content["tasks"]]
    return {**content, "sources": list(plan.sources), "tasks": tasks}


def named(plan: Plan) -> dict[str, Any]:
    """What a session and its recording say of their plan."""
    return {"name": plan.name, "version": plan.version, "title": plan.title}


def applied(plan: Plan, protocols: Mapping[str, Protocol]) -> dict[str, Protocol]:
    """The tasks with the plan's in its order as the usual assessment; tasks that are gone are left out."""
    chosen = {t.task: _apply_plan(protocols[t.task], t) for t in plan.tasks if t.task in protocols}
    others = {
        name: replace(p, routine=False) for name, p in protocols.items() if name not in chosen
    }
    return {**chosen, **others}


def _apply_plan(protocol: Protocol, planned: PlannedTask) -> Protocol:
    return replace(
        protocol,
        routine=True,
        trials=planned.trials or protocol.trials,
        duration=planned.seconds or protocol.duration,
        repetitions=planned.repetitions or protocol.repetitions,
        title=planned.title or protocol.title,
        instruction=planned.instruction or protocol.instruction,
    )


def _mistakes(plan: Plan, protocols: Mapping[str, Protocol]) -> Iterator[InputError]:
    names = [t.task for t in plan.tasks]
    for k, planned in enumerate(plan.tasks):
        protocol = protocols.get(planned.task)
        if protocol is None:
            yield InputError("plan.unknown_task", task=planned.task)
        elif planned.task in names[:k]:
            yield InputError("plan.task_twice", task=planned.task)
        elif planned.seconds and protocol.duration is None:
            yield InputError("plan.not_timed", task=planned.task)
        elif planned.repetitions and not protocol.cycle:
            yield InputError("plan.not_paced", task=planned.task)
