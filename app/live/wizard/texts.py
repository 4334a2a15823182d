"""Title and sentence of every state of the wizard, as a person reads them."""

from handscope.app.live.wizard import machine
from handscope.app.live.wizard.machine import State, StationStatus, Wizard
from handscope.app.protocols import Protocol
from handscope.estimators.messages.sentence import phrase

SPOILT = (phrase("wizard.spoilt_title"), phrase("wizard.spoilt"))
STOPPED = (
    phrase("wizard.stopped_title"),
    phrase("wizard.stopped"),
)
PASSIVE = (
    phrase("wizard.passive_title"),
    phrase("wizard.passive"),
)
BEND = {
    "thumb": phrase("wizard.bend_thumb"),
    "index": phrase("wizard.bend_index"),
    "middle": phrase("wizard.bend_middle"),
    "ring": phrase("wizard.bend_ring"),
    "little": phrase("wizard.bend_little"),
}
CLOSING = (
    phrase("wizard.closing_title"),
    phrase("wizard.closing"),
)
REPEATED = (
    phrase("wizard.repeated_title"),
    phrase("wizard.repeated"),
)
STEPS = (
    ("connect", phrase("wizard.step_connect")),
    ("pose", phrase("wizard.pose_title")),
    ("tasks", phrase("wizard.step_tasks")),
    ("finish", phrase("wizard.step_finish")),
)
STEP_OF = {
    State.CONNECT: "connect",
    State.CHECK: "connect",
    State.CHECKED: "connect",
    State.FINISHED: "finish",
} | dict.fromkeys(
    (
        State.POSE_READY,
        State.POSE_HOLD,
        State.POSE_WORK,
        State.POSE_REVIEW,
        *machine.STEPPING,
        *machine.MOVING_FREELY,
    ),
    "pose",
)
WRIST_ALONE = (
    phrase("wizard.connect_title"),
    phrase("wizard.wrist_alone"),
)
ONE_FINGER = (phrase("wizard.connect_title"), phrase("wizard.one_finger"))
WORDS = {
    State.CONNECT: (
        phrase("wizard.connect_title"),
        phrase("wizard.connect"),
    ),
    State.CHECKED: (phrase("wizard.checked_title"), phrase("wizard.checked")),
    State.POSE_READY: (
        phrase("wizard.pose_title"),
        phrase("wizard.pose"),
    ),
    State.POSE_HOLD: (phrase("wizard.pose_hold_title"), phrase("wizard.pose_hold")),
    State.POSE_WORK: (phrase("wizard.work_title"), phrase("wizard.pose_work")),
    State.POSE_REVIEW: (
        phrase("wizard.pose_review_title"),
        phrase("wizard.pose_review"),
    ),
    State.TASKS: (phrase("wizard.tasks_title"), phrase("wizard.tasks")),
    State.TASK_PAUSED: (
        phrase("wizard.paused_title"),
        phrase("wizard.not_resumable"),
    ),
    State.TASK_REVIEW: (
        phrase("wizard.task_review_title"),
        phrase("wizard.task_review"),
    ),
    State.STEP_REVIEW: (
        phrase("wizard.step_review_title"),
        phrase("wizard.step_review"),
    ),
    State.FREE_WORK: (
        phrase("wizard.work_title"),
        phrase("wizard.free_work"),
    ),
    State.FREE_REVIEW: (
        phrase("wizard.free_review_title"),
        phrase("wizard.free_review"),
    ),
    State.FINISHED: (phrase("wizard.finished_title"), phrase("wizard.finished")),
}


def title_and_sentence(w: Wizard, status: StationStatus) -> tuple[str, str]:
    """Title and sentence of a state; empty for a task, which brings its own."""
    if not status.is_recording and w.state is not State.FINISHED:
        return STOPPED
    if w.state is State.STEP_REVIEW and (judged := w.judgement(w.task)) and judged.problems:
        return SPOILT
    if w.state is State.CONNECT and status.flowing and (words := _small_glove(w, status)):
        return words
    if w.state is State.CHECK and (finger := w.asked(status)):
        return BEND[finger], phrase("wizard.bend_one")
    if w.state is State.POSE_READY and w.closing:
        return CLOSING
    if w.state is State.POSE_READY and w.repetition > 1:
        return REPEATED
    if w.state is State.POSE_READY and w.passive:
        return PASSIVE
    if w.state is State.TASK_PAUSED and w.protocol and w.protocol.resumes:
        return _resumable(w, w.protocol)
    return WORDS.get(w.state, ("", ""))


def _small_glove(w: Wizard, status: StationStatus) -> tuple[str, str] | None:
    """What to move where fewer than two fingers wear sensors; None for other gloves."""
    fingers = len(w.checkable(status))
    return (WRIST_ALONE, ONE_FINGER, None)[min(fingers, 2)]


def _resumable(w: Wizard, p: Protocol) -> tuple[str, str]:
    """Title and sentence of a paused trial that can go on."""
    title, phase = phrase("wizard.paused_title"), p.at(machine.resumed_at(w))
    if phase and p.resumes == "phase":
        return title, phrase("wizard.resume_phase", word=phase[0].say)
    if phase and p.resumes == "repetition":
        values = {"number": phase[1], "all": p.repetitions or phase[1]}
        return title, phrase("wizard.resume_repetition", **values)
    return title, phrase("wizard.resume_anywhere")
