"""What a tablet on a slow network waits for before it shows the patients: bytes, counted as they go over the line."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from handscope.app.auth.gate import new_token
from handscope.app.server import create_app
from handscope.app.settings import Settings

BUDGET = 150_000  # bytes: 0.12 s of 10 Mbit/s
FONT = "/static/vendor/inter/inter-latin-wght-normal.woff2"
FIRST = ("/", "/static/pages/patients.js", "/languages/en.js", FONT)  # what no file names in full
LINKED = re.compile(r'(?:href|src)="(/[^"]+)"')
IMPORTED = re.compile(r'^(?:import|export)\b[^;]*?"([./][^"]+)"', re.MULTILINE)


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    data = tmp_path_factory.mktemp("data")
    with TestClient(create_app(Settings(data=data)), base_url="http://127.0.0.1:8420") as client:
        client.post("/api/login", json={"token": new_token(data)})
        yield client


def needed(client: TestClient) -> dict[str, int]:
    """Bytes on the line by address: of the document, what it names, and what that imports in turn."""
    sizes, waiting = dict[str, int](), list(FIRST)
    while waiting:
        address = waiting.pop()
        if address in sizes:
            continue
        answer = client.get(address, headers={"Accept-Encoding": "gzip"})
        assert answer.status_code == 200, address
        sizes[address] = int(answer.headers["content-length"])
        if address == "/":
            waiting += LINKED.findall(answer.text)
        elif address.startswith("/static") and address.endswith(".js"):
            waiting += [str(answer.url.join(name).path) for name in IMPORTED.findall(answer.text)]
    return sizes


def test_the_first_view_stays_within_its_bytes(client: TestClient) -> None:
    sizes = needed(client)
    assert {"/static/app.js", "/static/words/words.js", "/static/style.css"} <= sizes.keys()
    assert sum(sizes.values()) < BUDGET, sorted(sizes.items(), key=lambda item: -item[1])[:8]


def test_what_a_browser_has_is_not_sent_again(client: TestClient) -> None:
    for address in ("/static/app.js", "/languages/en.js", FONT):
        first = client.get(address)
        again = client.get(address, headers={"If-None-Match": first.headers["etag"]})
        assert first.headers["cache-control"] == "no-cache", "it asks each time"
        assert (again.status_code, again.content) == (304, b"")
    assert client.get("/").headers["cache-control"] == "no-store"
    assert client.get("/api/patients").headers["cache-control"] == "no-store"


def test_a_client_that_cannot_unpack_gets_the_text_itself(client: TestClient) -> None:
    plain = client.get("/static/app.js", headers={"Accept-Encoding": "identity"})
    packed = client.get("/static/app.js", headers={"Accept-Encoding": "gzip"})
    assert "content-encoding" not in plain.headers
    assert packed.headers["content-encoding"] == "gzip"
    assert plain.headers["vary"] == packed.headers["vary"] == "Accept-Encoding"
    text = Path(__file__).parents[3] / "static/app.js"
    assert plain.content == packed.content == text.read_bytes()
    assert packed.headers["content-type"].startswith("text/javascript")
