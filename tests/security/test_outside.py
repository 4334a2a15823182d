"""The attempts of a stranger in the network at full size, one after the other, against a server that listens (ASVS 5: 2.4, 4.3, 6.3, 7.2, 1.2.10)."""

import csv
import http.client
import io
import socket
import threading
import time
import urllib.error
import urllib.request
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from handscope.app.auth.gate import new_token
from handscope.estimators.data.samples import Event
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from tests.faults.victim import Victim, wait_for
from tests.security.conftest import answer_of
from tests.simulated import pose_and_wiggle

pytestmark = [pytest.mark.slow, pytest.mark.process]
MB = 2**20
GROWTH = 150 * MB  # of the server's memory that strangers may cause
SOON = 5.0  # s in which health answers meanwhile, on a busy machine
FORMULA = "P;=1+cmd"  # where semicolons part cells, too


def memory(victim: Victim) -> int:
    """Resident bytes."""
    return int(Path(f"/proc/{victim.pid}/statm").read_text().split()[1]) * 4096


def seconds_of_health(victim: Victim) -> float:
    began = time.monotonic()
    victim.call("GET", "/api/health")
    return time.monotonic() - began


def connection(victim: Victim) -> socket.socket:
    host, port = victim.base.removeprefix("http://").split(":")
    return socket.create_connection((host, int(port)), timeout=60)


def send_chunks(victim: Victim, megabytes: int, sent: list[int]) -> None:
    """A chunked post to the login, without a login, as far as the server lets it come."""
    head = (
        f"POST /api/login HTTP/1.1\r\nHost: {victim.base[7:]}\r\nTransfer-Encoding: chunked\r\n\r\n"
    )
    with connection(victim) as stranger, suppress(OSError):
        stranger.sendall(head.encode())
        for _ in range(megabytes):
            stranger.sendall(b"100000\r\n" + bytes(MB) + b"\r\n")
            sent.append(1)


def test_bodies_of_400_mb_without_a_login_are_cut_and_cost_no_memory(victim: Victim) -> None:
    before, sent = memory(victim), list[int]()
    senders = [threading.Thread(target=send_chunks, args=(victim, 400, sent)) for _ in range(2)]
    for sender in senders:
        sender.start()
    slowest = max(seconds_of_health(victim) for _ in range(5))
    for sender in senders:
        sender.join()
    assert len(sent) < 40, "megabytes of both until the server cut"
    assert memory(victim) - before < GROWTH
    assert slowest < SOON


def test_half_sent_requests_by_the_hundred_hold_nobody_up(victim: Victim) -> None:
    before, half = memory(victim), list[socket.socket]()
    head = f"POST /api/login HTTP/1.1\r\nHost: {victim.base[7:]}\r\nContent-Le".encode()
    for _ in range(300):
        with suppress(OSError):
            half.append(connection(victim))
            half[-1].sendall(head)
    assert seconds_of_health(victim) < SOON
    assert memory(victim) - before < GROWTH
    wait_for(lambda: all(map(_is_cut, half)), 30)
    for stranger in half:
        stranger.close()


def _is_cut(stranger: socket.socket) -> bool:
    stranger.setblocking(False)
    try:
        return stranger.recv(4096) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


@pytest.fixture(scope="module")
def result(victim: Victim) -> tuple[int, int]:
    """A processed recording of a patient whose code is a formula; numbers of patient and result."""
    made = pose_and_wiggle("left")
    typed = {"task_name": "rom_fist", "outcome": FORMULA, "reason": FORMULA, "comment": FORMULA}
    events = (*made.events, Event(4.0, 3.0, "task", typed))
    recording = LoadedRecording(made.hand, made.geometry, {}, made.samples, events)
    packed = writer.pack(writer.tree(recording, "01", "wiggle"))
    new = {"pseudonym": FORMULA, "confirmed": True, "note": FORMULA}
    patient = victim.call("POST", "/api/patients", new)["id"]
    result = victim.upload(patient, packed)["result"]
    wait_for(lambda: victim.call("GET", f"/api/results/{result}")["state"] in ("done", "failed"))
    assert victim.call("GET", f"/api/results/{result}")["state"] == "done"
    return patient, result


def test_no_table_that_is_taken_away_holds_a_formula(
    victim: Victim, result: tuple[int, int]
) -> None:
    patient, number = result
    parts = {
        "report": victim.call("GET", f"/api/results/{number}/report.csv"),
        "derivative": victim.call("GET", f"/api/results/{number}/derivative.zip"),
        "redcap": victim.call("GET", f"/api/results/{number}/exports/redcap"),
        "patient": victim.call("GET", f"/api/patients/{patient}/export.zip"),
    }
    tables = dict(t for name, data in parts.items() for t in _tables(name, data))
    assert any("1+cmd" in text for text in tables.values()), "the code is in one of them"
    found = [
        (name, cell)
        for name, text in tables.items()
        for mark in ",;\t"
        for row in csv.reader(io.StringIO(text), delimiter=mark)
        for cell in row
        if cell.strip().startswith(("=", "+", "@")) or (cell.startswith("-") and not _is_number(cell))
    ]  # fmt: skip
    assert found == []


def _tables(name: str, data: bytes) -> Iterator[tuple[str, str]]:
    if not zipfile.is_zipfile(io.BytesIO(data)):
        yield f"{name}.csv", data.decode()
        return
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for entry in archive.namelist():
            if entry.endswith((".csv", ".tsv")):
                yield f"{name}/{entry}", archive.read(entry).decode()


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def test_a_new_login_ends_the_one_that_the_browser_had(victim: Victim) -> None:
    first = _logged_in(victim, {})
    second = _logged_in(victim, {"Cookie": first})
    assert [_status_with(victim, cookie) for cookie in (first, second)] == [401, 200]


def _logged_in(victim: Victim, headers: dict[str, str]) -> str:
    request = victim._request("POST", "/api/login", {"token": new_token(victim.data)})
    request.headers = {k: v for k, v in request.headers.items() if k != "Cookie"} | headers
    with urllib.request.urlopen(request) as answer:
        return str(answer.headers["Set-Cookie"]).split(";")[0]


def _status_with(victim: Victim, cookie: str) -> int:
    asked = http.client.HTTPConnection(victim.base.removeprefix("http://"), timeout=30)
    asked.request("GET", "/api/patients", headers={"Cookie": cookie})
    status: int = asked.getresponse().status
    asked.close()
    return status


def test_wrong_codes_and_passwords_by_the_hundred_wait_and_fill_no_audit_trail(
    victim: Victim,
) -> None:
    lines = victim.call("GET", "/api/audit/verification")["lines"]
    tries: list[Any] = [{"token": "wrong"}, {"name": "nobody", "password": "wrong wrong wrong"}]
    answers = [answer_of(victim, "POST", "/api/login", tries[k % 2])[0] for k in range(120)]
    assert set(answers) <= {422, 429} and answers.count(429) > 60
    written = victim.call("GET", "/api/audit/verification")["lines"] - lines
    assert 1 <= written < 60, "a line for each try that was checked, few for those that waited"
    assert victim.call("GET", "/api/patients") is not None, "whoever is in stays in"
