"""Contacts of fingertips that were held for calibration: which calibration each belongs to, and what is said of them."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.events import Event
from handscope.estimators.data.held_contact import Contact, ContactOutcome, held_contacts
from handscope.estimators.messages import Message


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
    """Which contacts were used, and one for each that was refused."""
    every = list(outcomes)
    used = ", ".join(pair_of(o.held.contact) for o in every if o.used)
    messages = [Message("contacts.used", {"contacts": used}, "info")] if used else []
    return [*messages, *(_refusal(o) for o in every if not o.used)]


def pair_of(contact: Contact) -> str:
    """Its fingers, as `thumb-index`."""
    return f"{contact.a[0]}-{contact.b[0]}"


def _refusal(outcome: ContactOutcome) -> Message:
    pair, onset = pair_of(outcome.held.contact), outcome.held.onset
    if np.isnan(outcome.missed):
        return Message("contacts.not_measured", {"contact": pair, "start": onset})
    values: dict[str, float | str] = {
        "contact": pair,
        "start": onset,
        "missed_mm": 1e3 * outcome.missed,
    }
    return Message("contacts.refused", values)
