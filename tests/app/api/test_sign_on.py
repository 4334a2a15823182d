"""Single sign-on against a small provider of the test's own: real HTTP, real signatures; whatever does not fit lets nobody in."""

import base64
import hashlib
import json
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
from joserfc import jwt
from joserfc.jwk import RSAKey
from starlette.testclient import TestClient

from app.server import create_app
from app.settings import Settings
from app.single_sign_on import SignOn

BASE = "http://127.0.0.1:8420"
KEY, OTHER_KEY = (RSAKey.generate_key(2048, {"kid": "1"}) for _ in range(2))


class Provider(HTTPServer):
    """Gives the identity that it was told to for any code, where the code verifier fits the challenge."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Answers)
        self.issuer = f"http://127.0.0.1:{self.server_port}"
        self.claims: dict[str, Any] = {}
        self.key, self.challenge = KEY, ""


class Answers(BaseHTTPRequestHandler):
    server: Provider

    def do_GET(self) -> None:
        issuer = self.server.issuer
        places = {"authorization_endpoint": "/authorize", "token_endpoint": "/token", "jwks_uri": "/keys"}
        about = {"issuer": issuer, **{name: issuer + path for name, path in places.items()}}
        self.told(about if self.path.startswith("/.well-known") else {"keys": [KEY.as_dict(private=False)]})

    def do_POST(self) -> None:
        given = parse_qs(self.rfile.read(int(self.headers["Content-Length"])).decode())
        made = base64.urlsafe_b64encode(hashlib.sha256(given["code_verifier"][0].encode()).digest()).rstrip(b"=").decode()
        if made != self.server.challenge:
            return self.told({"error": "invalid_grant"}, 400)
        token = jwt.encode({"alg": "RS256", "kid": "1"}, self.server.claims, self.server.key)
        return self.told({"access_token": "a", "token_type": "Bearer", "id_token": token})

    def told(self, what: dict[str, Any], status: int = 200) -> None:
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.end_headers()
        self.wfile.write(json.dumps(what).encode())

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def provider() -> Iterator[Provider]:
    with pytest.MonkeyPatch.context() as patch, Provider() as one:
        patch.setenv("AUTHLIB_INSECURE_TRANSPORT", "1")
        threading.Thread(target=one.serve_forever, daemon=True).start()
        yield one
        one.shutdown()


@pytest.fixture(scope="module")
def server(provider: Provider, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    agreed = SignOn(issuer=provider.issuer, client="us", secret="s", claim="groups", roles={"therapists": "clinician", "lab": "scientist"})
    folder: Path = tmp_path_factory.mktemp("data")
    with TestClient(create_app(Settings(data=folder, sign_on=agreed)), base_url=BASE, follow_redirects=False) as client:
        yield client


def came_back(server: TestClient, provider: Provider, state: str = "", key: Any = KEY, **claims: Any) -> TestClient:
    """Through the provider and back with these claims; the client as it then is."""
    server.cookies.clear()
    sent = server.get("/login/sso").headers["location"]
    asked = {name: values[0] for name, values in parse_qs(urlsplit(sent).query).items()}
    assert sent.startswith(f"{provider.issuer}/authorize?")
    assert (asked["code_challenge_method"], asked["response_type"], asked["redirect_uri"]) == ("S256", "code", f"{BASE}/login/sso/answer")
    usual = {"iss": provider.issuer, "aud": "us", "sub": "17", "exp": int(time.time()) + 300, "iat": int(time.time())}
    told = {**usual, "nonce": asked["nonce"], "preferred_username": "Anna", "groups": ["therapists"], **claims}
    provider.claims, provider.key, provider.challenge = {k: v for k, v in told.items() if v is not None}, key, asked["code_challenge"]
    server.get("/login/sso/answer", params={"state": state or asked["state"], "code": "c"})
    return server


def test_who_the_organisation_vouches_for_is_in_with_the_roles_of_today(server: TestClient, provider: Provider) -> None:
    assert server.get("/api/login").json()["single"] is True
    first = came_back(server, provider).get("/api/me").json()
    assert (first["name"], first["roles"], first["proof"]) == ("anna", ["clinician"], "single")
    again = came_back(server, provider, groups=["lab", "others"]).get("/api/me").json()
    assert (again["id"], again["roles"]) == (first["id"], ["scientist"])
    namesake = came_back(server, provider, sub="18").get("/api/me").json()
    assert namesake["id"] != first["id"], "an account is who the provider says, not what it is called"
    assert came_back(server, provider, sub="19", preferred_username="local").get("/api/me").json()["name"] != "local"


@pytest.mark.parametrize(
    "wrong",
    [
        {"state": "another"},
        {"key": OTHER_KEY},
        {"aud": "others"},
        {"iss": "http://127.0.0.1:1"},
        {"nonce": "another"},
        {"nonce": None},
        {"exp": 1},
        {"exp": None},
        {"sub": None},
        {"groups": ["others"]},
        {"groups": None},
    ],
    ids=lambda wrong: "-".join(f"{name}" for name in wrong),
)
def test_whatever_does_not_fit_lets_nobody_in(server: TestClient, provider: Provider, wrong: dict[str, Any]) -> None:
    assert came_back(server, provider, **wrong).get("/api/me").status_code == 401
