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

from handscope.app.auth.oidc import SignOn, SignOnError, authorization_address
from handscope.app.server import create_app
from handscope.app.settings import Settings

BASE = "http://127.0.0.1:8420"
SECRET, PROOF = "s+c%r:t", "us:s%2Bc%25r%3At"  # encoded as RFC 6749, 2.3.1 wants it
KEY, OTHER_KEY = (RSAKey.generate_key(2048, {"kid": "1"}) for _ in range(2))


class Provider(HTTPServer):
    """Gives the identity that it was told to for any code, where the code verifier fits the challenge."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Answers)
        self.issuer = f"http://127.0.0.1:{self.server_port}"
        self.claims: dict[str, Any] = {}
        self.information: dict[str, Any] = {}  # what is told apart from the token
        self.key, self.challenge = KEY, ""
        self.page = ""  # where the browser was sent at the end
        self.about: dict[str, Any] = {}  # what it tells of itself otherwise than usual


class Answers(BaseHTTPRequestHandler):
    server: Provider

    def do_GET(self) -> None:
        if self.path == "/keys":
            return self.told({"keys": [KEY.as_dict(private=False)]})
        if self.path == "/me":
            return self.told(
                self.server.information, 200 if self.headers["Authorization"] == "Bearer a" else 401
            )
        issuer = self.server.issuer
        places = {
            "authorization_endpoint": "/authorize",
            "token_endpoint": "/token",
            "jwks_uri": "/keys",
            "userinfo_endpoint": "/me",
            "end_session_endpoint": "/end",
        }
        return self.told(
            {
                "issuer": issuer,
                **{name: issuer + path for name, path in places.items()},
                **self.server.about,
            }
        )

    def do_POST(self) -> None:
        given = parse_qs(self.rfile.read(int(self.headers["Content-Length"])).decode())
        made = (
            base64.urlsafe_b64encode(hashlib.sha256(given["code_verifier"][0].encode()).digest())
            .rstrip(b"=")
            .decode()
        )
        if (
            made != self.server.challenge
            or self.headers["Authorization"] != f"Basic {base64.b64encode(PROOF.encode()).decode()}"
        ):
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
    agreed = SignOn(
        issuer=provider.issuer,
        client="us",
        secret=SECRET,
        claim="groups",
        roles={"therapists": "clinician", "lab": "scientist"},
    )
    folder: Path = tmp_path_factory.mktemp("data")
    with TestClient(
        create_app(Settings(data=folder, sign_on=agreed)), base_url=BASE, follow_redirects=False
    ) as client:
        yield client


def came_back(
    server: TestClient,
    provider: Provider,
    state: str = "",
    key: Any = KEY,
    answer: Any = None,
    **claims: Any,
) -> TestClient:
    """Through the provider and back with these claims; the client as it then is."""
    server.cookies.clear()
    sent = server.get("/login/sso").headers["location"]
    asked = {name: values[0] for name, values in parse_qs(urlsplit(sent).query).items()}
    assert sent.startswith(f"{provider.issuer}/authorize?")
    assert (asked["code_challenge_method"], asked["response_type"], asked["redirect_uri"]) == (
        "S256",
        "code",
        f"{BASE}/login/sso/answer",
    )
    usual = {
        "iss": provider.issuer,
        "aud": "us",
        "sub": "17",
        "exp": int(time.time()) + 300,
        "iat": int(time.time()),
    }
    told = {
        **usual,
        "nonce": asked["nonce"],
        "preferred_username": "Anna",
        "groups": ["therapists"],
        **claims,
    }
    provider.claims, provider.key, provider.challenge = (
        {k: v for k, v in told.items() if v is not None},
        key,
        asked["code_challenge"],
    )
    told = server.get(
        "/login/sso/answer",
        params={"state": state or asked["state"], "code": "c", **(answer or {})},
    )
    assert told.status_code in (200, 303)
    provider.page = told.headers.get("location", "")
    return server


def test_who_the_organisation_vouches_for_is_in_with_the_roles_of_today(
    server: TestClient, provider: Provider
) -> None:
    assert server.get("/api/login").json()["single"] is True
    first = came_back(server, provider).get("/api/me").json()
    assert (first["name"], first["roles"], first["proof"]) == ("anna", ["clinician"], "single")
    again = came_back(server, provider, groups=["lab", "others"]).get("/api/me").json()
    assert (again["id"], again["roles"]) == (first["id"], ["scientist"])
    namesake = came_back(server, provider, sub="18").get("/api/me").json()
    assert namesake["id"] != first["id"], (
        "an account is who the provider says, not what it is called"
    )
    assert (
        came_back(server, provider, sub="19", preferred_username="local")
        .get("/api/me")
        .json()["name"]
        != "local"
    )


@pytest.mark.parametrize(
    "wrong",
    [
        {"state": "another"},
        {"state": "\u00e4"},
        {"answer": {"error": "access_denied"}},
        {"answer": {"iss": "http://127.0.0.1:1"}},
        pytest.param({"key": OTHER_KEY}, id="another key"),
        {"aud": "others"},
        {"aud": ["us", "others"]},
        {"azp": "others"},
        {"iat": 2**33},
        {"iss": "http://127.0.0.1:1"},
        {"nonce": "another"},
        {"nonce": None},
        {"exp": 1},
        {"exp": None},
        {"sub": None},
        {"sub": "x" * 400},
        {"groups": ["others"]},
        {"groups": None},
        {"groups": 5},
    ],
    ids=str,
)
def test_whatever_does_not_fit_lets_nobody_in(
    server: TestClient, provider: Provider, wrong: dict[str, Any]
) -> None:
    assert came_back(server, provider, **wrong).get("/api/me").status_code == 401


def test_roles_that_are_not_in_the_token_are_asked_for(
    server: TestClient, provider: Provider
) -> None:
    provider.information = {"sub": "17", "groups": ["lab"]}
    assert came_back(server, provider, groups=None).get("/api/me").json()["roles"] == ["scientist"]
    assert came_back(server, provider, sub="20", groups=None).get("/api/me").status_code == 401, (
        "they are another's"
    )
    assert came_back(server, provider).get("/api/me").json()["roles"] == ["clinician"], (
        "the token's count first"
    )


@pytest.mark.parametrize(
    ("about", "reason"),
    [
        ({"issuer": "http://other.test"}, "calls itself 'http://other.test'"),
        ({"authorization_endpoint": None}, "authorization_endpoint"),
    ],
)
def test_a_provider_that_cannot_be_used_is_said_on_the_page_and_why_in_the_log(
    server: TestClient,
    provider: Provider,
    caplog: pytest.LogCaptureFixture,
    about: dict[str, Any],
    reason: str,
) -> None:
    provider.about = about
    answer, end = server.get("/login/sso"), server.get("/login/sso/end")
    provider.about = {}
    assert (answer.status_code, answer.headers["location"]) == (303, "/login?refused=away")
    assert "issuer" not in about or end.headers["location"] == "/login"
    assert reason in caplog.text


def test_a_provider_that_does_not_answer_is_away() -> None:
    with pytest.raises(
        SignOnError, match=r"http://127\.0\.0\.1:1/\.well-known/openid-configuration cannot be read"
    ) as caught:
        authorization_address(SignOn(issuer="http://127.0.0.1:1", client="us"), "word", BASE)
    assert caught.value.kind == "away"


def test_whoever_has_no_role_is_told_so_and_the_log_names_the_claim(
    server: TestClient, provider: Provider, caplog: pytest.LogCaptureFixture
) -> None:
    came_back(server, provider, groups=["kitchen"])
    assert provider.page == "/login?refused=role"
    assert "no role here for '17': the claim 'groups' holds 'kitchen'" in caplog.text


def test_logging_out_leads_to_the_providers_own_end(server: TestClient, provider: Provider) -> None:
    assert came_back(server, provider).delete("/api/login").json() == {"next": "/login/sso/end"}
    sent = server.get("/login/sso/end").headers["location"]
    assert sent.startswith(f"{provider.issuer}/end?client_id=us&")
    assert parse_qs(urlsplit(sent).query)["post_logout_redirect_uri"] == [f"{BASE}/login"]
