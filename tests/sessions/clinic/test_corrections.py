"""Corrections: the recording stays, results are a function of what counts, everything is told, and what is undone stays readable."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy.orm import Session

from handscope.estimators.data.samples import Event
from handscope.estimators.errors import InputError
from handscope.estimators.messages import Message
from handscope.estimators.messages.sentence import Sentence, codes_of, messages_of
from handscope.sessions.clinic import corrections, results, trunk_height
from handscope.sessions.db.tables import (
    Correction,
    Patient,
    PatientSession,
    RecordingFile,
    Repeatability,
    Result,
)
from handscope.sessions.store import visit_facts
from handscope.sessions.store.store import open_store
from handscope.sessions.store.visit_facts import TrunkHeight
from tests.simulated import loaded, pose_and_wiggle

TRIALS = [
    ("initial_pose", 0.0, 3.0, None),
    ("task", 4.0, 15.0, "tapping"),
    ("task", 22.0, 15.0, "tapping"),
    ("task", 40.0, 12.0, "rom_fist"),
]


@pytest.fixture
def db(tmp_path: Path) -> Iterator[Session]:
    with open_store(tmp_path).database() as opened:
        yield opened


@pytest.fixture
def file(db: Session) -> RecordingFile:
    events = [
        {"trial_type": kind, "onset": onset, "duration": long, "task": task}
        for kind, onset, long, task in TRIALS
    ]
    session = PatientSession(patient=Patient(pseudonym="one"), hand="left", state="processed")
    made = RecordingFile(
        session=session,
        format="native",
        file="f",
        sha256="aa",
        summary={"events": events, "duration": 60.0},
    )
    db.add(made)
    db.commit()
    return made


def test_a_result_is_a_function_of_what_counts_and_undoing_gives_the_first_one_back(
    db: Session, file: RecordingFile
) -> None:
    first = results.find_matching(db, file, "m2", {}, "1")
    made = corrections.add(db, file, 2, "exclude", " Pain ")
    second = results.find_matching(db, file, "m2", {}, "1")
    assert second.id != first.id
    assert second.corrections == [
        {"event": 2, "kind": "exclude", "onset": 22.0, "end": 37.0, "reason": "Pain"}
    ]
    assert results.current(file) == [second]
    corrections.undo(db, made.id)
    assert results.find_matching(db, file, "m2", {}, "1").id == first.id
    assert results.current(file) == [first]
    assert [(c.reason, c.undone is None) for c in file.corrections] == [
        ("Pain", False)
    ]  # what was decided stays readable


def test_an_offered_reason_keeps_its_code_and_a_typed_one_its_words(
    db: Session, file: RecordingFile
) -> None:
    coded = corrections.add(db, file, 1, "exclude", corrections.OFFERED["slipped"])
    typed = corrections.add(db, file, 2, "exclude", "slipped")
    db.expire_all()
    assert [*messages_of(coded.reason)] == [Message("correction.reason_slipped", {})]
    assert [corrections.reason_code(c) for c in (coded, typed)] == ["slipped", ""]
    assert not isinstance(typed.reason, Sentence)
    kept = results.find_matching(db, file, "m2", {}, "1")
    db.expire_all()
    assert results.current(file) == [kept]
    assert codes_of(kept.corrections[0]["reason"]) == {"correction.reason_slipped"}


def test_english_words_of_an_offered_reason_that_were_stored_before_have_its_code(
    db: Session, file: RecordingFile
) -> None:
    db.add(Correction(recording=file, event=1, kind="exclude", onset=4.0, end=19.0, reason="Wrong movement"))  # fmt: skip
    db.add(Correction(recording=file, event=2, kind="exclude", onset=22.0, end=37.0, reason="Falsche Bewegung"))  # fmt: skip
    db.commit()
    db.expire_all()
    assert [corrections.reason_code(c) for c in file.corrections] == ["wrong", ""]
    first, second = corrections.active(file)
    assert codes_of(first["reason"]) == {"correction.reason_wrong"}
    assert second["reason"] == "Falsche Bewegung"


def test_a_height_of_the_trunk_told_afterwards_counts_in_new_results_and_can_be_put_back(
    db: Session, file: RecordingFile
) -> None:
    with pytest.raises(InputError, match="no sensor on the trunk"):
        visit_facts.change(db, file.session_id, 1, trunk=TrunkHeight(0.42))
    file.summary = {**file.summary, "streams": [{"name": "trunk", "sensors": ["trunk"]}]}
    first = results.find_matching(db, file, "m2", {}, "1")
    with pytest.raises(InputError, match="42000 mm above the hips is outside 100 to 700 mm"):
        visit_facts.change(db, file.session_id, 1, trunk=TrunkHeight(42.0))
    visit_facts.change(db, file.session_id, 1, trunk=TrunkHeight(0.42))
    second = results.find_matching(db, file, "m2", {}, "1")
    assert (first.trunk_height, second.trunk_height, results.current(file)) == (
        None,
        0.42,
        [second],
    )
    told = trunk_height.apply(loaded(pose_and_wiggle("left")), 0.42)
    assert {e.details.get("trunk_height") for e in told.events if e.trial_type == "task"} == {0.42}
    visit_facts.change(db, file.session_id, 2, trunk=TrunkHeight(None))
    assert results.find_matching(db, file, "m2", {}, "1").id == first.id
    assert results.current(file) == [first]


def test_ends_moved_again_replace_the_ends_moved_before(db: Session, file: RecordingFile) -> None:
    corrections.add(db, file, 1, "move", "began late", 6.0, 19.0)
    corrections.add(db, file, 1, "move", "began later", 8.0, 19.0)
    assert [(c["onset"], c["reason"]) for c in corrections.active(file)] == [(8.0, "began later")]
    assert len(file.corrections) == 2


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ((0, "exclude", "x"), "there is no task 0"),
        ((9, "exclude", "x"), "there is no task 9"),
        ((1, "shorten", "x"), "there is no correction 'shorten'"),
        ((1, "exclude", "  "), "needs a reason"),
        ((1, "move", "x", 9.0, 9.1), "lasts 0.5 s at least"),
        ((1, "move", "x", 9.0, 99.0), "within the recording"),
        ((3, "leave_out", "x", 44.0, 43.0), "ends before it begins"),
        ((3, "leave_out", "x", 30.0, 43.0), "lies within the trial"),
        ((3, "leave_out", "x", 40.0, 52.0), "leave out the trial"),
        ((1, "leave_out", "x", 5.0, 6.0), "taps that follow each other"),
    ],
)
def test_what_cannot_be_is_refused_in_words_and_leaves_nothing(
    db: Session, file: RecordingFile, given: tuple, sentence: str
) -> None:  # type: ignore[type-arg]
    with pytest.raises(InputError, match=sentence):
        corrections.add(db, file, *given)
    assert corrections.active(file) == []


def test_a_trial_is_left_out_once(db: Session, file: RecordingFile) -> None:
    corrections.add(db, file, 1, "exclude", "x")
    with pytest.raises(InputError, match="left out already"):
        corrections.add(db, file, 1, "exclude", "y")


def test_events_are_corrected_and_every_correction_is_said() -> None:
    tasks = tuple(
        Event(onset, long, kind, {"task_name": task} if task else {})
        for kind, onset, long, task in TRIALS
    )
    recording = replace(loaded(pose_and_wiggle("left")), events=tasks)
    rows = [
        {"event": 1, "kind": "exclude", "onset": 4.0, "end": 19.0, "reason": "Pain"},
        {"event": 2, "kind": "move", "onset": 24.0, "end": 34.0, "reason": "began late"},
        {"event": 3, "kind": "leave_out", "onset": 41.0, "end": 44.0, "reason": "helped"},
    ]
    made = corrections.apply(recording, rows)
    assert made.events[1].details["excluded"] == "Pain"
    assert (made.events[2].onset, made.events[2].end) == (24.0, 34.0)
    assert made.events[3].details["left_out"] == [(41.0, 44.0)]
    assert recording.events == tasks
    assert made.warnings[-3:] == (
        "tapping, trial 1: left out of the figures (Pain)",
        "tapping, trial 2: counted from 2.0 to 12.0 s of the trial as recorded (began late)",
        "rom fist: 1.0 to 4.0 s left out of the figures (helped)",
    )
    assert corrections.apply(recording, []) is recording


def test_repeatability_goes_by_the_results_that_count(db: Session, file: RecordingFile) -> None:
    figure = {
        "measure": "range_of_motion",
        "task": "rom_fist",
        "name": "index_pip_flexion_max",
        "unit": "rad",
        "grade": "good",
    }
    other = RecordingFile(
        session=PatientSession(patient=file.session.patient, hand="left"),
        format="native",
        file="g",
        sha256="bb",
    )
    for of, value in ((file, 1.0), (other, 1.2)):
        db.add(
            Result(
                recording=of,
                key="k",
                method="m2",
                version="1",
                state="done",
                figures=[{**figure, "value": value}],
            )
        )
    db.commit()
    before = db.query(Repeatability).one().sem
    made = corrections.add(db, file, 3, "exclude", "x")
    assert db.query(Repeatability).count() == 0  # until there is a result by what counts now
    figures = [{**figure, "value": 1.1}]
    db.add(
        Result(
            recording=file,
            key="l",
            method="m2",
            version="1",
            state="done",
            corrections=corrections.active(file),
            figures=figures,
        )
    )
    db.commit()
    assert db.query(Repeatability).one().sem == pytest.approx(before / 2)
    corrections.undo(db, made.id)
    assert db.query(Repeatability).one().sem == pytest.approx(before)
