"""Points of fingertips that touch or are held apart, as events tell them.

In      columns `contacts` ("thumb_bottom-index_bottom ...") and `distances_mm` of an event
Out     pairs of points; those of `contact` events, which were held for calibration, with when
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from handscope.estimators.data.events import Event
from handscope.estimators.hand.anatomy import FINGERS

POINTS = ("left", "right", "bottom", "distal")


@dataclass(frozen=True)
class Contact:
    """Two points on skin; `distance` in m where it is known."""

    a: tuple[str, str]  # finger, point of POINTS
    b: tuple[str, str]
    distance: float | None = None

    @property
    def part(self) -> str:
        return f"{self.a[0]}_{self.b[0]}"


@dataclass(frozen=True)
class HeldContact:
    """A contact that was held for calibration."""

    contact: Contact
    onset: float  # s
    end: float  # s


@dataclass(frozen=True)
class ContactOutcome:
    """What became of it: used, or refused because the points are farther from it than errors explain."""

    held: HeldContact
    used: bool
    missed: float  # m, by how much it was missed before; NaN where a finger is not measured


def parse_contacts(details: Mapping[str, Any]) -> list[Contact]:
    """What the columns `contacts` and `distances_mm` of an event say; none where they say nothing that can be read."""
    words = str(details.get("contacts") or "").split()
    millimetres = [_parse_number(v) for v in str(details.get("distances_mm") or "").split()]
    found = []
    for k, word in enumerate(words):
        ends = [tuple(end.split("_")) for end in word.split("-")]
        if len(ends) == 2 and all(len(e) == 2 and e[0] in FINGERS and e[1] in POINTS for e in ends):
            (a, p), (b, q) = ends
            known = millimetres[k] if k < len(millimetres) else None
            found.append(Contact((a, p), (b, q), None if known is None else 1e-3 * known))
    return found


def held_contacts(events: Iterable[Event]) -> tuple[HeldContact, ...]:
    """Contacts of two fingers that were held for calibration, in order of time."""
    held = [
        HeldContact(contact, event.onset, event.end)
        for event in events
        if event.trial_type == "contact"
        for contact in parse_contacts(event.details)
        if contact.a[0] != contact.b[0]
    ]
    return tuple(sorted(held, key=lambda h: h.onset))


def _parse_number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) and value >= 0 else None
