"""The wizard's part of a station's snapshot: texts, possible actions, tasks."""

from typing import Any

from handscope.app.live.wizard import machine
from handscope.app.live.wizard.machine import State, StationStatus, Wizard
from handscope.app.live.wizard.texts import STEP_OF, STEPS, title_and_sentence
from handscope.app.protocols import Protocol
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.files import sensor_corrections


def wizard_snapshot(w: Wizard, status: StationStatus) -> dict[str, Any]:
    """State of the wizard for a page: texts, possible actions, tasks, and the metronome's pace."""
    protocol = w.protocol
    in_task = w.state in (
        State.TASK_READY,
        *machine.COUNTING,
        *machine.RUNNING,
        State.STEP_READY,
        State.FREE_READY,
    )
    title, words = (
        (protocol.title, protocol.instruction)
        if in_task and protocol and status.is_recording
        else title_and_sentence(w, status)
    )
    steps = [p.name for p in w.steps_offered(status)] if w.state in machine.STEPPING else []
    if in_task and w.task in steps and status.is_recording:
        title = phrase("wizard.step_of", k=steps.index(w.task) + 1, n=len(steps), title=title)
    return {
        "state": w.state,
        "step": STEP_OF.get(w.state, "tasks"),
        "steps": [{"name": name, "title": text} for name, text in STEPS],
        "title": title,
        "instruction": words,
        "message": w.message,
        "proposal": w.proposal(status),
        "check": _check(w, status),
        "mend": _mend(w),
        "passive": w.passive,
        "mode": protocol.mode if in_task and protocol else "active",
        "actions": w.allowed(status),
        "progress": round(machine.progress_share(w, status), 3),
        "remaining": None
        if (left := machine.remaining_time(w, status)) is None
        else round(left, 2),
        "still": status.angular_rate_peak <= machine.STILL_RATE,
        "fastest_segment": status.fastest_segment,
        "task": w.task,
        "following": {"name": following.name, "title": following.title}
        if (following := w.following(status))
        else None,
        "tasks": [_task(w, p) for p in w.listed(status)],
        "group": w.group,
        "groups": [_group(w, name, tasks) for name, tasks in w.groups(status).items()],
        "calibration_steps": [_step(w, p) for p in w.steps_offered(status)]
        if w.state in machine.STEPPING
        else [],
        "score": _score(protocol) if w.state is State.TASK_REVIEW and protocol else None,
        "pace": _pace(w, protocol, status) if in_task and protocol else None,
    }


def _step(w: Wizard, p: Protocol) -> dict[str, Any]:
    """A step of the calibration and its outcome: good, spoilt, used (in an earlier calibration), or none yet."""
    judged = w.judgement(p.name)
    outcome = (
        ("spoilt" if judged.problems else "good") if judged else "used" if p.name in w.used else ""
    )
    return {"name": p.name, "title": p.title, "outcome": outcome}


def _check(w: Wizard, status: StationStatus) -> dict[str, Any] | None:
    """The sensor check: the requested finger, whose strip moved for each finger, which strips are exchanged."""
    if w.state not in (State.CONNECT, State.CHECK, State.CHECKED, State.POSE_REVIEW):
        return None
    return {
        "fingers": w.checkable(status),
        "asked": w.asked(status),
        "calm": w.calm,
        "moved": dict(w.seen) if w.state in (State.CHECK, State.CHECKED) else {},
        "exchange": [
            {"strip": strip, "finger": finger} for strip, finger in w.exchangeable().items()
        ],
    }


def _mend(w: Wizard) -> dict[str, Any] | None:
    """The correction that is offered: exchange or gyroscope, and of which sensors."""
    if w.state is not State.CONNECT or not w.mend:
        return None
    correction = sensor_corrections.parse(w.mend)
    return {"kind": correction.kind, "sensors": list(correction.sensors)}


def _score(p: Protocol) -> dict[str, Any] | None:
    """The clinician's own score for the trial under review."""
    return (
        None
        if p.score is None
        else {
            "title": p.score.title,
            "least": p.score.least,
            "most": p.score.most,
            "hint": p.score.hint,
        }
    )


def _task(w: Wizard, p: Protocol) -> dict[str, Any]:
    return {
        "name": p.name,
        "title": p.title,
        "outcome": w.outcome(p.name),
        "duration": p.length,
        "trials": p.trials,
        "accepted": w.accepted(p.name),
    }


def _group(w: Wizard, name: str, tasks: list[Protocol]) -> dict[str, Any]:
    title = w.plan_title if name == machine.ROUTINE else ""
    return {
        "name": name,
        "title": title or name.replace("_", " ").capitalize(),
        "planned": bool(title),
        "tasks": len(tasks),
        "done": sum(w.outcome(p.name) == "accepted" for p in tasks),
    }


def _pace(w: Wizard, p: Protocol, status: StationStatus) -> dict[str, Any]:
    """The pace of metronome and repetition counter.

    `elapsed` is the time done of the trial, s, None before it runs; after a pause it goes on from `begins`, s.
    """
    return {
        "cycle": [{"say": phase.say, "seconds": phase.seconds} for phase in p.cycle],
        "repetitions": p.repetitions,
        "trial": w.accepted(p.name) + 1,
        "trials": p.trials,
        "begins": round(machine.resumed_at(w), 3) if w.state is State.RESUME_COUNTDOWN else 0.0,
        "elapsed": round(machine.elapsed(w, status.t), 3) if w.state in machine.RUNNING else None,
    }
