"""What recordings tell of the gloves that made them."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy.orm import Session

from handscope.sessions.clinic import patients
from handscope.sessions.db import visible_rows
from handscope.sessions.db.tables import Patient, PatientSession, RecordingFile, Result, Ward
from handscope.sessions.db.visible_rows import Visibility
from handscope.sessions.gloves.known_gloves import known_gloves
from handscope.sessions.store.store import open_store

STREAM = {"name": "index", "sensors": ["index_proximal"], "rate": 200.0, "samples": 990}
CALIBRATION = {"source": "initial pose", "quality": {"index_proximal": {}, "index_distal": {}}}


def day(number: int) -> datetime:
    return datetime(2026, 11, number, 9, 0, tzinfo=UTC)


@pytest.fixture
def db(tmp_path: Path) -> Iterator[Session]:
    with open_store(tmp_path).database() as db:
        yield db


def recorded(
    db: Session, patient: Patient, on: int, source: dict[str, Any], calibrated: bool = False
) -> PatientSession:
    session = PatientSession(patient=patient, hand="left", state="recorded", started=day(on))
    summary = {"source": source, "streams": [STREAM], "losses": {"index": on}}
    file = RecordingFile(session=session, format="native", file=f"{on}.hsr", sha256=f"{on}")
    file.summary = summary
    if calibrated:
        content = {"calibration": CALIBRATION}
        file.results.append(
            Result(key="k", method="ekf", version="1", state="done", content=content)
        )
    db.add(session)
    db.commit()
    return session


def test_a_glove_is_known_by_its_number_as_its_newest_recording_shows_it(db: Session) -> None:
    patient = patients.create(db, "P-1")
    recorded(db, patient, 3, {"device": "Glove", "device_id": "7", "firmware": "1.0"}, True)
    recorded(db, patient, 5, {"device": "Renamed", "device_id": "7", "firmware": "1.1"})
    recorded(db, patient, 4, {"device": "Glove", "device_id": "8"})
    recorded(db, patient, 6, {"format": "Motion-BIDS"})  # of no glove that it names
    seven, eight = known_gloves(db)
    assert (seven.name, seven.device_id, seven.firmware) == ("Renamed", "7", "1.1")
    assert (seven.sessions, seven.started) == (2, day(5))
    assert seven.streams == [{**STREAM, "sensors": 1, "lost": 5}]
    assert (seven.calibrated, seven.calibrated_sensors) == (day(3), 2)
    assert (eight.device_id, eight.calibrated, eight.calibrated_sensors) == ("8", None, 0)


def test_gloves_of_another_wards_patients_are_not_shown(db: Session) -> None:
    ward = Ward(name="two")
    db.add(ward)
    db.commit()
    hidden = patients.create(db, "P-2", ward_id=ward.id)
    recorded(db, hidden, 3, {"device": "Glove", "device_id": "7"})
    visible_rows.restrict(db, Visibility(frozenset()))
    assert known_gloves(db) == []
