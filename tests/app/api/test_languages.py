"""A further language is one file: its words reach the pages, the reports and what the server refuses; a file with a fault takes nothing from the others."""

import json
import shutil
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from starlette.testclient import TestClient

from handscope.app import language as every
from handscope.app.report.words import figure_words
from handscope.estimators.messages import GAP, Message, english_texts
from tests.app.pages.test_metronome_in_browser import SITE, serve

ESPERANTO = {
    "name": "Esperanto",
    "locale": "eo",
    "pages": {"save": "Konservi"},
    "words": {"finger.thumb": "Dikfingro"},
    "messages": {"clinic.patient_unknown": "ne estas paciento {number}"},
}
POLISH = {
    "name": "Polski",
    "locale": "pl_PL",
    "pages": {
        "sessions.one": "{count} sesja",
        "sessions.few": "{count} sesje",
        "sessions.many": "{count} sesji",
        "sessions.other": "{count} sesji",
    },
    "words": {
        "trust.figures.one": "1 liczba",
        "trust.figures.few": "{count} liczby",
        "trust.figures.many": "{count} liczb",
        "trust.figures.other": "{count} liczby",
    },
}  # a language of four forms, of which only counts are translated
PUT_IN = {
    "pl.json": json.dumps(POLISH),
    "eo.json": json.dumps(ESPERANTO),
    "fr.json": '{"name": "Français", "locale": "fr_FR", "pages": {',
    "es.json": json.dumps({**ESPERANTO, "locale": "es_NOWHERE_AT_ALL"}),
    "it.json": json.dumps({**ESPERANTO, "words": ["dito"]}),
    "nl.json": json.dumps(ESPERANTO).replace('"save"', '"save": "Opslaan", "save"'),
    "esperanto.json": json.dumps(ESPERANTO),
    "ro.json": "[]",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The languages that there are with more files among them."""
    here = shutil.copytree(str(files("handscope.app.language")), tmp_path / "language")
    for name, text in PUT_IN.items():
        (here / name).write_text(text, "utf-8")
    monkeypatch.setattr(every, "files", lambda _: here)
    every._here.cache_clear()
    yield here
    every._here.cache_clear()


def module(client: TestClient, name: str) -> dict[str, str]:
    answer = client.get(f"/languages/{name}.js")
    assert answer.headers["content-type"].startswith("text/javascript")
    told: dict[str, str] = json.loads(
        answer.text.removeprefix("export default ").removesuffix(";\n")
    )
    return told


def test_one_file_is_one_more_language_for_pages_reports_and_refusals(
    folder: Path, client: TestClient
) -> None:
    assert module(client, "names") == {
        "en": "English",
        "de": "Deutsch",
        "eo": "Esperanto",
        "pl": "Polski",
    }
    pages = module(client, "eo")
    assert (pages["locale"], pages["save"], pages["cancel"]) == ("eo", "Konservi", "Cancel")
    assert every.language("eo").words["finger.thumb"] == "Dikfingro"
    assert figure_words("rate", every.language("eo")) == figure_words("rate", every.ENGLISH)
    refused = client.get("/api/patients/4711", headers={"Accept-Language": "eo"})
    assert refused.json()["error"] == "ne estas paciento 4711"


def test_counts_have_the_plural_forms_of_the_locale(folder: Path) -> None:
    polish = every.language("pl")
    said = [polish.counted("trust.figures", count) for count in (1, 2, 5, 22, 112)]
    assert said == ["1 liczba", "2 liczby", "5 liczb", "22 liczby", "112 liczb"]
    counted = next(c for c, text in english_texts().items() if not isinstance(text, str))
    gaps = {name: 3.0 for name, *_ in GAP.findall(str(english_texts()[counted]))}
    message = Message(counted, {**gaps, "count": 3.0})
    assert polish.render(message) == every.ENGLISH.render(message)  # English has no "few"


@pytest.mark.browser
def test_pages_count_by_the_plural_forms_of_the_locale(folder: Path, browser: Browser) -> None:
    page = browser.new_context(locale="pl-PL").new_page()
    page.route(f"{SITE}/**", serve)
    page.goto(SITE)
    counted = """async (counts) => {
      const { counted } = await import("/static/words/words.js");
      return counts.map((count) => counted("sessions", count));
    }"""
    assert page.evaluate(counted, [0, 1, 3, 5]) == ["0 sesji", "1 sesja", "3 sesje", "5 sesji"]
    page.context.close()


def test_a_file_with_a_fault_is_named_and_takes_nothing_from_the_others(folder: Path) -> None:
    said = sorted(every.faults())
    assert [one.split(".json")[0] for one in said] == [
        f"the language {code}" for code in ("es", "esperanto", "fr", "it", "nl", "ro")
    ]
    for one, fault in zip(
        said,
        (
            "not a valid locale",
            "no code of a language",
            "column",
            '"words" holds words',
            "save stands twice",
            "begins with",
        ),
    ):
        assert fault in one


def test_the_files_that_are_delivered_have_no_fault() -> None:
    assert every.faults() == []
    assert {code: one.name for code, one in every.languages().items()} == {
        "en": "English",
        "de": "Deutsch",
        "fr": "Français",
    }


def test_what_is_malformed_and_what_there_is_not_is_refused_in_the_persons_language(
    client: TestClient,
) -> None:
    german = {"Accept-Language": "de"}
    answers = [
        client.get("/api/patients/one", headers=german),
        client.post("/api/patients", json={}, headers=german),
        client.get("/api/nothing", headers=german),
        client.delete("/api/patients", headers=german),
    ]
    assert [a.status_code for a in answers] == [422, 422, 404, 405]
    assert [a.json()["error"].split(";")[0] for a in answers] == [
        "Die Eingabe wurde nicht verstanden (patient_id: keine ganze Zahl)",
        "Die Eingabe wurde nicht verstanden (pseudonym: fehlt)",
        "Unter dieser Adresse gibt es nichts",
        "Das geht unter dieser Adresse nicht",
    ]


def test_an_error_comes_in_the_language_that_the_address_asks_for(client: TestClient) -> None:
    by_header = client.get("/api/patients/4711", headers={"Accept-Language": "de"}).json()
    english = client.get("/api/patients/4711").json()
    assert by_header != english
    assert client.get("/api/patients/4711?language=de").json() == by_header
