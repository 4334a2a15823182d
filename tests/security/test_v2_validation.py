"""ASVS 5, 2.2: text that comes in can be shown and stored, wherever it comes in."""

import json
import socket
from typing import Any

import pytest

from handscope.app.auth.incoming_text import Incoming
from handscope.app.auth.roles import iter_route_contexts
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.estimators.messages.sentence import codes_of, phrase, to_plain
from handscope.sessions.clinic import patients
from handscope.sessions.db.tables import Note, PatientSession, RecordingFile, Result
from handscope.sessions.store.store import open_store
from tests.faults.victim import Victim
from tests.security.conftest import status_of

SHOWN = "\N{REPLACEMENT CHARACTER}"
REFUSED = ("P\x00-1", "P\x1b[2J", "P\ud800")


@pytest.mark.parametrize("text", REFUSED)
def test_control_characters_are_refused_in_every_field(victim: Victim, text: str) -> None:
    assert status_of(victim, "POST", "/api/patients", {"pseudonym": text}) == 422
    note = {"pseudonym": f"P-{REFUSED.index(text)}", "note": text}
    assert status_of(victim, "POST", "/api/patients", note) == 422
    session = {"hand": "left", "port": "x", "options": {"a": [text]}}
    assert status_of(victim, "POST", "/api/patients/1/sessions", session) == 422


@pytest.mark.parametrize("text", ["P\u202e1-2", "P\u2066-1", "P-1\u200b"])
def test_a_code_that_only_looks_like_another_is_refused(victim: Victim, text: str) -> None:
    new = {"pseudonym": text, "confirmed": True}
    assert status_of(victim, "POST", "/api/patients", new) == 422


def test_addresses_with_control_characters_are_refused(victim: Victim) -> None:
    assert status_of(victim, "GET", "/api/patients?search=%00") == 400
    assert status_of(victim, "GET", "/api/patients/%00") == 400


@pytest.mark.parametrize("host", ["[::1", "[", "a]b", "", "\x80", "localhost:x", "[::1]:99999"])
def test_a_host_that_is_none_is_refused_with_words(victim: Victim, host: str) -> None:
    port = int(victim.base.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), timeout=10) as connection:
        request = f"GET /api/health HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
        connection.sendall(request.encode("latin-1"))
        assert connection.recv(65536).split()[1] in (b"421", b"400")


UPLOADS = [  # a file, and words of fixed form beside it
    "Body_compare_with_landmarks_api_results__result_id__landmark_comparisons_post",
    "Body_measure_photograph_api_patients__patient_id__photographs_post",
    "Body_propose_landmarks_api_patients__patient_id__photographs_landmarks_post",
    "Body_upload_recording_api_patients__patient_id__recordings_post",
    "Body_upload_table_api_patients__patient_id__tables_post",
]


def test_every_body_passes_the_same_check(tmp_path: Any) -> None:
    routes = [getattr(r, "body_field", None) for r in iter_route_contexts(create_app(Settings(data=tmp_path)).routes)]  # fmt: skip
    models = [f.field_info.annotation for f in routes if f is not None]
    forms = [m for m in models if not (isinstance(m, type) and issubclass(m, Incoming))]
    assert len(models) > 10
    assert sorted(getattr(m, "__name__", str(m)) for m in forms) == UPLOADS


def test_what_a_device_or_file_says_is_stored_without_control_characters(tmp_path: Any) -> None:
    store = open_store(tmp_path)
    with store.database() as db:
        patient = patients.create(db, "P-1")
        db.add(Note(patient_id=patient.id, text="a\x00b\nc"))
        db.commit()
        assert db.query(Note).one().text == "a\N{REPLACEMENT CHARACTER}b\nc"
    store.close()


def test_what_is_stored_without_control_characters_keeps_its_message_codes(tmp_path: Any) -> None:
    reason = phrase("motion_bids.zip_damaged", name="tap\x00\ud800\nping.zip")
    store = open_store(tmp_path)
    with store.database() as db:
        session = PatientSession(patient=patients.create(db, "P-1"), hand="left", state="recorded")
        file = RecordingFile(session=session, format="native", file="1.mcap")
        file.results.append(Result(key="k", method="ekf", version="1", warnings=[reason, "a\x00b"]))
        db.add(session)
        db.commit()
        kept, plain = file.results[0].warnings
        db.expunge_all()
        stored, again = db.query(Result).one().warnings
    store.close()
    assert kept == stored == reason.replace("\x00", SHOWN).replace("\ud800", SHOWN)
    assert plain == again == f"a{SHOWN}b"
    assert codes_of(kept) == codes_of(stored) == {"motion_bids.zip_damaged"}
    json.dumps(to_plain(kept), ensure_ascii=False).encode()  # as an answer holds it
