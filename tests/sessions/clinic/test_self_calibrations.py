"""Self-calibrations stay with the patient; a session takes over what a person decided, and nothing where nobody did."""

import io
import json
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.estimators.methods import OFFERED
from handscope.estimators.numerics import quaternions as quat
from handscope.sessions.clinic import audit, results, self_calibrations
from handscope.sessions.clinic.self_calibrations import FoundCalibration
from handscope.sessions.db.tables import (
    Patient,
    PatientSession,
    RecordingFile,
    Reuse,
    SelfCalibration,
)
from handscope.sessions.formats.derivative import calibration_table
from handscope.sessions.store import erasure, patient_export
from handscope.sessions.store.store import Store, open_store
from tests.simulated import calibrated, pose_and_wiggle

SURE = np.radians([0.1, 0.1, 0.5])
TURNED = quat.exp(np.array([0.0, 0.2, 0.0]))


def found(onset: float = 0.0) -> FoundCalibration:
    """A proximal phalanx of 43 mm whose sensor sits askew."""
    pose = calibrated(pose_and_wiggle("left"))
    geometry = replace(pose.geometry, lengths={**pose.geometry.lengths, "index_proximal": 0.043})
    c = replace(
        pose,
        geometry=geometry,
        q_BS={**pose.q_BS, "index_proximal": TURNED},
        q_BS_sd={"index_proximal": SURE},
        lengths_sd={"index_proximal": 2e-4},
    )
    return FoundCalibration(
        calibration_table(c), ["middle: its length is not observable"], onset, onset + 40.0
    )


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path)


@pytest.fixture
def db(store: Store) -> Iterator[Session]:
    with store.database() as opened:
        yield opened


def visit(
    db: Session, patient: Patient, glove: str = "g1", hand: str = "left", day: int = 1
) -> RecordingFile:
    """A closed recording of a visit."""
    session = PatientSession(patient=patient, hand=hand, state="processed")
    summary = {"source": {"device_id": glove}, "events": [], "duration": 60.0}
    made = RecordingFile(
        session=session,
        format="native",
        file=f"recordings/{glove}{day}",
        sha256=f"{glove}{day}",
        summary=summary,
    )
    db.add(made)
    db.commit()
    return made


@pytest.fixture
def patient(db: Session) -> Patient:
    made = Patient(pseudonym="Quince-1")
    db.add(made)
    db.commit()
    return made


def test_nothing_is_taken_over_that_nobody_decided(db: Session, patient: Patient) -> None:
    first, later = visit(db, patient), visit(db, patient, day=2)
    self_calibrations.store(db, first, found(), "1")
    assert self_calibrations.decision(later.session) is None
    assert results.find_matching(db, later, "m2", {}, "1").reused == {}


def test_lengths_alone_or_also_seats_are_taken_over_as_decided_and_a_result_is_a_function_of_that(
    db: Session, patient: Patient
) -> None:
    first, later = visit(db, patient), visit(db, patient, day=2)
    kept = self_calibrations.store(db, first, found(), "1")
    before = results.find_matching(db, later, "m2", {}, "1")
    self_calibrations.decide(db, later.session, "lengths", kept.id)
    lengths = results.find_matching(db, later, "m2", {}, "1")
    assert lengths.reused == {"self_calibration": kept.id, "parts": "lengths"}
    known = self_calibrations.load_prior(db, lengths.reused)
    assert known is not None
    assert (known.lengths, known.q_BS, known.gyr_bias) == ({"index_proximal": 0.043}, {}, {})
    self_calibrations.decide(db, later.session, "lengths_and_seats", kept.id)
    everything = results.find_matching(db, later, "m2", {}, "1")
    known = self_calibrations.load_prior(db, everything.reused)
    assert known is not None
    np.testing.assert_allclose(known.q_BS["index_proximal"], TURNED)
    assert results.current(later) == [everything]
    self_calibrations.decide(db, later.session, "nothing")
    assert results.find_matching(db, later, "m2", {}, "1").id == before.id
    assert results.current(later) == [before]
    assert [r.parts for r in later.session.reuses] == [
        "lengths",
        "lengths_and_seats",
        "nothing",
    ]  # what was decided stays readable


def test_offered_methods_that_begin_with_a_pose_take_it_over_and_no_others() -> None:
    assert set(self_calibrations.USED_BY) == {
        name for name, m in OFFERED.items() if m.CAPABILITIES.needs_pose
    }


def test_of_another_glove_only_lengths_are_offered_and_of_another_hand_nothing(
    db: Session, patient: Patient
) -> None:
    kept = self_calibrations.store(db, visit(db, patient), found(), "1")
    other_glove, other_hand = (
        visit(db, patient, glove="g2"),
        visit(db, patient, hand="right", day=3),
    )
    (offer,) = self_calibrations.offers(other_glove.session)
    assert (offer.self_calibration.id, offer.parts) == (kept.id, ("lengths",))
    assert self_calibrations.offers(other_hand.session) == []
    with pytest.raises(InputError, match="another glove is worn"):
        self_calibrations.decide(db, other_glove.session, "lengths_and_seats", kept.id)
    with pytest.raises(InputError, match="of another hand"):
        self_calibrations.decide(db, other_hand.session, "lengths", kept.id)
    with pytest.raises(InputError, match="parts are nothing, lengths, lengths_and_seats"):
        self_calibrations.decide(db, other_glove.session, "seats", kept.id)
    with pytest.raises(InputError, match="name the self-calibration"):
        self_calibrations.decide(db, other_glove.session, "lengths")
    assert self_calibrations.decision(other_glove.session) is None


def test_the_newest_is_offered_first_and_one_that_was_withdrawn_not_at_all(
    db: Session, patient: Patient
) -> None:
    first, second = visit(db, patient), visit(db, patient, day=2)
    old, new = (
        self_calibrations.store(db, first, found(), "1"),
        self_calibrations.store(db, second, found(), "1"),
    )
    third = visit(db, patient, day=3)
    assert [o.self_calibration.id for o in self_calibrations.offers(third.session)] == [
        new.id,
        old.id,
    ]
    self_calibrations.withdraw(db, new.id, True)
    assert [o.self_calibration.id for o in self_calibrations.offers(third.session)] == [old.id]
    self_calibrations.withdraw(db, new.id, False)
    assert len(self_calibrations.offers(third.session)) == 2


def test_the_same_stretch_is_kept_once_and_what_is_no_self_calibration_is_refused(
    db: Session, patient: Patient
) -> None:
    file = visit(db, patient)
    assert (
        self_calibrations.store(db, file, found(), "1").id
        == self_calibrations.store(db, file, found(), "1").id
    )
    assert self_calibrations.store(db, file, found(onset=50.0), "1").id == 2
    with pytest.raises(InputError, match="no self-calibration"):
        self_calibrations.store(db, file, replace(found(), table={"MeasuredHand": "both"}), "1")
    with pytest.raises(InputError, match="no self-calibration"):
        self_calibrations.of_result(results.find_matching(db, file, "m2", {}, "1"))


def test_export_audit_and_erasure_include_it(db: Session, store: Store, patient: Patient) -> None:
    (store.folder / "recordings").mkdir(exist_ok=True)
    file = visit(db, patient)
    kept = self_calibrations.store(db, file, found(), "1")
    self_calibrations.decide(db, file.session, "lengths", kept.id)
    trail = [(f"{line.what} {line.kind}", line.ref, line.patient) for line in audit.list_lines(db)]
    assert ("created self_calibration", str(kept.id), patient.id) in trail
    assert ("created reuse", "1", patient.id) in trail
    out = io.BytesIO()
    patient_export.write(db, store, patient.id, "1", out)
    with zipfile.ZipFile(out) as archive:
        (told,) = json.loads(archive.read("patient.json"))["self_calibrations"]
        session = json.loads(archive.read(f"sessions/{file.session_id}/session.json"))
    assert told["found"]["segment_lengths"]["index_proximal"] == {"value": 0.043, "sd": 2e-4}
    assert [r["parts"] for r in session["reuses"]] == ["lengths"]
    erasure.erase(db, store, patient.id, "Quince-1")
    assert [
        db.scalar(select(func.count()).select_from(table)) for table in (SelfCalibration, Reuse)
    ] == [0, 0]
