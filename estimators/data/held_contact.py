"""What touches what, as events tell it: points of fingertips, a mark on the palm, a table.

In      columns `contacts` ("thumb_bottom-index_bottom index_bottom-table_top ...") and `distances_mm` of an event
Out     pairs of points; those of `contact` events, which were held for calibration, with when and what became of them
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from handscope.estimators.data.events import Event
from handscope.estimators.hand.anatomy import FINGERS

POINTS = ("left", "right", "bottom", "distal")
PALM = "palm"  # with a finger: a mark on the palm's crease, in line with it
TABLE = ("table", "top")
ELSEWHERE = (TABLE, *((PALM, finger) for finger in FINGERS[1:]))
LEAST_ON_TABLE = 3  # fingertips: two are level with any tilt

Place = tuple[str, str]  # a finger and one of POINTS, or one of ELSEWHERE
Outcome = Literal["used", "missed", "moving", "not measured"]


@dataclass(frozen=True)
class Contact:
    """Two places that touch; `distance` in m where it is known."""

    a: Place
    b: Place
    distance: float | None = None

    @property
    def part(self) -> str:
        return f"{self.a[0]}_{self.b[0]}"


@dataclass(frozen=True)
class HeldContact:
    """Contacts that were held together for calibration: one, or all of the fingertips on a table."""

    contacts: tuple[Contact, ...]
    onset: float  # s
    end: float  # s

    @property
    def on_table(self) -> bool:
        return self.contacts[0].b == TABLE

    @property
    def fingers(self) -> tuple[str, ...]:
        """Each once, in the contacts' order."""
        every = (end[0] for c in self.contacts for end in (c.a, c.b))
        return tuple(dict.fromkeys(name for name in every if name in FINGERS))


@dataclass(frozen=True)
class ContactOutcome:
    """What became of it: used, or refused because the points are farther from it than errors explain, or because the hand moved."""

    held: HeldContact
    outcome: Outcome
    missed: float = np.nan  # m, by how much it was missed before: the farthest point
    left_out: tuple[str, ...] = ()  # fingers that were not on the table with the others

    @property
    def used(self) -> bool:
        return self.outcome == "used"


def parse_contacts(details: Mapping[str, Any]) -> list[Contact]:
    """Pairs of fingertips that the columns `contacts` and `distances_mm` of an event name; none where they say nothing that can be read."""
    return [c for c in _parse(details) if c.b not in ELSEWHERE]


def held_contacts(events: Iterable[Event]) -> tuple[HeldContact, ...]:
    """What was held for calibration, in order of time; fingertips on a table together, where there are enough."""
    held = []
    for event in events:
        if event.trial_type != "contact":
            continue
        found = [c for c in _parse(event.details) if c.a[0] != c.b[0]]
        table = tuple({c.a[0]: c for c in found if c.b == TABLE}.values())
        groups: list[Sequence[Contact]] = [[c] for c in found if c.b != TABLE]
        groups += [table] if len(table) >= LEAST_ON_TABLE else []
        held += [HeldContact(tuple(group), event.onset, event.end) for group in groups]
    return tuple(sorted(held, key=lambda h: h.onset))


def _parse(details: Mapping[str, Any]) -> list[Contact]:
    words = str(details.get("contacts") or "").split()
    millimetres = [_parse_number(v) for v in str(details.get("distances_mm") or "").split()]
    found = []
    for k, word in enumerate(words):
        places = [_parse_place(end) for end in word.split("-")]
        if len(places) != 2:
            continue
        a, b = places
        if a is None or b is None or a in ELSEWHERE:
            continue
        known = millimetres[k] if k < len(millimetres) else None
        found.append(Contact(a, b, None if known is None else 1e-3 * known))
    return found


def _parse_place(text: str) -> Place | None:
    name, _, point = text.partition("_")
    is_known = (name, point) in ELSEWHERE or (name in FINGERS and point in POINTS)
    return (name, point) if is_known else None


def _parse_number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) and value >= 0 else None
