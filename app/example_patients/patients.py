"""The simulated patients put into a data folder, without their sessions (sessions.py)."""

import time
from datetime import timedelta
from pathlib import Path

from handscope.app.example_patients.stories import STORIES
from handscope.sessions.clinic import patients
from handscope.sessions.db.tables import now
from handscope.sessions.store.store import Store
from handscope.sessions.treatment import events, goals

# a file in the data folder until all sessions are there, touched with each that is made
UNFINISHED = "examples-unfinished"
SLOWEST = 300.0  # s that one takes at most


def add_patients(store: Store) -> None:
    """Add the patients without their sessions, and remember that these are to come."""
    (store.folder / UNFINISHED).touch()
    with store.database() as db:
        for story in reversed(STORIES):  # the newest stands first in the list
            patient = patients.create(
                db,
                story.code,
                story.note,
                confirmed=True,
                year_of_birth=story.born,
                dominant_hand=story.dominant,
                affected_hand=story.affected,
            )
            for t in story.treated:
                day = (now() - timedelta(weeks=t.weeks)).date()
                events.add(db, patient, t.kind, story.hand, day, t.comment)
            for a in story.aims:
                goals.put(db, patient, story.hand, a.key, a.unit, a.low, a.high)


def planned(folder: Path) -> dict[str, int]:
    """How many sessions the patients will have, by their codes, while these are made; empty before and after."""
    try:
        touched = (folder / UNFINISHED).stat().st_mtime
    except FileNotFoundError:
        return {}
    is_made = time.time() - touched < SLOWEST  # not left by a demonstration that was stopped
    return {s.code: sum(1 for _ in s.sessions()) for s in STORIES} if is_made else {}


def are_unfinished(folder: Path) -> bool:
    """Whether sessions of the patients are to be made still."""
    return (folder / UNFINISHED).exists()
