"""An upload that its sender stops on its way."""

import logging

import pytest
from starlette.testclient import TestClient

from handscope.app.settings import Settings
from tests.app.api.conftest import files_in
from tests.app.closed_connection import status_of

FIRST = (
    b"--limit\r\n"
    b'Content-Disposition: form-data; name="file"; filename="hand.zip"\r\n\r\n' + bytes(3 * 2**20)
)


def test_a_stopped_upload_leaves_no_file_no_session_and_no_error(
    client: TestClient, patient: int, settings: Settings, caplog: pytest.LogCaptureFixture
) -> None:
    before = files_in(settings)
    headers = [
        (b"content-type", b"multipart/form-data; boundary=limit"),
        (b"content-length", str(2 * len(FIRST)).encode()),
        (b"origin", b"http://127.0.0.1:8420"),
    ]
    path = f"/api/patients/{patient}/recordings"
    with caplog.at_level(logging.ERROR):
        status_of(client, "POST", path, headers=headers, body=FIRST)
    assert files_in(settings) == before
    assert client.get(f"/api/patients/{patient}").json()["sessions"] == []
    assert caplog.records == []
