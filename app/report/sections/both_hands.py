"""Both hands of one visit side by side: the figures that a clinician decides by, a table a task."""

from typing import Any

from handscope.app.language import Language
from handscope.app.report.change_words import value_words
from handscope.app.report.changes import read_as
from handscope.app.report.content import Content
from handscope.app.report.progress.importance import rank
from handscope.app.report.progress.labels import label
from handscope.app.report.words import moment_words
from handscope.sessions.clinic.repeatability import Key, Values

SHARE_OF = (
    1e-9  # SI: a figure of the other hand below it has no share, nor one in the other direction
)


def both_hands_section(content: Content, language: Language) -> dict[str, Any] | None:
    """As the layout places tables; None where the other hand was not measured in the same visit."""
    course, found = content.course, _other_hand(content, language)
    if course is None or found is None:
        return None
    own, (other, summary) = course.visits[-1].values, found
    shared = sorted((k for k in own.keys() & other.keys() if rank(k)), key=lambda k: (rank(k), k))
    if not shared:
        return None
    titles = {task.result.task: task.title for task in content.tasks}
    tasks = dict.fromkeys(key[1] for key in shared)
    hands = [content.hand, "right" if content.hand == "left" else "left"]
    return {
        "title": language.say("both.title"),
        "summary": summary,
        "words": [],
        "parts": [
            {
                "title": language.translate(titles.get(task, task)),
                "columns": [
                    language.say("figure"),
                    *(language.say(f"hand.{h}") for h in hands),
                    language.say("both.share"),
                ],
                "rows": [_row(key, own, other, language) for key in shared if key[1] == task],
            }
            for task in tasks
        ],
    }


def _other_hand(content: Content, language: Language) -> tuple[Values, str] | None:
    """The other hand's figures of the same visit, and in words when it was measured; None where it was not."""
    course, later = content.course, content.later_hand
    if content.same_visit and course is not None and course.other is not None:
        other = course.other
        return other.values, language.say("both.summary", **moment_words(other.started, language))
    if later is None:
        return None
    computed = {f"made_{key}": words for key, words in moment_words(later.made, language).items()}
    moment = moment_words(later.started, language)
    return later.values, language.say(
        "both.summary.later", result=later.result, **moment, **computed
    )


def _row(key: Key, own: Values, other: Values, language: Language) -> list[str]:
    """Figure, this hand, the other one, and this hand's share of it."""
    read = [read_as(key, *values[key]) for values in (own, other)]
    words = [value_words(key[2], value, unit, language) for value, unit in read]
    (mine, _), (theirs, _) = read
    has_share = abs(theirs) > SHARE_OF and mine * theirs >= 0
    share = f"{language.number(100 * mine / theirs)} %" if has_share else "–"
    return [label(key[2], language), *words, share]
