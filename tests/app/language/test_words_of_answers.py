"""A session from beginning to end, its answers asked in English and in German: no sentence of ours is English in both, and each has its code in files."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import select
from starlette.testclient import TestClient

from handscope.app.auth.gate import new_token
from handscope.app.example_patients import patients, sessions
from handscope.app.example_patients.stories import STORIES
from handscope.app.report import tables
from handscope.app.results.report import report
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.sessions.db.tables import Result
from handscope.sessions.store.store import open_store

SENTENCE = re.compile(r"[a-z]{2,}[ ,;:]+[a-z]{2,}[ ,;:]+[a-z]{2,}")  # three words in a row
STORY = next(s for s in STORIES if "zone II" in s.code)
SHORT = replace(STORY, course=((1.0, 1.0),), both=(), tasks=("rom_fist", "tapping", "open_close"))
THEIRS = {  # what people wrote, files for programs, and names of formats
    ("/api/patients/1", "notes.text"),
    ("/api/patients/1/progress", "treatment_events.comment"),
    ("/api/notes/1", "text"),
    ("/api/assessment-plans/stroke/file.json", "sources"),
    ("/api/assessment-plans/stroke/file.json", "note"),
    ("/api/results/1/report.json", "*"),  # English with codes: below
    ("/api/results/1/exports/json", "values.names"),
}
WHICH = {"plan": "stroke", "code": "de", "form": "json"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder with one patient's session and its result."""
    made = tmp_path_factory.mktemp("data")
    store = open_store(made)
    with pytest.MonkeyPatch.context() as patch:
        for module in (patients, sessions):
            patch.setattr(module, "STORIES", (SHORT,))
        patients.add_patients(store)
        sessions.add_sessions(store)
    store.close()
    return made


@pytest.fixture(scope="module")
def client(folder: Path) -> Iterator[TestClient]:
    app = create_app(Settings(data=folder))
    with TestClient(app, base_url="http://127.0.0.1:8420", follow_redirects=False) as client:
        assert client.post("/api/login", json={"token": new_token(folder)}).status_code == 204
        yield client


def texts(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, str]]:
    """Every text of plain data, with the keys that lead to it."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from texts(inner, (*path, key))
    elif isinstance(value, list):
        for inner in value:
            yield from texts(inner, path)
    elif isinstance(value, str):
        yield ".".join(path), value


def asked(client: TestClient, address: str, language: str) -> Any:
    """The answer as plain data; None where it is no JSON, or there is no such thing."""
    answer = client.get(address, headers={"Accept-Language": language})
    is_json = answer.headers.get("content-type", "").startswith("application/json")
    return answer.json() if is_json else None


def addresses(client: TestClient) -> list[str]:
    """Every address that can be asked, of the first of everything."""
    described = client.app.openapi()["paths"]  # type: ignore[attr-defined]
    return [
        re.sub(r"\{(\w+)\}", lambda name: WHICH.get(name[1], "1"), path)
        for path, does in described.items()
        if "get" in does and not path.endswith((".zip", ".pdf", ".html", ".jpg", ".js"))
    ]


def test_no_sentence_of_an_answer_is_english_in_german(client: TestClient) -> None:
    found = set()
    for address in addresses(client):
        english = {text for _, text in texts(asked(client, address, "en"))}
        for path, text in texts(asked(client, address, "de")):
            is_theirs = (address, path) in THEIRS or (address, "*") in THEIRS
            if text in english and SENTENCE.search(text) and not is_theirs:
                found.add((address, path, text))
    assert not found, "\n".join(map(" | ".join, sorted(found)))


def test_a_figure_has_the_codes_of_its_definition_and_its_source(client: TestClient) -> None:
    figures = asked(client, "/api/results/1", "de")["readings"]["figures"]
    (first,) = [f for f in figures if f["name"] == "tapping_first_rate"]
    assert first["meaning"] == "Frequenz der ersten zehn Tippbewegungen"
    assert first["meaning_codes"] == ["cycle_word.taps", "figure_meaning.cycle_first_rate"]
    assert first["source_codes"] == ["figure_source.first_ten"]
    (rate,) = [f for f in figures if f["name"] == "tapping_rate"]
    assert rate["source"] == "ReTap (Habets 2023, doi 10.3390/s23115238)"


def test_every_sentence_of_a_reports_files_has_its_code(folder: Path) -> None:
    store = open_store(folder)
    with store.database() as db:
        made = report(store, db.scalars(select(Result)).one())
    store.close()
    found: dict[str, Any] = json.loads(tables.json(made))
    assert without_codes({k: v for k, v in found.items() if k != "notice"}) == []


def without_codes(value: Any) -> list[str]:
    """Sentences that have no codes beside them."""
    if isinstance(value, list):
        return [text for inner in value for text in without_codes(inner)]
    if not isinstance(value, dict):
        return []
    bare = []
    for key, inner in value.items():
        words = inner if isinstance(inner, list) else [inner]
        said = [w for w in words if isinstance(w, str) and SENTENCE.search(w)]
        bare += said if said and not value.get(f"{key}_codes") else without_codes(inner)
    return bare
