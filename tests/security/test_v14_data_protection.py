"""ASVS 5, 14.2 and 13.4: what lies in the data folder is its owner's alone, and one server's at a time."""

import http.client
import stat
from pathlib import Path

import pytest

from handscope.app.cli import main
from handscope.sessions.store.folder_privacy import mend_permissions
from tests.faults.victim import Victim, wait_for
from tests.security.conftest import log_of


def _readable_by_others(folder: Path) -> list[str]:
    places = [folder, *folder.rglob("*")]
    return [str(p) for p in places if stat.S_IMODE(p.lstat().st_mode) & 0o077 and not p.is_symlink()]  # fmt: skip


def test_nothing_in_the_data_folder_is_readable_by_others(victim: Victim) -> None:
    victim.call("POST", "/api/patients", {"pseudonym": "P-14", "confirmed": True})
    assert _readable_by_others(victim.data) == []
    assert "could be read by others" in log_of(victim)


def test_a_folder_that_is_private_is_left_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.touch(mode=0o644)
    file.chmod(0o644)
    tmp_path.chmod(0o700)
    assert mend_permissions(tmp_path) == 1
    assert mend_permissions(tmp_path) == 0


def test_uploads_wait_in_the_data_folder(victim: Victim) -> None:
    maps = Path(f"/proc/{victim.pid}/fd")
    patient = victim.call("POST", "/api/patients", {"pseudonym": "P-15"})["id"]
    host = victim.base.removeprefix("http://")
    connection = http.client.HTTPConnection(host, timeout=10)
    connection.putrequest("POST", f"/api/patients/{patient}/recordings")
    connection.putheader("Cookie", victim.cookie)
    connection.putheader("Content-Type", "multipart/form-data; boundary=x")
    connection.putheader("Content-Length", str(3 << 20))
    connection.endheaders()
    head = b'--x\r\nContent-Disposition: form-data; name="file"; filename="r.zip"\r\n\r\n'
    connection.send(head + bytes(2 << 20))

    def spooled() -> list[str]:
        links = [str(p.readlink()) for p in maps.iterdir() if p.is_symlink()]
        return [link for link in links if "(deleted)" in link and "sqlite" not in link]

    places = wait_for(spooled, 10)
    connection.close()
    assert [p for p in places if not p.startswith(str(victim.data.resolve()))] == []


def test_a_second_server_on_the_same_folder_is_refused_by_name(
    victim: Victim, capsys: pytest.CaptureFixture[str]
) -> None:
    address = (victim.data / "address").read_text()
    incoming = victim.data / "incoming" / "half-an-upload"
    incoming.touch()
    assert main(["serve", "--port", "0", "--data", str(victim.data)]) == 2
    assert f"process {victim.pid} on " in capsys.readouterr().err
    assert (victim.data / "address").read_text() == address and incoming.exists()
