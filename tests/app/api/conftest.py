"""A server in this process and a client that is logged in."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from handscope.app.auth import request_limits
from handscope.app.auth.gate import new_token
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.sessions.clinic import accounts


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    return Settings(data=tmp_path_factory.mktemp("data"), largest_upload=8 * 2**20)


@pytest.fixture(scope="module")
def server(settings: Settings) -> Iterator[TestClient]:
    """A client without a login; the server's parts run while the module's tests do."""
    with TestClient(
        create_app(settings), base_url="http://127.0.0.1:8420", follow_redirects=False
    ) as client:
        yield client


@pytest.fixture
def client(
    server: TestClient, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> Iterator[TestClient]:
    """A logged-in client; no limit of requests in a row holds."""
    monkeypatch.setattr(request_limits, "REFILL", 1e6)  # tests ask faster than people
    answer = server.post("/api/login", json={"token": new_token(settings.data)})
    assert answer.status_code == 204
    yield server
    server.cookies.clear()


@pytest.fixture
def log_in_as(server: TestClient, settings: Settings) -> Iterator[Callable[..., TestClient]]:
    """Logs the client in to an account that has these roles alone."""

    def as_(*roles: str) -> TestClient:
        name = ".".join(roles)
        with server.app.state.parts.store.database() as db:  # type: ignore[attr-defined]
            if name not in [a.name for a in accounts.list_accounts(db)]:
                accounts.add(db, name, roles)
        server.cookies.clear()
        assert (
            server.post("/api/login", json={"token": new_token(settings.data, name)}).status_code
            == 204
        )
        return server

    yield as_
    server.cookies.clear()


@pytest.fixture
def patient(client: TestClient) -> int:
    """A new patient's id."""
    patient_with_name.count += 1
    return int(
        client.post("/api/patients", json={"pseudonym": f"P-{patient_with_name.count}"}).json()[
            "id"
        ]
    )


class patient_with_name:  # noqa: N801  a counter for pseudonyms
    count = 0


def files_in(settings: Settings) -> set[str]:
    """What lies in the folders of recordings."""
    return {
        p.name
        for folder in ("recordings", "incoming")
        for p in Path(settings.data, folder).iterdir()
    }
