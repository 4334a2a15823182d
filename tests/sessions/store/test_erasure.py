"""Erasing really erases: nothing in the data folder tells of the patient any more, others keep everything, a power cut in between is made good."""

import shutil
from pathlib import Path

import pytest
from sqlalchemy import func, select

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import audit, notes, patients
from handscope.sessions.db.tables import (
    Base,
    ErasedFile,
    Patient,
    PatientSession,
    RecordingFile,
    Result,
)
from handscope.sessions.motion_bids import writer
from handscope.sessions.store import erasure, records
from handscope.sessions.store.store import Store, open_store
from tests.simulated import loaded, pose_and_wiggle


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return open_store(tmp_path)


def kept(
    store: Store, pseudonym: str, word: str, state: str = "processed", result: str = "done"
) -> int:
    """A patient with a note, a session, a recording's file and a result's; the id."""
    with store.database() as db:
        patient = patients.create(db, pseudonym, note=f"fell from {word}")
        session = PatientSession(
            patient=patient, hand="left", state=state, examiner=f"examined by {word}"
        )
        name = f"recordings/{pseudonym}.mcap"
        file = RecordingFile(
            session=session, format="native", file=name, original_name=f"{word}.zip", sha256=word
        )
        made = Result(
            recording=file, key="k", method="m2", version="1", state=result, content={"of": word}
        )
        db.add(made)
        db.commit()
        (store.folder / "results").mkdir(exist_ok=True)
        for place in (name, f"results/{made.id}.npz"):
            (store.folder / place).write_bytes(f"movement of {pseudonym}".encode())
        return patient.id


def mentions(store: Store, secret: bytes) -> list[str]:
    """Files of the data folder whose name or bytes hold it."""
    found = [p for p in store.folder.rglob("*") if p.is_file()]
    return sorted(p.name for p in found if secret in p.read_bytes() or secret in p.name.encode())


def test_nothing_is_left_of_an_erased_patient_and_everything_of_another(store: Store) -> None:
    quince, other = kept(store, "Quince-4711", "a ladder"), kept(store, "Plum-1", "a horse")
    with store.database() as db:
        patient = patients.change(db, quince, 1, pseudonym="Quince-4712")
        note = patient.notes[0]
        notes.change(db, note.id, note.version, removed=True)
        for secret in (b"Quince-4711", b"Quince-4712", b"a ladder"):
            assert mentions(store, secret), "the search finds what is there"
        counts = erasure.erase(db, store, quince, "  Quince-4712 ")
    for secret in (b"Quince", b"a ladder"):
        assert mentions(store, secret) == []
    assert counts == {
        "sessions": 1,
        "recordings": 1,
        "results": 1,
        "notes": 1,
        "bytes": 2 * len("movement of Quince-4711"),
    }
    with store.database() as db:
        assert [p.id for p in db.scalars(select(Patient))] == [other]
        assert {
            n: db.scalar(select(func.count()).select_from(t))
            for n, t in Base.metadata.tables.items()
            if n in ("result", "note")
        } == {
            "result": 1,
            "note": 1,
        }
        assert [(a.counts, a.ref, a.patient) for a in erasure.erasures(db)] == [(counts, "", None)]
        assert audit.verify(db).broken == ""
    assert mentions(store, b"movement of Plum-1") == ["2.npz", "Plum-1.mcap"]


@pytest.mark.parametrize(
    ("typed", "state", "result", "sentence"),
    [
        ("quince-4711", "processed", "done", "type the code exactly as it is stored: Quince-4711"),
        ("", "processed", "done", "type the code exactly"),
        ("Quince-4711", "open", "done", "a session of Quince-4711 is not finished"),
        ("Quince-4711", "recorded", "running", "results of Quince-4711 are being computed"),
    ],
)
def test_nothing_is_erased_by_a_slip_or_while_work_goes_on(
    store: Store, typed: str, state: str, result: str, sentence: str
) -> None:
    quince = kept(store, "Quince-4711", "a ladder", state, result)
    before = mentions(store, b"Quince-4711")
    with store.database() as db, pytest.raises(InputError, match=sentence):
        erasure.erase(db, store, quince, typed)
    assert mentions(store, b"Quince-4711") == before
    with store.database() as db:
        assert erasure.erasures(db) == []


def test_files_that_a_power_cut_left_are_removed_by_the_next_start(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    quince = kept(store, "Quince-4711", "a ladder")

    def power_cut(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as cut, store.database() as db:
        cut.setattr(erasure, "remove_erased", power_cut)
        with pytest.raises(KeyboardInterrupt):
            erasure.erase(db, store, quince, "Quince-4711")
    assert mentions(store, b"movement of Quince") == ["1.npz", "Quince-4711.mcap"]
    again = open_store(store.folder)
    assert mentions(again, b"Quince") == []
    with again.database() as db:
        assert db.scalars(select(ErasedFile)).all() == []


def test_an_upload_that_a_power_cut_left_without_a_session_is_removed_by_the_next_start(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    move = shutil.move

    def power_cut(source: Path, target: Path) -> None:
        move(source, target)
        raise KeyboardInterrupt

    def uploaded(name: str) -> Path:
        place = store.incoming / name
        place.write_bytes(writer.pack(writer.tree(loaded(pose_and_wiggle("left")), "01", "wiggle")))
        return place

    with store.database() as db:
        patient = patients.create(db, "P-1")
        whole = records.add_upload(db, store, patient, uploaded("a.zip"), "a.zip", None)
        monkeypatch.setattr(shutil, "move", power_cut)
        with pytest.raises(KeyboardInterrupt):
            records.add_upload(db, store, patient, uploaded("b.zip"), "b.zip", None)
    assert len(list((store.folder / "recordings").iterdir())) == 2
    open_store(store.folder).close()
    assert [p.name for p in (store.folder / "recordings").iterdir()] == [
        Path(f.file).name for f in whole.recordings
    ]


def session_of(store: Store, patient: int, tasks: list[str], state: str = "processed") -> int:
    """Another session of a patient, measured here, with one trial for each task; its number."""
    with store.database() as db:
        session = PatientSession(patient_id=patient, hand="left", state=state)
        events = [{"trial_type": "task", "task": name} for name in tasks]
        file = f"recordings/{patient}-{len(tasks)}.mcap"
        summary = {"events": [{"trial_type": "initial_pose"}, *events]}
        db.add(RecordingFile(session=session, format="native", file=file, summary=summary))
        db.commit()
        (store.folder / file).write_bytes(b"samples")
        return session.id


def test_an_empty_session_can_be_deleted_and_one_with_a_trial_cannot(store: Store) -> None:
    patient = kept(store, "P-1", "Plum")
    empty, full = session_of(store, patient, []), session_of(store, patient, ["tapping"])
    still_open = session_of(store, patient, [], state="open")
    with store.database() as db:
        erasure.erase_empty_session(db, store, empty)
        assert db.get(PatientSession, empty) is None
        for number in (full, still_open):
            with pytest.raises(InputError, match="only an empty session"):
                erasure.erase_empty_session(db, store, number)
        assert db.scalar(select(func.count()).select_from(ErasedFile)) == 0
    names = [p.name for p in (store.folder / "recordings").iterdir()]
    assert f"{patient}-0.mcap" not in names
    assert f"{patient}-1.mcap" in names


@pytest.mark.parametrize(
    ("outcome", "empty"),
    [({"outcome": "unable"}, False), ({"outcome": "skipped"}, True), ({}, False)],
)
def test_a_session_whose_patient_could_not_do_the_task_is_not_empty(
    store: Store, outcome: dict[str, str], empty: bool
) -> None:
    number = session_of(store, kept(store, "P-1", "Plum"), [])
    with store.database() as db:
        session = records.get(db, number)
        event = {"trial_type": "annotation", "task": "rom_fist", **outcome}
        session.recordings[0].summary = {"events": [event]}  # older versions stored no outcome
        assert erasure.is_empty(session) is empty
