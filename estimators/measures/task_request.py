"""What a task asked for: its name, the details of its event, and the stretches marked within it."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from handscope.estimators.data.samples import Event
from handscope.estimators.hand.anatomy import FINGERS

PAUSE = "pause"  # the phase of a stretch that is no part of the task


@dataclass(frozen=True)
class Mark:
    """A stretch within a task in which a phase of it was to be done."""

    onset: float  # s
    end: float  # s
    phase: str
    repetition: int = 0


@dataclass(frozen=True)
class TaskRequest:
    """A task's name, details and marked stretches."""

    task: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)  # of the task's event
    marks: tuple[Mark, ...] = ()

    @property
    def pauses(self) -> list[tuple[float, float]]:
        """Stretches (from, to) s within the task that do not count."""
        return [(m.onset, m.end) for m in self.marks if m.phase == PAUSE]

    def fingers(self) -> tuple[str, ...]:
        """The fingers that the details or the task's name say, in the order of the hand; none where neither does."""
        fingers_text = self.details.get("fingers", self.details.get("finger"))
        names = (
            words_of(
                " ".join(fingers_text)
                if isinstance(fingers_text, list | tuple)
                else str(fingers_text)
            )
            if fingers_text
            else words_of(self.task)
        )
        return tuple(f for f in FINGERS if f in names)


UNKNOWN = TaskRequest()


def parse_request(event: Event, events: Sequence[Event]) -> TaskRequest:
    """What a task's event and the annotations within it say."""
    return TaskRequest(
        str(event.details.get("task_name", "task")), event.details, tuple(_marks(event, events))
    )


def words_of(task: str) -> frozenset[str]:
    """The words of a task's name: "rom_index_mcp" has rom, index and mcp."""
    return frozenset(
        re.findall(r"[a-z]+|[0-9]+", re.sub(r"([a-z])([0-9])", r"\1 \2", task.lower()))
    ) | frozenset(re.findall(r"[a-z0-9]+", task.lower()))


def _marks(event: Event, events: Sequence[Event]) -> Iterator[Mark]:
    for e in events:
        if (
            e.trial_type == "annotation"
            and e.details.get("phase")
            and event.onset - 1e-6 <= e.onset <= event.end
        ):
            yield Mark(
                e.onset, e.end, str(e.details["phase"]), int(e.details.get("repetition") or 0)
            )
