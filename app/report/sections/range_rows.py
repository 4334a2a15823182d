"""The table of ranges: for each joint the furthest it went in any of the tasks that asked it to, in words and in numbers."""

from collections.abc import Sequence
from dataclasses import dataclass

from handscope.app.language import Language
from handscope.app.report.content import Task
from handscope.app.report.words import (
    ROTATION,
    SIDES,
    both_ways,
    extension_words,
    flexion_words,
    joint_words,
)
from handscope.estimators.hand.anatomy import ANGLES, JOINTS
from handscope.estimators.measures.figure import Grade
from handscope.estimators.measures.range_of_motion import Range
from handscope.estimators.messages.sentence import join

GRADES: tuple[Grade, ...] = ("good", "fair", "poor")


@dataclass(frozen=True)
class RangeRow:
    """One line of the table: a joint's words and the ranges behind them (None where not measured or not asked for)."""

    group: str  # "Wrist", "Thumb", ...
    joint: str  # "MCP", ...
    flexion: str
    extension: str
    sideways: str
    bend: Range | None  # flexion, or rotation in a row of its own
    side: Range | None = None  # deviation

    @property
    def ranges(self) -> list[Range]:
        return [r for r in (self.bend, self.side) if r]

    @property
    def grade(self) -> Grade:
        """The worse of the two."""
        return max((r.grade for r in self.ranges), key=GRADES.index)

    @property
    def reasons(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(r.reason for r in self.ranges if r.reason))


def asks_full_range(task: str) -> bool:
    """Whether the task's name says that joints were to be moved as far as they go."""
    return "rom" in task.lower().split("_") or "range" in task.lower()


def by_task(tasks: Sequence[Task]) -> list[list[Task]]:
    """Trials of the same task together, in the order in which the tasks began."""
    names = dict.fromkeys(t.result.task for t in tasks)
    return [[t for t in tasks if t.result.task == name] for name in names]


def over_tasks(tasks: Sequence[Task]) -> list[Range]:
    """Of every angle that a task asked for the largest and the smallest over these tasks, with the worse grade of the two."""
    found = []
    for joint in JOINTS:
        for angle in (ANGLES[a] for a in joint.dofs):
            asked = [
                r
                for t in tasks
                if t.asks(joint.name, angle)
                for r in t.result.details
                if (r.joint, r.angle) == (joint.name, angle)
            ]
            if asked:
                found.append(_furthest(asked))
    return found


def range_rows(ranges: Sequence[Range], full: bool, language: Language) -> list[RangeRow]:
    """Rows in the order wrist, thumb, index to little, from the knuckle outwards; a rotation follows its joint as a row of its own.

    Only where the tasks asked for the `full` range is what was not reached called a deficit.
    """
    rows = []
    for joint in (j.name for j in JOINTS):
        of = {r.angle: r for r in ranges if r.joint == joint}
        if "flexion" in of or "deviation" in of:
            rows.append(_row(joint, of.get("flexion"), of.get("deviation"), full, language))
        if turn := of.get("pronation"):
            group, name = joint_words(joint, language)
            turned = both_ways(turn.smallest, turn.largest, ROTATION, language)
            rows.append(
                RangeRow(group, language.say("joint.turn", joint=name), "", "", turned, turn)
            )
    return rows


def _furthest(ranges: Sequence[Range]) -> Range:
    high, low = max(ranges, key=lambda r: r.largest), min(ranges, key=lambda r: r.smallest)
    grade = max(high.grade, low.grade, key=GRADES.index)
    reasons = dict.fromkeys(r.reason for r in (high, low) if r.reason)
    return Range(
        high.joint,
        high.angle,
        high.largest,
        low.smallest,
        high.t_largest,
        low.t_smallest,
        grade,
        join(reasons),
    )


def _row(
    joint: str, bend: Range | None, side: Range | None, full: bool, language: Language
) -> RangeRow:
    flexion = flexion_words(bend.largest, language) if bend else ""
    extension = extension_words(joint, bend.smallest, bend.largest, language, full) if bend else ""
    sideways = both_ways(side.smallest, side.largest, SIDES[joint], language) if side else ""
    return RangeRow(*joint_words(joint, language), flexion, extension, sideways, bend, side)
