"""The network between the server and PostgreSQL is cut, and comes back: words meanwhile, no sample lost, no restart needed.

The database runs in a network of its own (Linux namespaces, as root); cut, its address swallows every packet, as a pulled cable does.
"""

import os
import shutil
import subprocess
import time
import urllib.error
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests import postgres
from tests.app.devices.virtual import virtual_glove
from tests.faults.test_faults import begun, told
from tests.faults.victim import Victim, wait_for

pytestmark = [pytest.mark.slow, pytest.mark.process]
CUT = float(os.environ.get("HANDSCOPE_CUT", "60"))  # s
SPACE, HERE, THERE = "handscope-db", "10.77.214.1", "10.77.214.2"
PATIENCE = 25.0  # s in which every request is answered


def _ip(*words: str) -> str:
    return subprocess.run(["ip", *words], check=True, capture_output=True, text=True).stdout


@contextmanager
def network() -> Iterator[None]:
    """A namespace that is reached at THERE; skips the test where none can be made."""
    if shutil.which("ip") is None or os.getuid() != 0:
        pytest.skip("networks of one's own need root and iproute2")
    try:
        _ip("netns", "add", SPACE)
    except subprocess.CalledProcessError:
        pytest.skip("this machine lets nobody make networks")
    try:
        _ip("link", "add", "handscope0", "type", "veth", "peer", "name", "handscope1", "netns", SPACE)  # fmt: skip
        _ip("addr", "add", f"{HERE}/24", "dev", "handscope0")
        _ip("link", "set", "handscope0", "up")
        for words in (("addr", "add", f"{THERE}/24", "dev", "handscope1"), ("link", "set", "handscope1", "up")):  # fmt: skip
            _ip("-n", SPACE, *words)
        mac = _ip("-n", SPACE, "link", "show", "handscope1").split("link/ether ")[1].split()[0]
        _ip("neigh", "replace", THERE, "lladdr", mac, "dev", "handscope0", "nud", "permanent")
        yield
    finally:
        _ip("netns", "del", SPACE)


@contextmanager
def cut() -> Iterator[None]:
    """Nothing gets through meanwhile."""
    _ip("-n", SPACE, "addr", "del", f"{THERE}/24", "dev", "handscope1")
    try:
        yield
    finally:
        _ip("-n", SPACE, "addr", "add", f"{THERE}/24", "dev", "handscope1")


def asked(server: Victim, method: str, path: str, body: Any = None) -> tuple[int, float]:
    """Status of the answer, and how long it took, s."""
    began = time.monotonic()
    try:
        server.call(method, path, body)
    except urllib.error.HTTPError as refusal:
        with refusal:
            return refusal.code, time.monotonic() - began
    return 200, time.monotonic() - began


def test_a_network_that_is_cut_for_a_minute_costs_no_sample(tmp_path: Path) -> None:
    with (
        network(),
        postgres.server(THERE, ("ip", "netns", "exec", SPACE)) as url,
        virtual_glove(tmp_path / "glove", "--strips", "index") as port,
    ):
        server = Victim(tmp_path / "data", "--database", url).start()
        try:
            station, session = begun(server, port)
            before = told(server, station)["glove"]["recorded"]
            answers = []
            with cut():
                until = time.monotonic() + CUT
                while time.monotonic() < until:
                    answers.append(asked(server, "GET", "/api/patients"))
                    answers.append(asked(server, "POST", "/api/patients", {"pseudonym": "P-CUT"}))
                    answers.append(asked(server, "GET", "/api/health"))
            assert {status for status, _ in answers} == {503}
            assert max(seconds for _, seconds in answers) < PATIENCE
            wait_for(lambda: asked(server, "GET", "/api/patients")[0] == 200, 30.0)
            glove = told(server, station)["glove"]
            assert glove["recorded"] > before + CUT - 2.0
            assert sum(s["lost"] for s in glove["strips"]) == 0
            server.call("DELETE", f"/api/stations/{station}")
            wait_for(
                lambda: (
                    server.call("GET", f"/api/sessions/{session}")["state"]
                    in ("recorded", "processed")
                )
            )
            assert server.call("GET", "/api/audit/verification")["broken"] == ""
        finally:
            server.stop()
