"""What an attempt at a task leaves in the recording: its event, and within an accepted one its pauses and phases (docs/extending.md)."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from handscope.app.live.wizard.machine import Order
from handscope.app.protocols import Protocol
from handscope.estimators.data.samples import Event
from handscope.estimators.measures.task_request import PAUSE

UNTOLD: Mapping[str, float] = {}


def events(
    order: Order,
    protocol: Protocol | None,
    trial: int,
    newest: float,
    worn: Mapping[str, float] = UNTOLD,
) -> Iterator[tuple[str, Event]]:
    """Ids ({} is the attempt's number) and events; `trial` counts the accepted ones, `newest` (s) is where a skipped task stands.

    `worn` is told with a task of reaching: how the trunk's sensor is worn.
    """
    accepted, timed = order.reason == "accepted", bool(np.isfinite(order.onset))
    onset, length = (order.onset, order.end - order.onset) if timed else (newest, 0.0)
    yield (
        "task-{}",
        Event(
            onset,
            length,
            "task" if accepted else "annotation",
            _details(order, protocol, trial, accepted, worn),
        ),
    )
    if not accepted or protocol is None:
        return
    for k, (start, to) in enumerate(order.pauses):
        yield (
            f"pause-{{}}-{k}",
            Event(start, to - start, "annotation", {"task_name": order.task, "phase": PAUSE}),
        )
    for k, (start, phase, repetition) in enumerate(
        protocol.marks(order.onset, order.end, order.pauses)
    ):
        marked = {"task_name": order.task, "phase": phase.mark, "repetition": repetition}
        yield f"phase-{{}}-{k}", Event(start, phase.seconds, "annotation", marked)


def _details(
    order: Order, protocol: Protocol | None, trial: int, accepted: bool, worn: Mapping[str, float]
) -> dict[str, Any]:
    details: dict[str, Any] = {"task_name": order.task, "outcome": order.reason}
    if protocol and protocol.mode == "passive":
        details["mode"] = protocol.mode
    if accepted and protocol:
        details |= protocol.details
        if protocol.group == "reach":
            details |= worn
        if protocol.trials > 1:
            details["trial"] = trial
        if protocol.score and order.score is not None:
            details |= {"score": order.score, "score_title": protocol.score.title}
    return details
