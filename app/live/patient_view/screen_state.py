"""What the patient's screen shows of a station, chosen from its snapshot: the step, its words, time, and how far the movement goes.

Nothing else of the snapshot leaves the server: no patient, session, recording, figure or message to the therapist.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

from handscope.app.live.wizard.machine import State

Stage = Literal["wait", "change", "pose", "hold", "watch", "count", "run", "pause", "rest", "end"]
STAGES: Mapping[State, Stage] = {
    State.POSE_READY: "pose",
    State.POSE_HOLD: "hold",
    State.TASK_READY: "watch",
    State.STEP_READY: "watch",
    State.FREE_READY: "watch",
    State.COUNTDOWN: "count",
    State.RESUME_COUNTDOWN: "count",
    State.STEP_COUNTDOWN: "count",
    State.FREE_COUNTDOWN: "count",
    State.TASK_RUN: "run",
    State.STEP_RUN: "run",
    State.FREE_RUN: "run",
    State.TASK_PAUSED: "pause",
    State.TASK_REVIEW: "rest",
    State.STEP_REVIEW: "rest",
    State.FREE_WORK: "rest",
    State.FREE_REVIEW: "rest",
    State.FINISHED: "end",
}  # the therapist works in all others: the patient waits
WITH_WORDS = ("watch", "count", "run")  # of the task or step
COUNTED = ("taps", "repetitions")


def screen_state(snapshot: Mapping[str, Any], points: Sequence[Sequence[float]]) -> dict[str, Any]:
    """The state of the screen; `points` are the newest of the curve (s, value)."""
    wizard = snapshot["wizard"]
    passive = wizard["mode"] == "passive"  # the therapist moves the hand in this task
    stage = STAGES.get(State(wizard["state"])) or _waiting_stage(snapshot)
    has_words, runs = stage in WITH_WORDS, stage == "run"
    return {
        "stage": stage,
        "hand": snapshot["hand"],
        "mirrored": snapshot["mirrored"],
        "flowing": snapshot["glove"]["flowing"],
        "title": wizard["title"] if has_words else "",
        "instruction": wizard["instruction"] if has_words and not passive else "",
        "passive": passive if has_words else wizard["passive"] and stage in ("pose", "hold"),
        "remaining": wizard["remaining"],
        "progress": wizard["progress"] if stage in ("hold", "run") else 0.0,
        "still": wizard["still"],
        "pace": wizard["pace"] if has_words else None,
        "done": _done(snapshot["numbers"]) if stage in ("run", "rest") else 0,
        "target": snapshot["target"] if has_words else None,
        "unit": snapshot["curve"]["unit"] if runs else "",
        "value": round(points[-1][1], 1) if runs and points else None,
    }


def _waiting_stage(snapshot: Mapping[str, Any]) -> Stage:
    """While the therapist works the patient waits; where the second hand begins the glove is changed."""
    is_second = snapshot["continues"] is not None
    return "change" if is_second and snapshot["wizard"]["state"] == State.CONNECT else "wait"


def _done(numbers: Sequence[Mapping[str, Any]]) -> int:
    """Movements counted so far."""
    return next((int(n["value"]) for n in numbers if n["name"] in COUNTED), 0)
