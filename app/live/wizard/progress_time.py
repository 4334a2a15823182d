"""How far a pose, a task or a step has come: pauses do not count."""

from handscope.app.live.wizard.state import Facts, Wizard
from handscope.app.live.wizard.transition_table import COUNTING, RUNNING, State


def progress(wizard: Wizard, facts: Facts) -> float:
    """Share of the pose, task or step done, 0 to 1."""
    if wizard.state is State.POSE_HOLD:
        return (
            0.0
            if wizard.still_since is None
            else min(1.0, (facts.t - wizard.still_since) / wizard.pose_duration)
        )
    if wizard.state in RUNNING and wizard.protocol and wizard.protocol.length:
        return min(1.0, max(0.0, done(wizard, facts.t)) / wizard.protocol.length)
    return 0.0


def remaining(wizard: Wizard, facts: Facts) -> float | None:
    """Seconds left of the rest between two trials, the countdown or the task; None where nothing is timed."""
    protocol = wizard.protocol if facts.kept else None
    if (
        wizard.state is State.TASK_READY
        and protocol
        and protocol.pause
        and wizard.accepted(protocol.name)
    ):
        left = protocol.pause - (facts.now - wizard.rested_since)
        return left if left > 0 else None
    if wizard.state in COUNTING and protocol:
        return max(0.0, protocol.countdown - (facts.now - wizard.since))
    if wizard.state in RUNNING and protocol and protocol.length:
        return max(0.0, protocol.length - done(wizard, facts.t))
    return None


def done(wizard: Wizard, t: float) -> float:
    """How much of the trial has been done at a moment of the recording, s: pauses do not count."""
    return t - wizard.onset - sum(to - start for start, to in wizard.pauses)


def resumed_at(wizard: Wizard) -> float:
    """Where a paused trial goes on, in s of the trial."""
    so_far = done(wizard, wizard.end)
    return wizard.protocol.resumed_at(so_far) if wizard.protocol else so_far
