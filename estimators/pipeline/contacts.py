"""Contacts of fingertips that were held for calibration: which calibration each belongs to, and what is said of them."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.events import Event
from handscope.estimators.data.held_contact import (
    PALM,
    ContactOutcome,
    HeldContact,
    Place,
    held_contacts,
)
from handscope.estimators.messages import Message
from handscope.estimators.messages.finger_words import FINGER_WORDS
from handscope.estimators.messages.sentence import join, phrase


def with_contacts(
    calibrations: Sequence[Calibration], events: Sequence[Event]
) -> list[Calibration]:
    """The calibrations (in order of time), each with the contacts held after it and before the next."""
    held, ends = held_contacts(events), [*(c.t for c in calibrations[1:]), np.inf]
    return [
        replace(c, contacts=tuple(h for h in held if c.end <= h.onset and h.end <= end))
        for c, end in zip(calibrations, ends)
    ]


def contact_messages(outcomes: Iterable[ContactOutcome]) -> list[Message]:
    """Which contacts were used, and one for each that was refused or that a finger was left out of."""
    every = list(outcomes)
    used = join(name_of(o.held) for o in every if o.used)
    messages = [Message("contacts.used", {"contacts": used}, "info")] if used else []
    return [*messages, *(_refusal(o) for o in every if not o.used or o.left_out)]


def name_of(held: HeldContact) -> str:
    """In words, such as "thumb on index finger"."""
    if held.on_table:
        return phrase("contacts.table")
    a, b = held.contacts[0].a, held.contacts[0].b
    if b[0] == PALM:
        return phrase("contacts.palm", a=_finger(a))
    return phrase("contacts.pair", a=_finger(a), b=_finger(b))


def _finger(place: Place) -> str:
    return FINGER_WORDS[place[0]]


def _refusal(outcome: ContactOutcome) -> Message:
    contact, start = name_of(outcome.held), outcome.held.onset
    if outcome.left_out:
        fingers = join(FINGER_WORDS[finger] for finger in outcome.left_out)
        return Message(
            "contacts.left_out", {"contact": contact, "start": start, "fingers": fingers}
        )
    if outcome.outcome == "not measured":
        return Message("contacts.not_measured", {"contact": contact, "start": start})
    if outcome.outcome == "moving":
        return Message("contacts.moving", {"contact": contact, "start": start})
    missed = 1e3 * outcome.missed
    return Message("contacts.refused", {"contact": contact, "start": start, "missed_mm": missed})
