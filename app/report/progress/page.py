"""The progress report in words and figures: the first page in charts, then every figure in a table; the layout (progress.typ) places them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import Any

from handscope.app.language import Language
from handscope.app.protocols import Protocol
from handscope.app.report.change_words import amount, size_words, value_words
from handscope.app.report.changes import Change
from handscope.app.report.progress.chart import Shown, course_chart
from handscope.app.report.progress.labels import label
from handscope.app.report.progress.series import Course, Progress, Series
from handscope.estimators.hand.anatomy import Hand

CHARTS = 9  # on the first page
HEADINGS = (
    *("progress.treatment", "progress.every", "figure", "progress.first", "progress.newest"),
    *("progress.change", "progress.mdc", "progress.goal", "progress.short.beyond"),
)


@dataclass(frozen=True)
class Treated:
    """What was done to a hand on a day."""

    kind: str
    hand: str
    day: date
    comment: str


@dataclass(frozen=True)
class Patient:
    """Whose progress it is, what was done, and what figures are to reach by hand and figure."""

    pseudonym: str
    treatment: Sequence[Treated]
    goals: Mapping[tuple[str, tuple[str, str, str]], tuple[float, float]]
    protocols: Mapping[str, Protocol]


def progress_page(
    history: Progress, hand: Hand, patient: Patient, language: Language
) -> dict[str, Any] | None:
    """What the layout places; None where no figure of this hand was measured twice."""
    say = language.say
    repeated = [s for s in history.series if hand in s.hands and len(s.hands[hand].points) > 1]
    if not repeated:
        return None
    newest = [s.hands[hand].points[-1].since_first for s in repeated]
    beyond = [s for s, judged in zip(repeated, newest) if judged]
    unknown = newest.count(None)
    count = len(repeated) - unknown
    important = [s for s in repeated if s.important]
    moved = [s for s in beyond if not s.important]
    charts = [_chart(s, hand, patient, language) for s in (*important, *moved)[:CHARTS]]
    sessions = history.sessions[hand]
    judges = [s.hands[hand].judge for s in repeated]
    sources = dict.fromkeys(language.translate(w) for j in judges for w in j.sources)
    return {
        "language": language.code,
        "title": say("progress.title", patient=patient.pseudonym),
        "facts": language.counted(
            "progress.span",
            len(sessions),
            hand=_capital(say(f"treatment.side.{hand}")),
            first=language.day(sessions[0].started),
            last=language.day(sessions[-1].started),
        ),
        "verdict": " ".join(
            [
                *(
                    [language.counted("progress.verdict", len(beyond), all=f"{count}")]
                    if beyond
                    else [language.counted("progress.none", count)] * bool(count)
                ),
                *([language.counted("progress.unjudged", unknown)] if unknown else []),
            ]
        ),
        "charts": charts,
        "caption": say("progress.caption"),
        "sources": " ".join(sources),
        "treatment": [
            [
                f"{number}",
                say(f"treatment.{t.kind}"),
                say(f"treatment.side.{t.hand}"),
                language.day(t.day),
                language.example(t.comment),
            ]
            for number, t in enumerate(patient.treatment, 1)
        ],
        "tasks": [
            [title, [_row(s, hand, patient, language) for s in each]]
            for title, each in _by_task(repeated, patient, language).items()
        ],
        "has_goals": any(goal_hand == hand for goal_hand, _ in patient.goals),
        "words": {key.replace(".", "_"): say(key) for key in HEADINGS},
        "tag": say("notice.short"),
    }


def _chart(s: Series, hand: Hand, patient: Patient, language: Language) -> dict[str, str]:
    course = s.hands[hand]
    others = [c for other, c in s.hands.items() if other != hand]
    shown = Shown(
        _points(course),
        _points(others[0]) if others else (),
        course.judge.mdc95,
        patient.goals.get((hand, (s.measure, s.task, s.name))),
        {n: t.day for n, t in enumerate(patient.treatment, 1) if t.hand in (hand, "both")},
        s.end == "smallest",
    )
    first, newest = course.points[0], course.points[-1]
    words = {
        "first": _worded(s, first.value, language),
        "last": _worded(s, newest.value, language),
    }
    return {
        "title": label(s.name, language),
        "task": _task(s, patient, language),
        "value": words["last"],
        "verdict": _change(s, hand, language),
        "chart": course_chart(shown, language),
        "alt": language.counted("trends.alt", len(course.points), **words),
    }


def _by_task(
    series: Sequence[Series], patient: Patient, language: Language
) -> dict[str, list[Series]]:
    """By the task's title, in the order of what comes first."""
    found = dict[str, list[Series]]()
    for s in series:
        found.setdefault(_task(s, patient, language), []).append(s)
    return found


def _row(s: Series, hand: Hand, patient: Patient, language: Language) -> list[str]:
    course = s.hands[hand]
    mdc, goal = course.judge.mdc95, patient.goals.get((hand, (s.measure, s.task, s.name)))
    return [
        label(s.name, language),
        _worded(s, course.points[0].value, language),
        _worded(s, course.points[-1].value, language),
        _change(s, hand, language),
        amount(mdc, s.name, s.unit, language) if mdc is not None else "",
        language.say(
            "goals.range",
            low=_worded(s, goal[0], language),
            high=_worded(s, goal[1], language),
        )
        if goal
        else "",
    ]


def _points(course: Course) -> list[tuple[Any, float]]:
    return [(p.started, p.value) for p in course.points]


def _task(s: Series, patient: Patient, language: Language) -> str:
    protocol = patient.protocols.get(s.task)
    return language.translate(protocol.title) if protocol else s.task.replace("_", " ")


def _change(s: Series, hand: Hand, language: Language) -> str:
    """Since the first session: direction, size, and whether it is more than measurement error."""
    course = s.hands[hand]
    first, newest = course.points[0], course.points[-1]
    size = newest.value - first.value
    judge = course.judge
    change = Change(s.measure, s.task, s.name, size, s.unit, judge.mdc95, judge.basis, ())
    beyond = newest.since_first
    word = "unknown" if beyond is None else "beyond" if beyond else "within"
    return f"{size_words(change, language)}, {language.say(f'progress.short.{word}')}"


def _worded(s: Series, value: float, language: Language) -> str:
    return value_words(s.name, value, s.unit, language)


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]
