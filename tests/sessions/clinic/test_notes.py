"""Notes: the text of the earlier single field is kept, and what was removed long ago is forgotten."""

from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

from alembic import command
from alembic.config import Config
from sqlalchemy import create_engine, select, text

from handscope.sessions.clinic import notes, patients
from handscope.sessions.db.tables import Note, Patient
from handscope.sessions.store import database
from handscope.sessions.store.store import open_store


def test_a_removed_note_is_forgotten_when_it_cannot_be_brought_back_any_more(
    tmp_path: Path,
) -> None:
    store = open_store(tmp_path)
    with store.database() as db:
        patient = patients.create(db, "P")
        old, young = (notes.write(db, patient, word) for word in ("old", "young"))
        notes.write(db, patient, "standing")
        for note, age in ((old, 1.01), (young, 0.99)):
            notes.change(db, note.id, note.version, removed=True)
            assert note.removed is not None
            note.removed -= age * notes.RETENTION
        db.commit()
    with open_store(tmp_path).database() as db:
        assert [n.text for n in db.scalars(select(Note).order_by(Note.id))] == ["young", "standing"]


def _at(engine: Any, to: str, move: Callable[[Config, str], None] = command.upgrade) -> None:
    config = Config()
    config.set_main_option("script_location", database.MIGRATIONS)
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        move(config, to)


def test_an_older_database_keeps_every_row_and_note_and_gives_no_number_twice(
    tmp_path: Path,
) -> None:
    engine = create_engine(f"sqlite:///{tmp_path / database.FILE}")
    _at(engine, "0004")
    day = "2026-05-12 09:00:00.000000"
    with engine.begin() as old:
        for k, note in ((1, ""), (2, "tired")):
            old.execute(
                text(
                    f"insert into patient values ({k}, 'P{k}', null, null, null, '{{}}', '{note}', 0, '{day}', 3)"
                )
            )
            old.execute(
                text(
                    f"insert into session values ({k}, {k}, 'left', 'processed', '{day}', null, '', '', '{{}}')"
                )
            )
            old.execute(
                text(
                    f"insert into recording values ({k}, {k}, 'native', 'f{k}', '', 'x', 0, '{day}', '{{}}')"
                )
            )
    store = open_store(tmp_path)
    with store.database() as db:
        one, two = db.scalars(select(Patient).order_by(Patient.id))
        assert ([n.text for n in one.notes], [n.text for n in two.notes], two.version) == (
            [],
            ["tired"],
            3,
        )
        assert [f.file for p in (one, two) for s in p.sessions for f in s.recordings] == [
            "f1",
            "f2",
        ]
        assert two.notes[0].written == two.created
        db.delete(two)
        db.commit()
        assert patients.create(db, "P3").id == 3
        assert timedelta(0) == one.created - one.sessions[0].started
    _at(engine, "0004", command.downgrade)
    with engine.connect() as back:
        assert back.execute(text("select pseudonym, notes from patient order by id")).all() == [
            ("P1", ""),
            ("P3", ""),
        ]
