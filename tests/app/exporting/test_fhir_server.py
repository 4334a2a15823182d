"""Sending to a FHIR server: Medplum's, and a stub that refuses what it would not."""

import base64
import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

import pytest
import requests

from handscope.app.cli import main
from handscope.app.exporting import fhir_server
from handscope.app.exporting.fhir_server import Credentials, credentials, require_server, send
from handscope.estimators.errors import InputError
from handscope.sessions.motion_bids import writer
from tests.simulated import loaded, pose_and_wiggle

KNOWN = Credentials("glove", "very secret")
PACKAGES = Path(sys.prefix) / "node" / "node_modules"
BUNDLE: dict[str, Any] = {
    "resourceType": "Bundle",
    "type": "transaction",
    "entry": [
        {"resource": {"resourceType": "Device"}, "request": {"method": "POST", "url": "Device"}}
    ],
}


@dataclass
class Stub:
    """No FHIR server: it stores what comes with a token that it gave, and refuses a Bundle without entries."""

    url: str = ""
    stored: list[dict[str, Any]] = field(default_factory=list)
    asked: list[dict[str, list[str]]] = field(default_factory=list)


@pytest.fixture
def stub() -> Iterator[Stub]:
    made = Stub()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.answer(200, {"token_endpoint": f"{made.url}/token"})

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            if self.path.endswith("/token"):
                made.asked.append(parse_qs(body.decode()))
                given = base64.b64decode(self.headers["Authorization"].split()[1]).decode()
                right = given == f"{KNOWN.client}:{KNOWN.secret}"
                token = {"access_token": "t0ken", "token_type": "bearer", "expires_in": 300}
                self.answer(200 if right else 401, token if right else {"error": "invalid_client"})
            elif self.headers.get("Authorization") != "Bearer t0ken":
                self.answer(401, outcome("who are you?"))
            elif self.headers.get("If-None-Exist"):
                made.stored.append(json.loads(body))
                self.answer(201, {})
            elif not json.loads(body).get("entry"):
                self.answer(422, outcome("a Bundle has entries"))
            else:
                made.stored.append(json.loads(body))
                entries = [
                    {"response": {"status": "201 Created"}} for _ in made.stored[-1]["entry"]
                ]
                answer = {
                    "resourceType": "Bundle",
                    "type": "transaction-response",
                    "entry": entries,
                }
                self.answer(200, answer)

        def answer(self, status: int, value: dict[str, Any]) -> None:
            data = json.dumps(value).encode()
            self.send_response(status)
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *_: object) -> None: ...

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        made.url = f"http://127.0.0.1:{server.server_port}/fhir"
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        yield made
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def medplum() -> Iterator[str]:
    """The address of a FHIR server out of Medplum's parts, which validates against HL7's R4 profiles."""
    if not (PACKAGES / "@medplum" / "fhir-router").is_dir():
        pytest.skip("npm is not there, or cannot reach its packages")
    script = Path(__file__).with_name("medplum.mjs")
    words = ["node", str(script), str(PACKAGES)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        yield server.stdout.readline().strip()
        server.terminate()


def stored(server: str, kind: str) -> list[dict[str, Any]]:
    """What the server holds of a kind."""
    found = requests.get(
        f"{server}/{kind}?_count=1000", headers={"Authorization": "Bearer t0ken"}, timeout=10
    ).json()
    return [entry["resource"] for entry in found.get("entry", [])]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("fhir") / "r.zip"
    place.write_bytes(writer.pack(writer.tree(loaded(pose_and_wiggle("left")), "01", "wiggle")))
    return place


@pytest.fixture
def secret(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Our name at the server, and a file with the secret."""
    place = tmp_path / "secret"
    place.write_text(f"{KNOWN.secret}\n")
    monkeypatch.setenv(fhir_server.CLIENT, KNOWN.client)
    monkeypatch.setenv(fhir_server.SECRET_FILE, str(place))


@pytest.mark.process
def test_a_fhir_server_stores_every_resource_and_the_codes_once(
    medplum: str, recording: Path, secret: None, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["export", str(recording), "--format", "fhir", "--method", "m2", "--send", medplum]
    assert main(words) == 0 and main(words) == 0
    (codes,) = stored(medplum, "CodeSystem")
    known = {concept["code"] for concept in codes["concept"]}
    figures, reports = stored(medplum, "Observation"), stored(medplum, "DiagnosticReport")
    assert {c["code"] for f in figures for c in f["code"]["coding"]} <= known
    assert len(reports) == 2
    named = {result["reference"] for report in reports for result in report["result"]}
    assert named == {f"Observation/{figure['id']}" for figure in figures}
    answered = capsys.readouterr().out
    assert f"{len(figures) // 2 + 4} resources stored by {medplum}" in answered


@pytest.mark.process
def test_a_fhir_server_refuses_a_figure_without_its_status(medplum: str) -> None:
    resource = {"resourceType": "Observation", "code": {"text": "flexion"}}
    entry = {"resource": resource, "request": {"method": "POST", "url": "Observation"}}
    bundle = json.dumps(BUNDLE | {"entry": [entry]}).encode()
    with pytest.raises(InputError, match="Missing required property"):
        send(bundle, medplum, KNOWN)


def outcome(words: str) -> dict[str, Any]:
    issue = {"severity": "error", "code": "invalid", "diagnostics": words}
    return {"resourceType": "OperationOutcome", "issue": [issue]}


def test_a_recording_goes_to_the_server_with_client_credentials(
    stub: Stub, recording: Path, secret: None, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["export", str(recording), "--format", "fhir", "--method", "m2", "--send", stub.url]
    assert main(words) == 0
    codes, bundle = stub.stored
    assert codes["resourceType"] == "CodeSystem"
    assert f"{1 + len(bundle['entry'])} resources stored by {stub.url}" in capsys.readouterr().out
    assert bundle["type"] == "transaction"
    assert stub.asked[0]["grant_type"] == ["client_credentials"]
    assert stub.asked[0]["scope"] == ["system/*.write"]


@pytest.mark.parametrize(
    ("known", "bundle", "words"),
    [
        (Credentials("glove", "guess"), BUNDLE, "gave no token"),
        (Credentials(), BUNDLE, "401 who are you"),
        (KNOWN, BUNDLE | {"entry": []}, "422 a Bundle has entries"),
    ],
)
def test_what_the_server_refuses_is_said_and_nothing_is_stored(
    stub: Stub, known: Credentials, bundle: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words) as refusal:
        send(json.dumps(bundle).encode(), stub.url, known)
    assert stub.stored == []
    assert not known.secret or known.secret not in str(refusal.value)


def test_a_server_that_does_not_answer_is_named() -> None:
    with pytest.raises(InputError, match="does not answer"):
        send(json.dumps(BUNDLE).encode(), "http://127.0.0.1:9/fhir", Credentials())


@pytest.mark.parametrize("url", ["http://hospital.example/fhir", "ftp://host", "fhir", "https://"])
def test_no_other_address_than_an_encrypted_one_is_written_to(url: str) -> None:
    with pytest.raises(InputError, match=r"not encrypted|no address"):
        require_server(url)


def test_a_client_without_a_secret_is_refused_before_anything_is_sent(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="without a secret"):
        credentials({fhir_server.CLIENT: "glove"})
    with pytest.raises(InputError, match="cannot be read"):
        credentials({fhir_server.CLIENT: "glove", fhir_server.SECRET_FILE: str(tmp_path / "no")})
    assert credentials({}) == Credentials()


def test_other_formats_are_not_sent(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["export", "r.zip", "--format", "c3d", "--send", "https://host/fhir"]
    assert main(words) == 2 and "--send is for --format fhir" in capsys.readouterr().err
