"""A disk that takes two seconds for each write and each sync: the recording loses nothing and keeps up, the server answers."""

import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from handscope.sessions.files import native
from tests.app.devices.virtual import virtual_glove
from tests.faults.test_cut_network import asked
from tests.faults.test_faults import begun, told
from tests.faults.victim import ProgramVictim, wait_for

pytestmark = [pytest.mark.slow, pytest.mark.process]
SLOW_FOR = 20.0  # s
LATE = 9.0  # s behind at most: two rounds of a write and a sync, and the look at it


def test_a_disk_that_takes_two_seconds_a_write_costs_no_sample(tmp_path: Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None or os.name != "posix":
        pytest.skip("no C compiler")
    shim, slow = tmp_path / "slow.so", tmp_path / "slow"
    source = Path(__file__).parent / "slow_disk.c"
    words = [compiler, "-shared", "-fPIC", "-o", shim, source, "-ldl"]
    subprocess.run(words, check=True)
    env = {"LD_PRELOAD": str(shim), "SLOW_DISK": str(slow), "SLOW_FOLDER": str(tmp_path / "data")}
    server = ProgramVictim(tmp_path / "data", env).start()
    try:
        with virtual_glove(tmp_path / "glove") as port:
            station, session = begun(server, port)
            began, before = time.monotonic(), told(server, station)["glove"]["recorded"]
            slow.touch()
            answers = []
            while time.monotonic() - began < SLOW_FOR:
                answers.append(asked(server, "GET", "/api/patients"))
                answers.append(asked(server, "POST", "/api/patients", {"pseudonym": f"P-{len(answers)}"}))  # fmt: skip
            shown = told(server, station)["glove"]
            passed = time.monotonic() - began
            slow.unlink()
            assert {status for status, _ in answers} <= {200, 503}
            assert max(seconds for _, seconds in answers) < 15.0
            assert shown["recorded"] - before > passed - LATE
            server.call("DELETE", f"/api/stations/{station}")
        state = lambda: server.call("GET", f"/api/sessions/{session}")["state"]  # noqa: E731
        wait_for(lambda: state() in ("recorded", "processed"))
        file = next((tmp_path / "data" / "recordings").iterdir())
        recording = native.load(file)
        assert recording.duration > SLOW_FOR and not sum(recording.losses.values())
    finally:
        server.stop()
