"""What is kept on repeatability: hand-made numbers, kept true whatever stores or removes results, and an older database brought up to date."""

from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from sqlalchemy import create_engine, inspect, select, text
from sqlalchemy.orm import Session

from handscope.sessions.clinic.repeatability import ENOUGH, is_sufficient
from handscope.sessions.db.tables import (
    Base,
    Patient,
    PatientSession,
    RecordingFile,
    Repeatability,
    Result,
)
from handscope.sessions.store import database
from handscope.sessions.store.store import open_store

MAY = datetime(2026, 5, 12, 9, tzinfo=UTC)
PIP = ("range_of_motion", "rom_fist", "index_pip_flexion_max")


@pytest.fixture
def db(tmp_path: Path) -> Iterator[Session]:
    with open_store(tmp_path).database() as opened:
        yield opened


@pytest.fixture
def visit(db: Session) -> Callable[..., Result]:
    """Makes sessions of a patient, a day after the other, with one figure a trial."""
    count = 0

    def make(
        patient: Patient,
        day: float,
        *trials: float,
        hand: str = "left",
        device: str = "00a7",
        method: str = "m2",
        **more: Any,
    ) -> Result:
        nonlocal count
        count += 1
        session = PatientSession(
            patient=patient, hand=hand, started=MAY + timedelta(days=day), state="processed"
        )
        source = {"device": "Glove", "device_id": device} if device else {}
        file = RecordingFile(
            session=session,
            format="native",
            file=f"{count}",
            sha256=more.get("sha256", f"{count}"),
            summary={"source": source},
        )
        figure = {
            "measure": PIP[0],
            "task": PIP[1],
            "name": PIP[2],
            "unit": "rad",
            "grade": more.get("grade", "good"),
        }
        result = Result(
            recording=file,
            key="k",
            method=method,
            version="1",
            state="done",
            figures=[{**figure, "value": v} for v in trials],
        )
        db.add(result)
        db.commit()
        return result

    return make


def patient(db: Session, name: str) -> Patient:
    made = Patient(pseudonym=name)
    db.add(made)
    db.commit()
    return made


def kept(db: Session, of: Patient | None) -> list[Repeatability]:
    return list(
        db.scalars(select(Repeatability).where(Repeatability.patient_id == (of.id if of else None)))
    )


def test_five_sessions_in_a_week_give_the_patients_own(
    db: Session, visit: Callable[..., Result]
) -> None:
    one = patient(db, "one")
    results = [visit(one, day, value) for day, value in enumerate((50.0, 53.0, 47.0, 52.0, 48.0))]
    (row,) = kept(db, one)
    assert (row.measure, row.task, row.name, row.unit, row.hand, row.method) == (
        *PIP,
        "rad",
        "left",
        "m2",
    )
    assert row.sem == pytest.approx(np.sqrt(26 / 4))  # deviations from 50: 0, 3, -3, 2, -2
    assert row.mdc95 == pytest.approx(1.96 * np.sqrt(2) * np.sqrt(6.5))
    assert row.mdc95_high / row.mdc95 == pytest.approx(
        2.874, abs=0.001
    )  # sqrt(4 / 0.4844), a table of chi-squared with 4 degrees
    assert row.mdc95_low / row.mdc95 == pytest.approx(0.599, abs=0.001)  # sqrt(4 / 11.143)
    assert (row.sessions, row.people, row.freedom, row.icc) == (5, 1, ENOUGH, None)
    assert row.results == [r.id for r in results]
    assert row.computed.tzinfo is not None
    assert is_sufficient(row)
    (glove,) = kept(db, None)
    assert (glove.device, glove.people) == ("00a7", 1)
    assert not is_sufficient(glove)  # one person does not speak for a glove


def test_what_changes_between_weeks_is_no_error(db: Session, visit: Callable[..., Result]) -> None:
    one = patient(db, "one")
    for day, value in ((0, 50.0), (1, 52.0), (40, 70.0), (47, 74.0), (90, 99.0)):
        visit(one, day, value)
    (row,) = kept(db, one)
    assert row.sem == pytest.approx(np.sqrt((2 + 8) / 2))
    assert (row.sessions, row.freedom) == (4, 2)
    assert not is_sufficient(row)


def test_only_what_is_alike_counts_as_repeated(db: Session, visit: Callable[..., Result]) -> None:
    one = patient(db, "one")
    visit(one, 0, 50.0)
    visit(one, 1, 90.0, hand="right")
    visit(one, 1, 90.0, method="ekf")
    visit(one, 1, 90.0, grade="poor")
    visit(one, 2, 50.0, sha256="1")  # the first recording, uploaded again
    assert kept(db, one) == []
    visit(one, 3, 48.0, 54.0)  # of two trials the larger
    (row,) = kept(db, one)
    assert row.sem == pytest.approx(np.sqrt(8))


def test_a_glove_is_judged_over_the_people_who_wore_it(
    db: Session, visit: Callable[..., Result]
) -> None:
    values = ((9.0, 2.0), (6.0, 1.0), (8.0, 4.0))
    for k, (first, second) in enumerate(values):
        one = patient(db, f"p{k}")
        visit(one, 0, first)
        visit(one, 1, second)
        visit(one, 2, 100.0, device="")  # by a glove that does not tell its number
    (row,) = kept(db, None)
    assert (row.people, row.sessions, row.freedom) == (3, 6, 3)
    assert row.sem == pytest.approx(np.sqrt((24.5 + 12.5 + 8) / 3))
    bms, jms, ems = (
        2 * (5.5**2 + 3.5**2 + 6**2) / 2 - 75.0,
        3 * 2 * (8 / 3) ** 2,
        7 / 6,
    )  # by hand; the grand mean is 5
    assert jms == pytest.approx(42.667, abs=0.001)
    assert row.icc == pytest.approx((bms - ems) / (bms + ems + 2 * (jms - ems) / 3))


def test_removed_sessions_and_erased_patients_leave_nothing(
    db: Session, visit: Callable[..., Result]
) -> None:
    one, two = patient(db, "one"), patient(db, "two")
    for person in (one, two):
        for day in range(3):
            visit(person, day, 50.0 + day * person.id)
    db.delete(one.sessions[0])
    db.commit()
    assert [r.sessions for r in kept(db, one)] == [2]
    assert [r.sessions for r in kept(db, None)] == [5]
    one_results = {
        r.id for r in db.scalars(select(Result)) if r.recording.session.patient_id == one.id
    }
    db.expire_all()
    db.delete(one)
    db.commit()
    (glove,) = kept(db, None)
    assert (glove.people, glove.sessions) == (1, 3)
    assert not one_results & set(glove.results)
    assert {r.patient_id for r in db.scalars(select(Repeatability))} == {None, two.id}
    db.delete(two)
    db.commit()
    assert db.scalars(select(Repeatability)).all() == []


def test_a_transaction_that_fails_leaves_the_table_as_it_was(
    db: Session, visit: Callable[..., Result]
) -> None:
    one = patient(db, "one")
    visit(one, 0, 50.0)
    last = visit(one, 1, 52.0)
    db.delete(last.recording.session)
    db.flush()
    db.rollback()
    visit(one, 2, 51.0)
    assert [r.sessions for r in kept(db, one)] == [3]


def migrate(engine: Any, to: str, down: bool = False) -> None:
    config = Config()
    config.set_main_option("script_location", database.MIGRATIONS)
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        (command.downgrade if down else command.upgrade)(config, to)


def test_a_database_from_before_is_brought_up_to_date_and_back(tmp_path: Path) -> None:
    engine = create_engine(f"sqlite:///{tmp_path / database.FILE}")
    migrate(engine, "0002")
    figures = '[{"measure": "tapping", "task": "tapping", "name": "tapping_rate", "unit": "Hz", "value": %s, "grade": "good"}]'
    with engine.begin() as old:
        old.execute(
            text(
                "insert into patient values (1, 'P', null, null, null, :none, '', 0, '2026-05-12 09:00:00', 1)"
            ),
            {"none": "{}"},
        )
        for k, rate in ((1, 3.0), (2, 3.5)):
            values = {
                "id": k,
                "none": "{}",
                "day": f"2026-05-{11 + k} 09:00:00.000000",
                "figures": figures % rate,
            }
            old.execute(
                text(
                    "insert into session values (:id, 1, 'left', 'processed', :day, null, '', '', :none)"
                ),
                values,
            )
            old.execute(
                text(
                    "insert into recording values (:id, :id, 'native', 'f', '', :id, 0, :day, :none)"
                ),
                values,
            )
            old.execute(
                text(
                    "insert into result (id, recording_id, key, method, parameters, version, created, state, progress, error, figures, content, "
                    "warnings) values (:id, :id, 'k', 'm2', :none, '1', :day, 'done', 1, '', :figures, :none, '[]')"
                ),
                values,
            )
    store = open_store(tmp_path)
    with store.database() as db:
        (row,) = db.scalars(select(Repeatability))
        assert (row.name, row.patient_id, row.device, row.results) == (
            "tapping_rate",
            1,
            "",
            [1, 2],
        )
        assert row.sem == pytest.approx(0.5 / np.sqrt(2))
    with engine.connect() as now:
        differences = compare_metadata(MigrationContext.configure(now), Base.metadata)
        assert [d for d in differences if d[0] not in ("add_fk", "remove_fk")] == []
        for table in (
            Base.metadata.sorted_tables
        ):  # SQLAlchemy does not read ON DELETE of a column that was added
            keys = now.execute(text(f"pragma foreign_key_list({table.name})")).all()
            assert {(k[3], k[2], k[6]) for k in keys} == {
                (f.parent.name, f.column.table.name, f.ondelete or "NO ACTION")
                for f in table.foreign_keys
            }, table.name
    migrate(engine, "0002", down=True)
    assert "repeatability" not in inspect(engine).get_table_names()
    with engine.connect() as back:
        assert back.execute(text("select count(*) from result")).scalar() == 2
    migrate(engine, "head")
    assert "repeatability" in inspect(engine).get_table_names()


def test_a_name_that_gloves_share_is_no_glove(db: Session, visit: Callable[..., Result]) -> None:
    one = patient(db, "one")
    for day in range(2):
        file = visit(one, day, 50.0 + day, device="").recording
        file.summary = {"source": {"device": "imu"}}
        db.commit()
    visit(one, 2, 51.0, device="")
    assert kept(db, None) == []
