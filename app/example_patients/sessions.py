"""The simulated patients' sessions put into a data folder in the order of time, each processed at once.

What is made lies in the folder like anything measured: recordings, results, reports, replays. A session that is there is not made again.
"""

import argparse
import tempfile
from datetime import timedelta
from pathlib import Path

from sqlalchemy import select
from sqlalchemy.orm import Session

from handscope.app.example_patients.patients import UNFINISHED
from handscope.app.example_patients.recordings import write
from handscope.app.example_patients.stories import STORIES, Ability, Story, between
from handscope.app.results.make import make
from handscope.app.version import software_version
from handscope.app.workers.process import stand_back
from handscope.estimators.methods import DEFAULT
from handscope.sessions.clinic import results
from handscope.sessions.db.tables import Patient, PatientSession, RecordingFile, now
from handscope.sessions.store import records
from handscope.sessions.store.store import Store, store_at

EXAMINER = "SIM"  # initials, as of anybody; the patients' codes begin with them
OTHER_HAND_AFTER = timedelta(minutes=12)
NICE = 19  # whoever measures meanwhile comes first


def add_sessions(store: Store) -> None:
    """Add the sessions of every patient that is there; what was made before stays."""
    (store.folder / UNFINISHED).touch()
    with store.database() as db, tempfile.TemporaryDirectory() as folder:
        for k, story in enumerate(STORIES):
            patient = db.scalar(select(Patient).where(Patient.pseudonym == story.code))
            if patient is not None:
                _add_course(db, store, patient, (k, story), Path(folder))
    (store.folder / UNFINISHED).unlink(missing_ok=True)


def _add_course(
    db: Session, store: Store, patient: Patient, numbered: tuple[int, Story], folder: Path
) -> None:
    number, story = numbered
    made = {f.original_name: s for s in patient.sessions for f in s.recordings}
    morning = now().replace(hour=8, minute=20, second=0, microsecond=0)
    before: PatientSession | None = None  # in the order of time
    for k, (hand, weeks, share) in enumerate(story.sessions()):
        name = f"{story.code.split()[0].lower()}-{k + 1}.zip"
        if name in made:
            before = made[name]
            continue
        started = morning - timedelta(days=round(7 * weeks), minutes=-40 * number)
        able, first = between(story.begin, story.end, share), None
        if hand != story.hand and before is not None:
            able, first, started = Ability(), before, before.started + OTHER_HAND_AFTER
        write(able, story.tasks, hand, (number, k), started, folder / name)
        session = records.add_upload(db, store, patient, folder / name, name, hand)
        session.examiner, session.started = EXAMINER, started
        session.continues_id = first.id if first is not None else None
        db.commit()
        before = session
        _process(db, store, session.recordings[0])
        (store.folder / UNFINISHED).touch()


def _process(db: Session, store: Store, file: RecordingFile) -> None:
    result = results.find_matching(db, file, DEFAULT, {}, software_version())
    make(store, result.id)


def main() -> None:
    """In a process of its own, beside the server that holds the folder: add the sessions."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--database")
    arguments = parser.parse_args()
    stand_back(NICE)
    add_sessions(store_at(arguments.folder, arguments.database))


if __name__ == "__main__":
    main()
