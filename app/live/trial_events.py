"""The events of an attempt at a task, the task and, if accepted, its pauses and phases (docs/extending.md), and of an initial pose."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from handscope.app.live.wizard.effects import KeepAttempt
from handscope.app.protocols import Protocol
from handscope.estimators.alignment.initial_pose import THERAPIST, Pose, pose_of
from handscope.estimators.data.samples import Event
from handscope.estimators.hand.anatomy import ANGLES
from handscope.estimators.measures.task_request import PAUSE
from handscope.estimators.simulation.movements.task_performance import POSE_THUMB

# s after a word until fingertips touch, and before the next when they part
CLOSING, LEAVING = 2.0, 0.3
THUMB_COLUMNS = tuple(f"thumb_cmc_{name}_deg" for name in ANGLES)  # of a pose's event
NO_TRUNK_DETAILS: Mapping[str, float] = {}


def pose_details(measured: Mapping[str, float], passive: bool, repetition: int) -> dict[str, Any]:
    """Details of the event of a pose whose angles (deg) were measured, held by the therapist where it is `passive`."""
    thumb = dict(zip(THUMB_COLUMNS, POSE_THUMB))
    held_by = {"held_by": THERAPIST} if passive else {}
    again = {"repetition": repetition} if repetition > 1 else {}
    return {**thumb, **measured, **held_by, **again}


def pose_with(details: Mapping[str, Any], onset: float = 0.0, length: float = 0.0) -> Pose:
    """The pose with these details of its event; onset and length in s."""
    return pose_of(Event(onset, length, "initial_pose", dict(details)))


def events(
    effect: KeepAttempt,
    protocol: Protocol | None,
    trial: int,
    newest: float,
    trunk: Mapping[str, float] = NO_TRUNK_DETAILS,
) -> Iterator[tuple[str, Event]]:
    """Ids ({} is the attempt's number) and events of an attempt.

    `trial` counts accepted attempts; `newest` (s) is the time of a skipped task; `trunk` are details of the
    trunk's sensor, stored with a reach.
    """
    accepted, timed = effect.outcome == "accepted", bool(np.isfinite(effect.onset))
    onset, length = (effect.onset, effect.end - effect.onset) if timed else (newest, 0.0)
    yield (
        "task-{}",
        Event(
            onset,
            length,
            "task" if accepted else "annotation",
            _details(effect, protocol, trial, accepted, trunk),
        ),
    )
    if not accepted or protocol is None:
        return
    for k, (start, to) in enumerate(effect.pauses):
        yield (
            f"pause-{{}}-{k}",
            Event(start, to - start, "annotation", {"task_name": effect.task, "phase": PAUSE}),
        )
    for k, (start, phase, repetition) in enumerate(
        protocol.marks(effect.onset, effect.end, effect.pauses)
    ):
        marked = {"task_name": effect.task, "phase": phase.mark, "repetition": repetition}
        yield f"phase-{{}}-{k}", Event(start, phase.seconds, "annotation", marked)
        if phase.contacts:
            held = {"task_name": effect.task, "contacts": phase.contacts}
            length = max(phase.seconds - CLOSING - LEAVING, 0.0)
            yield f"contact-{{}}-{k}", Event(start + CLOSING, length, "contact", held)


def _details(
    effect: KeepAttempt,
    protocol: Protocol | None,
    trial: int,
    accepted: bool,
    trunk: Mapping[str, float],
) -> dict[str, Any]:
    details: dict[str, Any] = {"task_name": effect.task, "outcome": effect.outcome}
    if protocol and protocol.mode == "passive":
        details["mode"] = protocol.mode
    if accepted and protocol:
        details |= protocol.details
        if protocol.group == "reach":
            details |= trunk
        if protocol.trials > 1:
            details["trial"] = trial
        if protocol.score and effect.score is not None:
            details |= {"score": effect.score, "score_title": protocol.score.title}
    return details
