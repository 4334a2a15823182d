"""The wizard's states, the actions that lead from one to the next, and those that a person can take."""

from collections.abc import Mapping
from enum import StrEnum


class State(StrEnum):
    """Where a session of the wizard stands."""

    CONNECT = "connect"
    CHECK = "check"  # one finger after the other is bent
    CHECKED = "checked"
    POSE_READY = "pose_ready"
    POSE_HOLD = "pose_hold"
    POSE_WORK = "pose_work"  # the calibration is computed
    POSE_REVIEW = "pose_review"
    TASKS = "tasks"
    TASK_READY = "task_ready"
    COUNTDOWN = "countdown"
    RESUME_COUNTDOWN = "resume_countdown"  # of a trial that goes on after a pause
    TASK_RUN = "task_run"
    TASK_PAUSED = "task_paused"  # the recording goes on
    TASK_REVIEW = "task_review"
    STEP_READY = "step_ready"  # steps of a functional calibration
    STEP_COUNTDOWN = "step_countdown"
    STEP_RUN = "step_run"
    STEP_REVIEW = "step_review"
    FREE_READY = "free_ready"  # self-calibration from free movement
    FREE_COUNTDOWN = "free_countdown"
    FREE_RUN = "free_run"
    FREE_WORK = "free_work"  # it is computed
    FREE_REVIEW = "free_review"
    FINISHED = "finished"


class Action(StrEnum):
    """What a person does, or a tick detects."""

    CONTINUE = "continue"
    CHECK = "check"  # the sensors, finger by finger
    EXCHANGE = "exchange"  # strips that were found on each other's fingers
    CORRECT = "correct"  # what the sensors read, as the checks propose
    START = "start"
    STOP = "stop"
    ACCEPT = "accept"
    REDO = "redo"
    SKIP = "skip"
    UNABLE = "unable"  # the patient could not do it: a clinical finding
    PAUSE = "pause"
    RESUME = "resume"  # the trial goes on after a pause, which does not count
    GROUP = "group"  # of tasks to choose from
    CHOOSE = "choose"
    REPEAT = "repeat"  # keep this pose, lift the hand and take it once more: the mean counts
    ONWARD = "onward"  # keep this pose or trial, and on to the next task that is open
    CLOSE = "close"  # keep this trial, which was the last, and finish
    AGAIN = "again"  # keep this trial, and on to the next of the same task
    CALIBRATE = "calibrate"  # by movements
    FREE = "free"  # calibrate by free movement
    ENOUGH = "enough"  # of free movement
    NEXT = "next"  # step of the calibration
    USE = "use"  # the steps that were done well, from the initial pose that follows on
    ASSIST = "assist"  # the therapist lays the hand into the pose, or the patient takes it again
    WITHOUT = "without"  # any calibration: defaults, and everything is flagged
    RECALIBRATE = "recalibrate"
    FINISH = "finish"
    HELD = "held"  # the pose was still long enough
    POSED = "posed"  # and gave a calibration
    SEEN = "seen"  # every finger that was asked for
    STARTED = "started"  # the countdown is over
    ENDED = "ended"  # the task's time is over
    SOLVED = "solved"  # the self-calibration was found


S, A = State, Action
TRANSITIONS: Mapping[State, Mapping[Action, State]] = {
    S.CONNECT: {
        A.EXCHANGE: S.CONNECT,
        A.CORRECT: S.CONNECT,
        A.CONTINUE: S.POSE_READY,
        A.CHECK: S.CHECK,
    },
    S.CHECK: {A.NEXT: S.CHECK, A.SEEN: S.CHECKED, A.STOP: S.CONNECT},
    S.CHECKED: {A.EXCHANGE: S.CHECK, A.CONTINUE: S.POSE_READY, A.CHECK: S.CHECK},
    S.POSE_READY: {
        A.START: S.POSE_HOLD,
        A.ASSIST: S.POSE_READY,
        A.WITHOUT: S.TASKS,
        A.STOP: S.TASKS,
        A.FINISH: S.FINISHED,
    },
    S.POSE_HOLD: {
        A.HELD: S.POSE_WORK,
        A.ASSIST: S.POSE_READY,
        A.WITHOUT: S.TASKS,
        A.STOP: S.POSE_READY,
    },
    S.POSE_WORK: {A.POSED: S.POSE_REVIEW},
    S.POSE_REVIEW: {
        A.ONWARD: S.TASK_READY,
        A.ACCEPT: S.TASKS,
        A.REDO: S.POSE_READY,
        A.REPEAT: S.POSE_READY,
        A.CALIBRATE: S.STEP_READY,
        A.FREE: S.FREE_READY,
        A.EXCHANGE: S.POSE_READY,
    },
    S.TASKS: {
        A.GROUP: S.TASKS,
        A.CHOOSE: S.TASK_READY,
        A.CALIBRATE: S.STEP_READY,
        A.FREE: S.FREE_READY,
        A.RECALIBRATE: S.POSE_READY,
        A.FINISH: S.FINISHED,
    },
    S.TASK_READY: {A.START: S.COUNTDOWN, A.SKIP: S.TASKS, A.UNABLE: S.TASKS, A.STOP: S.TASKS},
    S.COUNTDOWN: {A.STARTED: S.TASK_RUN, A.STOP: S.TASK_READY},
    S.RESUME_COUNTDOWN: {A.STARTED: S.TASK_RUN, A.STOP: S.TASK_PAUSED},
    S.TASK_RUN: {A.ENDED: S.TASK_REVIEW, A.STOP: S.TASK_REVIEW, A.PAUSE: S.TASK_PAUSED},
    S.TASK_PAUSED: {
        A.RESUME: S.RESUME_COUNTDOWN,
        A.START: S.COUNTDOWN,
        A.STOP: S.TASK_REVIEW,
        A.SKIP: S.TASKS,
        A.UNABLE: S.TASKS,
    },
    S.TASK_REVIEW: {
        A.AGAIN: S.TASK_READY,
        A.ONWARD: S.TASK_READY,
        A.ACCEPT: S.TASKS,
        A.CLOSE: S.FINISHED,
        A.REDO: S.TASK_READY,
        A.SKIP: S.TASKS,
        A.UNABLE: S.TASKS,
    },
    S.STEP_READY: {
        A.START: S.STEP_COUNTDOWN,
        A.NEXT: S.STEP_READY,
        A.CHOOSE: S.STEP_READY,
        A.USE: S.POSE_READY,
        A.STOP: S.TASKS,
    },
    S.STEP_COUNTDOWN: {A.STARTED: S.STEP_RUN, A.STOP: S.STEP_READY},
    S.STEP_RUN: {A.ENDED: S.STEP_REVIEW, A.STOP: S.STEP_READY},
    S.STEP_REVIEW: {
        A.NEXT: S.STEP_READY,
        A.REDO: S.STEP_READY,
        A.CHOOSE: S.STEP_READY,
        A.USE: S.POSE_READY,
        A.STOP: S.TASKS,
    },
    S.FREE_READY: {A.START: S.FREE_COUNTDOWN, A.STOP: S.TASKS},
    S.FREE_COUNTDOWN: {A.STARTED: S.FREE_RUN, A.STOP: S.FREE_READY},
    S.FREE_RUN: {A.ENDED: S.FREE_WORK, A.ENOUGH: S.FREE_WORK, A.STOP: S.FREE_READY},
    S.FREE_WORK: {A.SOLVED: S.FREE_REVIEW, A.STOP: S.FREE_READY},
    S.FREE_REVIEW: {A.USE: S.POSE_READY, A.REDO: S.FREE_READY, A.STOP: S.TASKS},
    S.FINISHED: {},
}
COUNTING = (S.COUNTDOWN, S.RESUME_COUNTDOWN, S.STEP_COUNTDOWN, S.FREE_COUNTDOWN)
RUNNING = (S.TASK_RUN, S.STEP_RUN, S.FREE_RUN)
POSING = (S.POSE_READY, S.POSE_HOLD, S.POSE_WORK, S.POSE_REVIEW)
STEPPING = (S.STEP_READY, S.STEP_COUNTDOWN, S.STEP_RUN, S.STEP_REVIEW)
MOVING_FREELY = (S.FREE_READY, S.FREE_COUNTDOWN, S.FREE_RUN, S.FREE_WORK, S.FREE_REVIEW)
PASSING = ("redone", "paused")  # outcomes after which the task is still to be done
OUTCOMES = {
    Action.ACCEPT: "accepted",
    Action.AGAIN: "accepted",
    Action.REDO: "redone",
    Action.START: "paused",
    Action.SKIP: "skipped",
    Action.UNABLE: "unable",
}
BY_PERSON = set(Action) - {A.HELD, A.POSED, A.SEEN, A.STARTED, A.ENDED, A.SOLVED}
