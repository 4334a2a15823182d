"""What a person waits for a page's data: a server with 1,000 patients and 10,000 sessions, each with a minute's results.

One patient has MANY of the sessions. Rows are copies of one recording that was simulated, kept and processed like any other.
"""

import statistics
import tempfile
import time
import urllib.request
from datetime import timedelta
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from sqlalchemy import Insert, String, cast, insert, join, select
from sqlalchemy.orm import Session, aliased

from handscope.app.results.make import make
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.magnetic_field import homogeneous
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions.clinic import patients, results
from handscope.sessions.db.tables import Note, Patient, PatientSession, RecordingFile, Result, now
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from handscope.sessions.store import records
from handscope.sessions.store.store import Store, open_store
from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.server_under_test import Client, server

PATIENTS, SESSIONS = 1000, 10_000
MANY = 60  # sessions of one patient: every fortnight for more than two years
MINUTE = ("initial_pose", "rom_fist", "rom_spread", "tapping", "rest")
TIMES = 7  # that each page is asked for
TARGET = 300.0  # ms


def measure() -> list[Metric]:
    """The slowest page by the median of its times, and the longest that any page ever took."""
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder)
        fill(open_store(data))
        with server(data) as (address, _):
            client = Client(address)
            took = {name: _times(client, paths) for name, paths in pages().items()}
    medians = {name: statistics.median(times) for name, times in took.items()}
    slowest = max(medians, key=lambda name: medians[name])
    each = [Metric(name, median, "ms", None, "lower") for name, median in medians.items()]
    longest = max(max(times) for times in took.values())
    return [
        *each,
        Metric(f"slowest page ({slowest})", medians[slowest], "ms", TARGET, "lower"),
        Metric("longest of all", longest, "ms", None, "lower"),
    ]


def _times(client: Client, paths: tuple[str, ...]) -> list[float]:
    """ms that all the answers of a page took together, TIMES over."""
    took = []
    for _ in range(TIMES):
        began = time.perf_counter()
        for path in paths:
            with urllib.request.urlopen(
                urllib.request.Request(client.base + path, headers={"Cookie": client.cookie})
            ) as answer:
                answer.read()
        took.append(1e3 * (time.perf_counter() - began))
    return took


def pages() -> dict[str, tuple[str, ...]]:
    """What each page asks the server for, one after the other; the busiest patient is 1, the session looked at that patient's last."""
    return {
        "patients": ("/", "/api/patients?limit=50", "/api/sessions/unfinished"),
        "patients, last part": (f"/api/patients?limit=50&offset={PATIENTS - 50}",),
        "patients, search": (f"/api/patients?limit=50&search={quote('P-07 1')}",),
        "patient": (
            "/patients/1",
            "/api/patients/1",
            "/api/patients/1/progress",
            "/api/gloves",
            "/api/protocols",
            "/api/methods",
        ),
        "session": ("/sessions/1", "/api/sessions/1", "/api/results/1", "/api/methods"),
        "session's curves": ("/api/results/1/curves?what=aperture&what=index_pip_flexion",),
    }


def fill(store: Store) -> None:
    """PATIENTS with SESSIONS; the first session is a simulated recording, kept and processed, all others are copies of its rows."""
    with store.database() as db:
        first = patients.create(db, "P-0001", affected_hand="left", note="seen every fortnight")
        result_id = _process(db, store, first)
    make(store, result_id)
    with store.database() as db:
        _copy(db)
        db.commit()


def _process(db: Session, store: Store, patient: Patient) -> int:
    made = simulate(
        MINUTE, "left", sized("left"), np.random.default_rng(1), SensorErrors(), field=homogeneous()
    )
    recording = LoadedRecording(
        made.hand,
        made.geometry,
        made.mounting,
        made.samples,
        made.events,
        source={"device": "simulated"},
    )
    place = store.incoming / "minute.zip"
    place.write_bytes(writer.pack(writer.tree(recording, "01", "minute")))
    session = records.add_upload(db, store, patient, place, "minute.zip", None)
    return results.find_matching(db, session.recordings[0], "m2", {}, "1").id


def _copy(db: Session) -> None:
    """Sessions a fortnight apart, patient after patient; recordings and results copied by the database itself."""
    begin = now() - timedelta(weeks=2 * MANY)
    db.execute(
        insert(Patient),
        [{"pseudonym": f"P-{k:04d}", "affected_hand": "right"} for k in range(2, PATIENTS + 1)],
    )
    db.execute(
        insert(Note), [{"patient_id": k, "text": f"note {k}"} for k in range(2, PATIENTS + 1)]
    )
    owners = [1] * (MANY - 1) + [2 + k % (PATIENTS - 1) for k in range(SESSIONS - MANY)]
    visits: dict[int, int] = {}
    rows = []
    for owner in owners:
        visits[owner] = visits.get(owner, 0) + 1
        rows.append(
            {
                "patient_id": owner,
                "hand": "left",
                "state": "processed",
                "started": begin + timedelta(weeks=2 * visits[owner]),
            }
        )
    db.execute(insert(PatientSession), rows)
    recording, result = db.get_one(RecordingFile, 1), db.get_one(Result, 1)
    db.execute(
        _copies(
            RecordingFile,
            {"session_id": PatientSession.id, "sha256": cast(PatientSession.id, String)},
            recording.id,
        )
    )
    db.execute(_copies(Result, {"recording_id": RecordingFile.id}, result.id))


def _copies(table: type[RecordingFile | Result], own: dict[str, Any], template: int) -> Insert:
    """Insert a copy of the template's row for every owner but the first, with columns of its own."""
    like = aliased(table)
    names = [c.name for c in table.__table__.columns if c.name != "id"]
    columns = [own[n] if n in own else getattr(like, n) for n in names]
    (owner,) = (column.class_ for column in list(own.values())[:1])
    return insert(table).from_select(
        names,
        select(*columns).select_from(join(owner, like, like.id == template)).where(owner.id > 1),
    )
