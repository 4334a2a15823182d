"""Data withheld from scientists: whatever may identify a patient in spite of the code.

Shown: the code, hands, hand measures, days of sessions, movement, figures. Withheld: the year of birth, and all free
text, since it may contain anything: notes, the conclusion, the examiner's name, reasons, comments, a file's name; and doubts about dates, which
reveal the year.
"""

from collections.abc import Mapping
from typing import Any

from handscope.app.auth.roles import Requester

WITHHELD: Mapping[str, Any] = {
    "year_of_birth": None,
    "notes": None,
    "conclusion": "",
    "examiner": "",
    "name": "",
    "reason": "",
    "reason_code": "",
    "comment": "",
    "date_reason": "",
    "doubts": [],
}
# the rest may be text
OF_EVENTS = "trial_type", "onset", "duration", "task_name", "outcome", "score"


def for_reader(requester: Requester, row: Mapping[str, Any]) -> dict[str, Any]:
    """A row of a patient, session, recording or correction as the account may see it; an empty list stays one."""
    if requester.sees_all:
        return dict(row)
    return {key: _empty(key, value) if key in WITHHELD else value for key, value in row.items()}


def events_for(requester: Requester, content: Mapping[str, Any]) -> dict[str, Any]:
    """A kept result's content without what was typed at its events."""
    if requester.sees_all or "events" not in content:
        return dict(content)
    return {
        **content,
        "events": [
            {key: _without_reason(event[key]) for key in OF_EVENTS if key in event}
            for event in content["events"]
        ],
    }


def _without_reason(value: Any) -> Any:
    """An outcome such as "unable: REASON" without what was typed."""
    return value.partition(":")[0] if isinstance(value, str) else value


def _empty(key: str, value: Any) -> Any:
    return [] if isinstance(value, list) else "" if isinstance(value, str) else WITHHELD[key]
