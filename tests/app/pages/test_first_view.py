"""What a tablet on a slow network waits for before it shows the patients: bytes, counted as they go over the line."""

import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from handscope.app.api import pages
from handscope.app.auth.gate import new_token
from handscope.app.live.replay import Replay
from handscope.app.page_files import versions
from handscope.app.page_files.files import STATIC
from handscope.app.server import create_app
from handscope.app.settings import Settings

BUDGET = 150_000  # bytes: 0.12 s of 10 Mbit/s
FONT = "/static/vendor/inter/inter-latin-wght-normal.woff2"  # what the document does not name
LINKED = re.compile(r'(?:href|src)="(/[^"]+)"')
VERSION = re.compile(r"^/v/[0-9a-f]{16}")
IMPORTED = re.compile(r'(?:\bfrom|^import) "([./][^"]+)";', re.MULTILINE)


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    data = tmp_path_factory.mktemp("data")
    with TestClient(create_app(Settings(data=data)), base_url="http://127.0.0.1:8420") as client:
        client.post("/api/login", json={"token": new_token(data)})
        yield client


def linked(client: TestClient, address: str) -> list[str]:
    """What the document at an address names, with its version."""
    return list(dict.fromkeys(LINKED.findall(client.get(address).text)))


def imported(client: TestClient, address: str) -> set[str]:
    """A module and all that it imports in turn, as a browser resolves it."""
    found, waiting = set[str](), [address]
    while waiting:
        address = waiting.pop()
        if address not in found:
            found.add(address)
            answer = client.get(address)
            assert answer.status_code == 200, address
            waiting += [str(answer.url.join(name).path) for name in IMPORTED.findall(answer.text)]
    return found


def test_the_first_view_stays_within_its_bytes(client: TestClient) -> None:
    addresses = ["/", FONT, *linked(client, "/")]
    answers = {a: client.get(a, headers={"Accept-Encoding": "gzip"}) for a in addresses}
    sizes = {a: int(answer.headers["content-length"]) for a, answer in answers.items()}
    assert {VERSION.sub("", a) for a in sizes} >= {"/static/index.css", "/languages/en.js"}
    assert sum(sizes.values()) < BUDGET, sorted(sizes.items(), key=lambda item: -item[1])[:8]


@pytest.mark.parametrize("address", pages.PAGES)
def test_a_document_names_all_modules_that_its_page_imports_and_none_besides(
    client: TestClient, address: str
) -> None:
    names = linked(client, re.sub(r"\{[^}]*\}", "1", address))
    version = str(VERSION.match(names[0])[0])  # type: ignore[index]
    page = f"{version}/static/pages/{pages.PAGES[address]}.js"
    started = {f"{version}/static/first_view.js", f"{version}/static/app.js", page}
    modules = {name for start in started for name in imported(client, start)}
    assert {n for n in names if n.endswith(".js")} == {*modules, f"{version}/languages/en.js"}


def test_the_list_of_patients_loads_later_what_it_does_not_show_at_once(client: TestClient) -> None:
    names = {Path(name).name for name in linked(client, "/")}
    later = {"new_patient.js", "emergency.js", "erasures.js"}
    assert not names & {*later, "fact_fields.js"}
    script = (STATIC / "pages/patients.js").read_text("utf-8")
    assert set(re.findall(r'import\("\.\./patient/([^"]+)"\)', script)) == later


@pytest.mark.parametrize(("kind", "station"), [("live", None), ("replay", Replay.__new__(Replay))])
def test_the_document_of_a_station_names_what_its_kind_needs(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, kind: str, station: Replay | None
) -> None:
    monkeypatch.setattr(pages, "station_of", lambda *_: station)
    names = linked(client, "/stations/1")
    version = str(VERSION.match(names[0])[0])  # type: ignore[index]
    assert imported(client, f"{version}/static/station/{kind}.js") <= set(names)
    other = {"live": "replay", "replay": "live"}[kind]
    assert f"{version}/static/station/{other}.js" not in names
    script = (STATIC / "pages/station.js").read_text("utf-8")
    assert script.count("import(") == 2 and f'import("../station/{kind}.js")' in script


def test_the_server_and_the_script_agree_on_which_page_stands_at_an_address() -> None:
    script = (STATIC / "app.js").read_text("utf-8")
    table = re.findall(r"\[/\^(.*)\$/, \(\) => import\(\"\./pages/(\w+)\.js\"\)\]", script)
    patterns = [(pattern.replace("\\/", "/"), name) for pattern, name in table]
    for address, page in pages.PAGES.items():
        example = address.replace("{id}", "1").replace("{table}", "visits")
        assert [n for pattern, n in patterns if re.fullmatch(pattern, example)] == [page]
    assert len(patterns) == len(pages.PAGES)


def test_the_words_of_the_browsers_language_are_named(client: TestClient) -> None:
    german = client.get("/", headers={"Accept-Language": "de-CH, en;q=0.5"}).text
    assert "/languages/de.js" in german and "/languages/en.js" not in german


def test_what_a_browser_has_is_not_sent_again(client: TestClient) -> None:
    for address in ("/static/app.js", "/languages/en.js", FONT):
        first = client.get(address)
        again = client.get(address, headers={"If-None-Match": first.headers["etag"]})
        assert first.headers["cache-control"] == "no-cache", "it asks each time"
        assert (again.status_code, again.content) == (304, b"")
    assert client.get("/").headers["cache-control"] == "no-store"
    assert client.get("/api/patients").headers["cache-control"] == "no-store"


def test_a_file_of_the_newest_version_is_kept_and_one_of_another_is_asked_for_again(
    client: TestClient,
) -> None:
    addresses = [*linked(client, "/"), str(VERSION.match(linked(client, "/")[0])[0]) + FONT]  # type: ignore[index]
    for address in addresses:
        kept = client.get(address)
        assert kept.headers["cache-control"] == "private, max-age=31536000, immutable", address
        other = client.get(f"/v/{'0' * 16}{VERSION.sub('', address)}")
        assert other.headers["cache-control"] == "no-cache"
        assert kept.content == other.content == client.get(VERSION.sub("", address)).content
    version = addresses[0].split("/static")[0]
    assert client.get(f"{version}/static/nothing.js").headers["cache-control"] == "no-store"


def test_a_version_opens_no_other_address(client: TestClient) -> None:
    version = str(VERSION.match(linked(client, "/")[0])[0])  # type: ignore[index]
    for path in ("/api/patients", "/static/../api/patients", "/static", "/login"):
        assert client.get(version + path).status_code == 404, path
    stranger = TestClient(client.app, base_url=client.base_url)
    for path, status in (("/static/app.js", 401), ("/static/style.css", 200)):
        assert stranger.get(version + path).status_code == status, path


def test_a_changed_file_has_another_address(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    file = tmp_path / "a.js"
    monkeypatch.setattr(versions, "ROOTS", (tmp_path,))
    found = []
    for second, text in enumerate(("one", "two", "one")):
        file.write_text(text)
        os.utime(file, (second, second))
        found.append(versions._version(-1 - second))
    versions._version.cache_clear()
    assert found[0] != found[1] and found[0] == found[2]


def test_styles_come_in_one_file(client: TestClient) -> None:
    sheet = client.get("/static/index.css").text
    assert "@import" not in sheet
    for name in ("colors.css", "styles/table.css"):
        assert (STATIC / name).read_text("utf-8") in sheet
    deeper = [p for p in STATIC.glob("styles/*.css") if "url(" in p.read_text("utf-8")]
    assert deeper == [], "an address there would be looked for beside the file that imports it"


def test_the_scenes_page_is_sent_once_and_its_policy_stays_that_of_its_scripts(
    client: TestClient,
) -> None:
    first = client.get("/scene/")
    kept = {"If-None-Match": first.headers["etag"]}
    again = client.get("/scene/", headers=kept)
    assert first.headers["cache-control"] == again.headers["cache-control"] == "private, no-cache"
    assert (again.status_code, again.content) == (304, b"")
    policies = [answer.headers["content-security-policy"] for answer in (first, again)]
    nonces = re.findall(r'<script nonce="([^"]+)"', first.text)
    assert policies[0] == policies[1] and f"'nonce-{nonces[0]}'" in policies[0]
    stranger = TestClient(client.app, base_url=client.base_url)
    assert stranger.get("/scene/", headers=kept).status_code == 401


def test_a_client_that_cannot_unpack_gets_the_text_itself(client: TestClient) -> None:
    plain = client.get("/static/app.js", headers={"Accept-Encoding": "identity"})
    packed = client.get("/static/app.js", headers={"Accept-Encoding": "gzip"})
    assert "content-encoding" not in plain.headers
    assert packed.headers["content-encoding"] == "gzip"
    assert plain.headers["vary"] == packed.headers["vary"] == "Accept-Encoding"
    text = STATIC / "app.js"
    assert plain.content == packed.content == text.read_bytes()
    assert packed.headers["content-type"].startswith("text/javascript")
