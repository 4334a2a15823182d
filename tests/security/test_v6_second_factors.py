"""ASVS 5, 6.5 to 6.7: second factors: an authenticator's code, recovery codes, roles that require one. Passkeys: tests/journeys/accounts/test_second_factor.py."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from argon2 import PasswordHasher
from starlette.testclient import TestClient

from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.sessions.clinic import accounts, second_factors
from handscope.sessions.db.tables import Attempt, AuditLine, SecondFactor, now
from handscope.sessions.login import logins

pyotp = pytest.importorskip("pyotp")
pytest.importorskip("segno")
GOOD = "seven hands on a table"
PROOF = {"name": "anna", "password": GOOD}


class Clock:
    """The time as authenticators and server see it."""

    def __init__(self) -> None:
        self.moment = now()

    def __call__(self) -> datetime:
        return self.moment

    def code(self, secret: str) -> str:
        return str(pyotp.TOTP(secret).at(self.moment))


@pytest.fixture(scope="module", autouse=True)
def _cheap() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        cheap = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
        patch.setattr(accounts, "_hasher", cheap)
        accounts._unknown_hash.cache_clear()
        yield
    accounts._unknown_hash.cache_clear()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    settings = Settings(data=tmp_path_factory.mktemp("data"), second_factor=("administrator",))
    app = create_app(settings)
    with TestClient(app, base_url="http://127.0.0.1:8420", follow_redirects=False) as client:
        yield client


@pytest.fixture
def client(server: TestClient, monkeypatch: pytest.MonkeyPatch) -> Iterator[TestClient]:
    """Anna, a clinician, is logged in; she has a password and no second factor."""
    with database(server) as db:
        anna = next((a for a in accounts.list_accounts(db) if a.name == "anna"), None)
        anna = anna or accounts.add(db, "anna", ["clinician"])
        accounts.change(db, anna, roles=["clinician"])
        accounts.set_password(db, anna, GOOD)
        second_factors.remove_all(db, anna)
        db.query(Attempt).delete()
        db.commit()
    assert server.post("/api/login", json=PROOF).status_code == 204
    yield server
    server.cookies.clear()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(second_factors, "now", clock)
    return clock


def database(client: TestClient) -> Any:
    return client.app.state.parts.store.database()  # type: ignore[attr-defined]


def with_authenticator(client: TestClient, clock: Clock) -> tuple[str, list[str]]:
    """The secret of a new authenticator in use, and the recovery codes."""
    place = "/api/me/second-factors/totp"
    begun = client.post(place, json={"password": GOOD, "name": "phone"})
    assert begun.status_code == 201 and begun.json()["picture"].startswith("data:image/svg+xml")
    secret = begun.json()["secret"]
    assert client.post("/api/login", json=PROOF).status_code == 204, "not confirmed yet"
    wrong = client.post(f"{place}/confirmation", json={"code": "000000"})
    assert wrong.status_code == 422
    done = client.post(f"{place}/confirmation", json={"code": clock.code(secret)})
    clock.moment += timedelta(seconds=60)
    return secret, done.json()["recovery_codes"]


def first_step(client: TestClient) -> str:
    """The ticket of a login whose password was right: it lets nobody in."""
    client.cookies.clear()
    answer = client.post("/api/login", json=PROOF)
    assert answer.status_code == 202 and not client.cookies
    assert client.get("/api/me").status_code == 401
    return str(answer.json()["ticket"])


def second_step(client: TestClient, ticket: str, code: str) -> int:
    body = {"ticket": ticket, "code": code}
    return int(client.post("/api/login/second", json=body).status_code)


def test_a_code_of_the_app_lets_in_once_and_the_password_alone_does_not(
    client: TestClient, clock: Clock
) -> None:
    secret, _ = with_authenticator(client, clock)
    ticket = first_step(client)
    code = clock.code(secret)
    assert second_step(client, ticket, "123456") == 422
    assert second_step(client, ticket, code) == 204
    assert client.get("/api/me").json()["name"] == "anna"
    assert second_step(client, ticket, code) == 422, "the ticket was used"
    assert second_step(client, first_step(client), code) == 422, "the code was used"
    clock.moment += timedelta(seconds=30)
    assert second_step(client, first_step(client), clock.code(secret)) == 204


def test_recovery_codes_let_in_once_each_and_are_kept_as_hashes(
    client: TestClient, clock: Clock
) -> None:
    _, codes = with_authenticator(client, clock)
    assert len(set(codes)) == 10
    assert second_step(client, first_step(client), codes[0].upper()) == 204
    assert client.get("/api/me/second-factors").json()["recovery_codes"] == 9
    assert second_step(client, first_step(client), codes[0]) == 422
    assert second_step(client, first_step(client), codes[1]) == 204
    renewed = client.post("/api/me/recovery-codes", json={"password": GOOD}).json()
    assert second_step(client, first_step(client), codes[2]) == 422
    assert second_step(client, first_step(client), renewed["recovery_codes"][0]) == 204
    with database(client) as db:
        stored = [f.secret for f in db.query(SecondFactor).filter_by(kind="recovery")]
    assert not set(stored) & {*codes, *renewed["recovery_codes"]}
    bits = {5 * len(code.replace("-", "")) for code in codes}  # a base32 character has five
    assert min(bits) >= 112, "with less, ASVS 6.5.2 wants a password's hash"


def test_guessed_codes_have_to_wait(client: TestClient, clock: Clock) -> None:
    secret, _ = with_authenticator(client, clock)
    ticket = first_step(client)
    answers = [second_step(client, ticket, f"{k:06d}") for k in range(logins.MOST + 2)]
    assert answers[-1] == 429
    assert second_step(client, ticket, clock.code(secret)) == 429, "the right one, too"
    with database(client) as db:
        lines = db.query(AuditLine).filter_by(what="refused", who="anna").all()
        assert any(line.counts.get("by") == "second factor" for line in lines)


def test_the_password_is_asked_for_before_anything_changes(
    client: TestClient, clock: Clock
) -> None:
    with_authenticator(client, clock)
    [factor] = client.get("/api/me/second-factors").json()["factors"]
    place = f"/api/me/second-factors/{factor['id']}/removal"
    assert client.post(place, json={"password": "wrong"}).status_code == 422
    assert client.post(place, json={"password": GOOD}).status_code == 204
    left = client.get("/api/me/second-factors").json()
    assert (left["factors"], left["recovery_codes"]) == ([], 0)


def test_a_one_time_code_is_no_way_around_the_second_factor(
    client: TestClient, clock: Clock
) -> None:
    secret, _ = with_authenticator(client, clock)
    client.cookies.clear()
    folder = client.app.state.parts.store.folder  # type: ignore[attr-defined]
    token = logins.new_token(folder, "anna")
    answer = client.get(f"/login?token={token}")
    address, _, ticket = answer.headers["location"].partition("#second=")
    assert address == "/login" and not client.cookies
    assert second_step(client, ticket, clock.code(secret)) == 204


def test_a_role_that_requires_one_opens_nothing_else_until_it_is_made(
    client: TestClient, clock: Clock
) -> None:
    with database(client) as db:
        accounts.change(db, accounts.find_by_name(db, "anna"), roles=["administrator"])
    assert client.get("/api/accounts").status_code == 403
    page = client.get("/audit", headers={"Accept": "text/html"})
    assert (page.status_code, page.headers["location"]) == (303, "/account")
    assert client.get("/api/me").json()["lacks_second_factor"] is True
    assert client.get("/api/me/second-factors").json()["required"] is True
    with_authenticator(client, clock)
    assert client.get("/api/accounts").status_code == 200
    assert client.get("/api/me").json()["lacks_second_factor"] is False


def test_an_administrator_takes_lost_ones_out_of_use(client: TestClient, clock: Clock) -> None:
    with_authenticator(client, clock)
    with database(client) as db:
        anna = accounts.find_by_name(db, "anna").id
    folder = client.app.state.parts.store.folder  # type: ignore[attr-defined]
    client.cookies.clear()
    token = logins.new_token(folder)
    assert client.post("/api/login", json={"token": token}).status_code == 204
    assert client.delete(f"/api/accounts/{anna}/second-factors").status_code == 204
    client.cookies.clear()
    assert client.post("/api/login", json=PROOF).status_code == 204


def test_changes_stand_in_the_audit_trail_without_a_secret(
    client: TestClient, clock: Clock, tmp_path: Path
) -> None:
    secret, codes = with_authenticator(client, clock)
    with database(client) as db:
        lines = db.query(AuditLine).filter_by(kind="second_factor").all()
        assert {line.what for line in lines} >= {"created", "changed"}
        text = " ".join(str((line.ref, line.counts)) for line in lines)
    assert secret not in text and codes[0] not in text
