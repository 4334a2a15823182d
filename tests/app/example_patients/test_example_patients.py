"""The demonstration's simulated patients: what their hands can do is what is measured of them, and everything says that nobody was measured."""

import os
import time
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path

import pytest
from sqlalchemy import select

from handscope.app.commands import demo
from handscope.app.example_patients import patients, sessions
from handscope.app.example_patients.recordings import PERFORMED, write
from handscope.app.example_patients.stories import STORIES, Ability, between
from handscope.app.language import languages
from handscope.app.protocols import load_all
from handscope.app.report.page import words_of
from handscope.app.results.report import report
from handscope.sessions.clinic import pseudonyms
from handscope.sessions.clinic.repeatability import values
from handscope.sessions.db.tables import Patient, PatientSession, now
from handscope.sessions.formats import recordings
from handscope.sessions.store.store import Store, open_store

TENDON = next(s for s in STORIES if "zone II" in s.code)
PIP = ("range_of_motion", "rom_fist", "index_pip_flexion_max")


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Store]:
    """With one patient of two sessions, the other hand after the first."""
    story = replace(TENDON, course=((8.0, 0.0), (1.0, 1.0)), both=(0,), tasks=("rom_fist",))
    for module in (patients, sessions):
        monkeypatch.setattr(module, "STORIES", (story,))
    made = open_store(tmp_path)
    patients.add_patients(made)
    yield made
    made.close()


def test_what_is_told_of_them_is_read_in_every_language() -> None:
    told = {text for s in STORIES for text in (s.note, *(t.comment for t in s.treated))}
    for text in (*told, demo.NOTE):
        words = {language.example(text) for language in languages().values()}
        assert text in words and len(words) == len(languages()), text
    assert languages()["de"].example("Own words of a clinician.") == "Own words of a clinician."


def test_what_is_measured_follows_the_story(store: Store) -> None:
    sessions.add_sessions(store)
    with store.database() as db:
        last, other, first = db.scalars(select(PatientSession).order_by(-PatientSession.id))
        (patient,) = db.scalars(select(Patient))
        assert (first.hand, other.hand, last.hand) == ("left", "right", "left")
        assert (other.continues_id, first.continues_id) == (first.id, None)
        assert first.started < other.started < last.started
        bends = [values(s.recordings[0].results[0].figures)[PIP][0] for s in (first, last, other)]
        assert bends[0] < 0.65 * bends[2] < 0.8 * bends[1]  # shares of the fist: 0.5, 0.92, 1
        first.plan = {"name": "stroke", "title": "Stroke", "version": 2}
        reports = [report(store, s.recordings[0].results[0]) for s in (first, other, last)]
        assert [r.same_visit for r in reports] == [False, True, False]
        assert [r.visit.protocol for r in reports] == [first.plan, {}, {}]
        kept = reports[0].course
        assert kept is not None and kept.other is None, "what it is compared with stays"
        assert [r.later_hand is not None for r in reports] == [True, False, False]
        both = [words_of(r, languages()["en"])["both_hands"] for r in reports]
        assert [b is not None for b in both] == [True, True, False]
        assert "after this one in the same visit" in both[0]["summary"]
        assert f"result {other.recordings[0].results[0].id}, computed on" in both[0]["summary"]
        (rows, mirrored) = (b["parts"][0]["rows"] for b in both[:2])
        assert [r[:3] for r in rows] == [[name, own, theirs] for name, theirs, own, _ in mirrored]
        assert {s.examiner for s in (first, last)} == {sessions.EXAMINER}
        facts = {
            code: words_of(reports[0], language)["facts"] for code, language in languages().items()
        }
        assert ["Glove", "simulated glove", ""] in facts["en"]
        assert ["Handschuh", "simulierter Handschuh", ""] in facts["de"]
        assert "nobody was measured" in patient.notes[0].text
        assert [g.figure for g in patient.goals] == ["index_pip_flexion_max"]
        assert {e.kind for e in patient.treatment_events} == {"splint", "operation"}
    assert not patients.are_unfinished(store.folder)


def test_what_was_made_before_an_interruption_is_not_made_again(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    writing, made = sessions.write, []

    def until_the_second(*told: object) -> None:
        if len(made) == 1:
            raise KeyboardInterrupt
        made.append(told[2])
        writing(*told)  # type: ignore[arg-type]

    monkeypatch.setattr(sessions, "write", until_the_second)
    with pytest.raises(KeyboardInterrupt):
        sessions.add_sessions(store)
    assert patients.are_unfinished(store.folder)
    monkeypatch.setattr(sessions, "write", writing)
    monkeypatch.setattr(sessions, "now", lambda: now() + timedelta(days=1))  # after midnight
    sessions.add_sessions(store)
    with store.database() as db:
        first, other, last = db.scalars(select(PatientSession))
        assert [s.hand for s in (first, other, last)] == ["left", "right", "left"]
        assert [s.continues_id for s in (first, other, last)] == [None, first.id, None]
        assert other.started == first.started + sessions.OTHER_HAND_AFTER


def test_how_many_sessions_are_to_come_is_known_while_they_are_made(store: Store) -> None:
    marker = store.folder / patients.UNFINISHED
    assert patients.planned(store.folder) == {TENDON.code: 3}
    stopped = time.time() - patients.SLOWEST - 1
    os.utime(marker, (stopped, stopped))
    assert patients.planned(store.folder) == {}
    marker.unlink()
    assert patients.planned(store.folder) == {}


def test_a_folder_with_patients_gets_no_examples(tmp_path: Path) -> None:
    told = Namespace(data=tmp_path, database=None, no_examples=True)
    demo._add_patients(told)
    demo._add_patients(Namespace(data=tmp_path, database=None, no_examples=False))
    assert not patients.are_unfinished(tmp_path)
    store = open_store(tmp_path)
    with store.database() as db:
        assert [p.pseudonym for p in db.scalars(select(Patient))] == ["DEMO"]
    store.close()


def test_stories_can_be_performed_and_tell_no_name() -> None:
    protocols = load_all()
    assert len(STORIES) == 6
    for story in STORIES:
        assert set(story.tasks) <= PERFORMED.keys() & protocols.keys()
        assert all(a[0] > b[0] for a, b in pairwise(story.course)), "oldest first"
        assert pseudonyms.find_doubts(story.code) == () and story.code.startswith("SIM-")
        assert "nobody was measured" in story.note
        assert all(k < len(story.course) for k in story.both)


def test_abilities_are_mixed_with_those_of_a_hand_without_complaint() -> None:
    half = between(Ability(fist={"index_pip": 0.5}, lag={"index_pip": 20.0}), Ability(), 0.5)
    assert (half.fist, half.lag) == ({"index_pip": 0.75}, {"index_pip": 10.0})


def test_a_simulated_recording_tells_its_day(tmp_path: Path) -> None:
    started = datetime(2026, 5, 12, 8, 20, tzinfo=UTC)
    write(Ability(), ("tapping",), "left", (0, 0), started, tmp_path / "r.zip")
    told = recordings.load(tmp_path / "r.zip", "left").start_utc
    assert told is not None and datetime.fromisoformat(told) == started
