"""Effects of the wizard as tests compare them: their type, and the task, step or finger that they are about."""

from collections.abc import Iterable

from handscope.app.live.wizard.effects import (
    CueFinger,
    CueTask,
    DropStep,
    Effect,
    KeepAttempt,
    MeasureStep,
    SolveFree,
)


def kinds(effects: Iterable[Effect]) -> list[tuple[type, str]]:
    return [(type(o), _subject(o)) for o in effects]


def _subject(effect: Effect) -> str:
    match effect:
        case CueTask(name) | CueFinger(name) | DropStep(name):
            return name
        case KeepAttempt(name) | MeasureStep(name) | SolveFree(name):
            return name
    return ""
