"""The words of a grading scheme for total active motion, chosen by whoever reads: a page, a report.

Source  estimators/measures/total_active_motion.py; a share is of the other hand's motion where that hand is not affected, else of the norm
"""

from collections.abc import Sequence
from dataclasses import replace

from handscope.app.report.content import Content, OtherHand, Task
from handscope.estimators.hand.anatomy import FINGERS, Hand
from handscope.estimators.measures.total_active_motion import GRADINGS, regrade
from handscope.sessions.clinic.references import Course

MEASURE = "total_active_motion"
DEFAULT = next(iter(GRADINGS))


def grade_content(content: Content, scheme: str) -> Content:
    """A report's content with the words of a scheme."""
    affected = content.compared.affected if content.compared else content.visit.affected
    other = uninjured(content.hand, affected, content.course)
    return replace(content, tasks=grade_tasks(content.tasks, scheme, other))


def grade_tasks(tasks: Sequence[Task], scheme: str, other: OtherHand | None) -> tuple[Task, ...]:
    """The tasks with total active motion graded by the scheme chosen."""
    return tuple(
        replace(
            t,
            result=replace(
                t.result, figures=regrade(t.result.figures, scheme, other.motion if other else {})
            ),
            grading=scheme,
            against=other,
        )
        if t.result.measure == MEASURE
        else t
        for t in tasks
    )


def uninjured(hand: str, affected: str | None, course: Course | None) -> OtherHand | None:
    """The other hand with its TAM where only this one is affected."""
    if affected != hand or course is None or course.other is None:
        return None
    found = {
        f: [
            v
            for (measure, _, name), (v, _) in course.other.values.items()
            if (measure, name) == (MEASURE, f"{f}_tam")
        ]
        for f in FINGERS
    }
    motion = {f: max(values) for f, values in found.items() if values and max(values) > 0}
    other_side: Hand = "right" if hand == "left" else "left"
    return OtherHand(other_side, course.other.started, motion) if motion else None
