"""Title and sentence of every state of the wizard, as a person reads them."""

from handscope.app.live.wizard import machine as wz
from handscope.app.live.wizard.machine import State, StationStatus, Wizard
from handscope.app.protocols import Protocol

SPOILT = ("This step cannot be used", "Repeat it, or leave it out and go on.")
STOPPED = (
    "Nothing more is recorded",
    "What was recorded and accepted until then is kept; the trial that ran is not. End the session.",
)
PASSIVE = (
    "Initial pose, given by you",
    "Lay the patient's hand as the blue hand shows: flat, fingers straight and together, thumb out sideways. Hold it on the table, then start.",
)
RESUMABLE = {
    "anywhere": (
        "Paused",
        "Go on when the patient is ready: the trial goes on where it stopped, and the pause does not count.",
    ),
    "phase": (
        "Paused",
        "Go on when the patient is ready: “{word}” is done once more, and the pause does not count.",
    ),
    "repetition": (
        "Paused",
        "Go on when the patient is ready: movement {number} of {all} is done once more, and the pause does not count.",
    ),
}
CLOSING = (
    "Initial pose again",
    "Lay the hand flat once more as the blue hand shows. With this pose what the movements told comes into force.",
)
REPEATED = (
    "The same pose once more",
    "Lift the hand, move the fingers, and lay it flat again as before. The mean of the poses counts, and how they scatter.",
)
STEPS = (("connect", "Connect"), ("pose", "Initial pose"), ("tasks", "Tasks"), ("finish", "Finish"))
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
        *wz.STEPPING,
        *wz.MOVING_FREELY,
    ),
    "pose",
)
WRIST_ALONE = (
    "Put the glove on",
    "Bend the wrist up and down: the hand must light up, then turn the forearm.",
)
ONE_FINGER = ("Put the glove on", "Bend the finger that wears the sensors: it must light up.")
WORDS = {
    State.CONNECT: (
        "Put the glove on",
        "Bend one finger after the other: the finger that moves must light up.",
    ),
    State.CHECKED: ("Sensors checked", "Every finger's own strip should have moved. Then go on."),
    State.POSE_READY: (
        "Initial pose",
        "Lay the hand flat, fingers straight and together, thumb stretched out sideways as the blue hand shows. Then start.",
    ),
    State.POSE_HOLD: ("Hold still", "Keep the hand exactly like this until the bar is full."),
    State.POSE_WORK: ("One moment", "The calibration is being computed."),
    State.POSE_REVIEW: (
        "Does the hand look right?",
        "The 3-D hand should lie as the patient's hand does. If not, do the pose again.",
    ),
    State.TASKS: ("Choose a task", "Do the tasks in order, or only those you need."),
    State.TASK_PAUSED: (
        "Paused",
        "This trial cannot go on after a pause: its rhythm and its length are what is measured. Start it again when the patient is ready, or keep what was done.",
    ),
    State.TASK_REVIEW: (
        "Keep this one?",
        "Accept what was recorded, do it again, or skip the task with a reason.",
    ),
    State.STEP_REVIEW: (
        "This step is good",
        "Go on, or repeat it if the patient did something else.",
    ),
    State.FREE_WORK: (
        "One moment",
        "The hand is being calibrated from its movement; the hand may rest. This takes a minute or two.",
    ),
    State.FREE_REVIEW: (
        "Use what was found?",
        "Lengths and how the sensors sit serve this session, and are kept with the patient. After the glove was taken off only the lengths hold.",
    ),
    State.FINISHED: ("Finished", "The recording is closed. The results are being computed."),
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
        name = finger if finger == "thumb" else f"{finger} finger"
        return (
            f"Bend the {name}",
            "Only this one, to and fro, then keep still. The page goes on by itself when a strip moves.",
        )
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
    title, words = RESUMABLE[p.resumes or "anywhere"]
    phase = p.at(wz.resumed_at(w))
    return title, words.format(
        word=phase[0].say, number=phase[1], all=p.repetitions
    ) if phase else words
