"""What a joint's angles are compared with: their standard deviation, the other hand, the reference and the session before."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from handscope.app.language import Language
from handscope.app.report.content import Content, Task
from handscope.app.report.references import Edition, Reference
from handscope.app.report.sections.range_rows import RangeRow, over_tasks
from handscope.app.report.units import DEG, decimals_of_sd
from handscope.estimators.measures.asked_extension import asks_fist_and_stretch
from handscope.estimators.measures.range_of_motion import Range
from handscope.sessions.clinic.repeatability import Values

End = Literal["smallest", "largest"]
WORD: dict[End, str] = {"largest": "max", "smallest": "min"}  # in the names of figures


def sd_of(tasks: Sequence[Task], r: Range, end: End) -> float | None:
    """Standard deviation (rad) of that end, in the task in which it was reached; None where the method gives none."""
    name, value = f"{r.joint}_{r.angle}_{WORD[end]}", getattr(r, end)
    found = [f.sd for t in tasks for f in t.result.figures if f.name == name and f.value == value]
    return found[0] if found else None


def flexion_with_sd(tasks: Sequence[Task], row: RangeRow, language: Language) -> str:
    """The row's flexion as it is read, with its standard deviation where the method gives one: "81° ± 1.8°"."""
    sd = sd_of(tasks, row.bend, "largest") if row.bend and row.flexion else None
    if sd is None:
        return row.flexion
    return f"{row.flexion} ± {language.number(sd * DEG, decimals_of_sd(max(1.0, sd * DEG)))}°"


def reference_of(r: Range, end: End, edition: Edition) -> Reference | None:
    """The published reference of an end of a range, where there is one."""
    return next(
        (f for f in edition.references if (f.joint, f.angle, f.end) == (r.joint, r.angle, end)),
        None,
    )


def asks_all_of(joint: str, tasks: Sequence[Task]) -> bool:
    """Whether one of the tasks asked the joint to bend as far as it goes: a fist asks that of the fingers, not of the thumb."""
    return not joint.startswith("thumb_") or any(
        t.asks(joint, "flexion") and not asks_fist_and_stretch(t.result.task) for t in tasks
    )


def reference_words(reference: Reference, language: Language) -> str:
    """What an end is judged by, and where another source says something else, both with their names: "65° (ASSH; ... 80°)"."""
    judged, other = reference.judged, reference.other
    if other is None:
        return f"{judged.degrees:.0f}°"
    return language.say(
        "reference.two",
        judged=f"{judged.degrees:.0f}°",
        source=language.translate(judged.source.name),
        other=f"{other.degrees:.0f}°",
        elsewhere=language.translate(other.source.name),
    )


def reference_span(reference: Reference) -> str:
    """ "65–80°" where two sources differ, else "80°"."""
    each = sorted({r.degrees for r in (reference, reference.also) if r})
    return f"{'–'.join(f'{degrees:.0f}' for degrees in each)}°"


def other_hand(content: Content, tasks: Sequence[Task]) -> list[Range]:
    """The other hand's ranges in the same tasks: the same joints and angles, as far as they are known."""
    if content.course is None or content.course.other is None:
        return []
    return [
        o
        for r in over_tasks(tasks)
        if (o := _of(content.course.other.values, tasks, r)) is not None
    ]


def _of(values: Values, tasks: Sequence[Task], r: Range) -> Range | None:
    names = {t.result.task for t in tasks if t.asks(r.joint, r.angle)}
    ends = {
        end: [
            value
            for (measure, task, name), (value, _) in values.items()
            if _is(measure, task, name, names, r, end)
        ]
        for end in WORD
    }
    if not all(ends.values()):
        return None
    return Range(
        r.joint, r.angle, max(ends["largest"]), min(ends["smallest"]), 0.0, 0.0, "good", ""
    )


def _is(measure: str, task: str, name: str, tasks: set[str], r: Range, end: End) -> bool:
    return (
        measure == "range_of_motion"
        and task in tasks
        and name == f"{r.joint}_{r.angle}_{WORD[end]}"
    )


@dataclass(frozen=True)
class Lacking:
    """How far an end of a joint's range stays behind what it is compared with."""

    joint: str
    end: End
    own: float  # rad, signed
    against: float  # rad

    @property
    def short(self) -> float:
        """How much less, rad; negative where it goes further."""
        return self.against - self.own if self.end == "largest" else self.own - self.against


def behind_reference(tasks: Sequence[Task], edition: Edition) -> list[Lacking]:
    """Every end of flexion that has a reference."""
    return [
        Lacking(r.joint, end, getattr(r, end), f.judged.degrees / DEG)
        for r in over_tasks(tasks)
        for end in WORD
        if r.angle == "flexion"
        and asks_all_of(r.joint, tasks)
        and (f := reference_of(r, end, edition)) is not None
    ]


def behind_other(tasks: Sequence[Task], other: Sequence[Range]) -> list[Lacking]:
    """Every end of flexion that both hands have."""
    others = {(o.joint, o.angle): o for o in other}
    return [
        Lacking(r.joint, end, getattr(r, end), getattr(others[r.joint, r.angle], end))
        for r in over_tasks(tasks)
        for end in WORD
        if r.angle == "flexion" and (r.joint, r.angle) in others
    ]
