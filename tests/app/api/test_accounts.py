"""Accounts over the API: how one comes in, what one may change, and that all of it stands in the audit trail."""

from collections.abc import Callable, Iterator

import pytest
from argon2 import PasswordHasher
from starlette.testclient import TestClient
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from handscope.app.auth.gate import COOKIE, new_token
from handscope.app.settings import Settings
from handscope.sessions.clinic import accounts, audit
from handscope.sessions.db.roles import ADMINISTRATOR, CLINICIAN
from handscope.sessions.db.tables import Attempt, AuditLine

GOOD = "seven hands on a table"


@pytest.fixture(scope="module", autouse=True)
def _cheap() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            accounts, "_hasher", PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
        )
        accounts._unknown_hash.cache_clear()
        yield
    accounts._unknown_hash.cache_clear()


def told(client: TestClient, first: int = 0) -> list[str]:
    """The audit trail after a line, each as "who what kind ref"."""
    with client.app.state.parts.store.database() as db:  # type: ignore[attr-defined]
        assert audit.verify(db).broken == ""
        found = db.query(AuditLine).filter(AuditLine.id > first).order_by(AuditLine.id)
        return [
            " ".join(word for word in (line.who, line.what, line.kind, line.ref) if word)
            for line in found
        ]


def newest(client: TestClient) -> int:
    with client.app.state.parts.store.database() as db:  # type: ignore[attr-defined]
        return audit.verify(db).lines


def test_who_is_given_an_account_sets_a_password_and_logs_in_with_it(
    log_in_as: Callable[..., TestClient],
) -> None:
    client = log_in_as(ADMINISTRATOR)
    first = newest(client)
    made = client.post("/api/accounts", json={"name": "Anna", "roles": [CLINICIAN]}).json()
    assert (made["name"], made["proof"]) == ("anna", "none")
    client.cookies.clear()
    assert client.get("/api/login").json()["passwords"] is False
    assert client.post("/api/login", json={"token": made["code"]}).status_code == 204
    assert client.get("/api/me").json()["roles"] == [CLINICIAN]
    assert client.put("/api/me/password", json={"password": "short"}).status_code == 422
    assert client.put("/api/me/password", json={"password": GOOD}).status_code == 204
    assert client.put("/api/me/password", json={"password": GOOD + "!"}).status_code == 422, (
        "the one until now is asked for"
    )
    client.delete("/api/login")
    assert client.get("/api/login").json()["passwords"] is True
    wrong = client.post("/api/login", json={"name": "anna", "password": "wrong"})
    assert (wrong.status_code, "name or the password" in wrong.json()["error"]) == (422, True)
    assert client.post("/api/login", json={"name": "anna", "password": GOOD}).status_code == 204
    assert client.get("/api/patients").status_code == 200
    number = str(made["id"])
    lines = told(client, first)
    assert lines[0].startswith(f"{ADMINISTRATOR} created account {number}")
    assert [line for line in lines if "anna" in line] == [
        f"anna logged in account {number}",
        f"anna changed account {number}",
        f"anna refused login {number}",
        f"anna logged out account {number}",
        f"anna logged in account {number}",
        "anna viewed patients",
    ]
    assert f"refused login {number}" in lines


def test_too_many_tries_are_turned_away_and_say_for_how_long(server: TestClient) -> None:
    answers = [
        server.post("/api/login", json={"name": "carla", "password": f"guess {k}"})
        for k in range(7)
    ]
    assert [a.status_code for a in answers] == 5 * [422] + 2 * [429]
    assert 0 < int(answers[-1].headers["retry-after"]) <= 60
    german = server.post(
        "/api/login", json={"name": "carla", "password": "x"}, headers={"Accept-Language": "de"}
    )
    assert "Sekunden" in german.json()["error"]
    with server.app.state.parts.store.database() as db:  # type: ignore[attr-defined]
        db.query(Attempt).delete()
        db.commit()


def test_an_account_out_of_use_is_out_at_once_and_nobody_locks_himself_out(
    log_in_as: Callable[..., TestClient], settings: Settings
) -> None:
    client = log_in_as(CLINICIAN)
    gone = client.cookies[COOKIE]
    number = client.get("/api/me").json()["id"]
    client = log_in_as(ADMINISTRATOR)
    me = client.get("/api/me").json()["id"]
    out = client.patch(f"/api/accounts/{number}", json={"version": 1, "disabled": True}).json()
    assert (out["disabled"], out["version"]) == (True, 2)
    for change in ({"disabled": True}, {"roles": [CLINICIAN]}, {"roles": []}, {"roles": ["king"]}):
        given = client.patch(f"/api/accounts/{me}", json={"version": 1, **change})
        assert given.status_code == 422
    assert client.post(f"/api/accounts/{number}/code").status_code == 422
    client.cookies.clear()
    client.cookies.set(COOKIE, gone)
    assert client.get("/api/patients").status_code == 401
    client.cookies.clear()
    assert (
        client.post("/api/login", json={"token": new_token(settings.data, CLINICIAN)}).status_code
        == 422
    )
    client = log_in_as(ADMINISTRATOR)
    back = {"version": 2, "disabled": False}
    assert not client.patch(f"/api/accounts/{number}", json=back).json()["disabled"]


def test_looks_are_told_once_in_a_while_exports_each_time_and_whose_they_were(
    client: TestClient, patient: int
) -> None:
    first = newest(client)
    for _ in range(3):
        assert client.get(f"/api/patients/{patient}").status_code == 200
        assert client.get(f"/api/patients/{patient}/export.zip").status_code == 200
    client.get("/api/patients/999")
    assert (
        client.post(f"/api/patients/{patient}/erasure", json={"pseudonym": "another"}).status_code
        == 422
    )
    mine = [line for line in told(client, first) if line.startswith("local")]
    assert mine == [f"local viewed patient {patient}", *3 * [f"local exported patient {patient}"]]


def test_a_refusal_is_told(log_in_as: Callable[..., TestClient]) -> None:
    client = log_in_as(ADMINISTRATOR)
    first = newest(client)
    for _ in range(3):
        assert client.get("/api/patients/1").status_code == 403
    assert [line for line in told(client, first) if "refused" in line] == [
        f"{ADMINISTRATOR} refused request /api/patients/1"
    ]


def test_administrators_read_the_trail_page_by_page_and_verify_it(
    log_in_as: Callable[..., TestClient],
) -> None:
    client = log_in_as(ADMINISTRATOR)
    answer = client.get("/api/audit?limit=5")
    lines = answer.json()
    assert int(answer.headers["X-Total-Count"]) == lines[0]["id"]
    refused = client.get("/api/audit?what=refused")
    assert int(refused.headers["X-Total-Count"]) == len(refused.json())
    assert [line["id"] for line in lines] == list(range(lines[0]["id"], lines[0]["id"] - 5, -1))
    assert (
        client.get(f"/api/audit?limit=1&before={lines[-1]['id']}").json()[0]["id"]
        == lines[-1]["id"] - 1
    )
    assert {line["what"] for line in client.get("/api/audit?what=refused").json()} == {"refused"}
    assert client.get("/api/audit/verification").json()["broken"] == ""


def test_a_trusted_proxy_tells_where_from_and_that_the_browser_speaks_tls(
    client: TestClient, settings: Settings
) -> None:
    told_by_proxy = {"X-Forwarded-Proto": "https", "X-Forwarded-For": "10.1.2.3"}
    trusting = TestClient(
        ProxyHeadersMiddleware(client.app, trusted_hosts=["testclient"]),
        base_url="http://127.0.0.1:8420",
    )
    answer = trusting.post(
        "/api/login", json={"token": new_token(settings.data)}, headers=told_by_proxy
    )
    cookie = answer.headers["set-cookie"]
    assert cookie.startswith(f"__Host-{COOKIE}=")
    assert all(word in cookie for word in ("Secure", "HttpOnly", "SameSite=strict", "Path=/"))
    assert "max-age" in answer.headers["strict-transport-security"]
    with client.app.state.parts.store.database() as db:  # type: ignore[attr-defined]
        assert audit.list_lines(db, limit=1)[0].address == "10.1.2.3"
    plain = TestClient(client.app, base_url="http://127.0.0.1:8420")
    answer = plain.post(
        "/api/login", json={"token": new_token(settings.data)}, headers=told_by_proxy
    )
    assert "Secure" not in answer.headers["set-cookie"]
    assert "strict-transport-security" not in answer.headers
