"""Progress of a pose, a task or a step; pauses do not count."""

from handscope.app.live.wizard.state import StationStatus, Wizard
from handscope.app.live.wizard.transition_table import COUNTING, RUNNING, State


def progress_share(wizard: Wizard, status: StationStatus) -> float:
    """Share of the pose, task or step done, 0 to 1."""
    if wizard.state is State.POSE_HOLD:
        return (
            0.0
            if wizard.still_since is None
            else min(1.0, (status.t - wizard.still_since) / wizard.pose_duration)
        )
    if wizard.state in RUNNING and wizard.protocol and wizard.protocol.length:
        return min(1.0, max(0.0, elapsed(wizard, status.t)) / wizard.protocol.length)
    return 0.0


def remaining_time(wizard: Wizard, status: StationStatus) -> float | None:
    """Seconds left of the rest between two trials, the countdown or the task; None where nothing is timed."""
    protocol = wizard.protocol if status.is_recording else None
    if (
        wizard.state is State.TASK_READY
        and protocol
        and protocol.pause
        and wizard.accepted(protocol.name)
    ):
        left = protocol.pause - (status.now - wizard.rested_since)
        return left if left > 0 else None
    if wizard.state in COUNTING and protocol:
        return max(0.0, protocol.countdown - (status.now - wizard.since))
    if wizard.state in RUNNING and protocol and protocol.length:
        return max(0.0, protocol.length - elapsed(wizard, status.t))
    return None


def elapsed(wizard: Wizard, t: float) -> float:
    """Time done of the trial at recording time t, s, without pauses."""
    return t - wizard.onset - sum(to - start for start, to in wizard.pauses)


def resumed_at(wizard: Wizard) -> float:
    """Time of the trial, s, at which it goes on after a pause."""
    so_far = elapsed(wizard, wizard.end)
    return wizard.protocol.resumed_at(so_far) if wizard.protocol else so_far
