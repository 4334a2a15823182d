"""A real server that can be killed and started again in a fraction of a second: its process is forked from one that has imported everything."""

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from handscope.app.auth.gate import new_token
from handscope.app.workers.process import ignore_terminal_signals
from tests import fork_server
from tests.faults import disturbing

WAIT = 180.0  # s until a test gives up
FORKS = multiprocessing.get_context("forkserver")


class Victim:
    """A server on a data folder, and a browser that is logged in."""

    def __init__(self, data: Path, *words: str) -> None:
        self.data, self._words = data, words
        self.cookie = ""

    def start(self, wait: bool = True) -> "Victim":
        (self.data / "address").unlink(missing_ok=True)
        self._process = FORKS.Process(target=_serve, args=(self.data, self._words), daemon=False)
        self._process.start()
        if wait:
            self.answers()
        return self

    def answers(self) -> None:
        """Wait until it answers; the browser logs in."""
        self.base = wait_for(self._address)
        wait_for(self._healthy)
        request = self._request("POST", "/api/login", {"token": new_token(self.data)})
        with urllib.request.urlopen(request) as answer:
            self.cookie = str(answer.headers["Set-Cookie"]).split(";")[0]

    @property
    def pid(self) -> int:
        assert self._process.pid is not None
        return int(self._process.pid)

    @property
    def runs(self) -> bool:
        return self._process.is_alive()

    def kill(self) -> None:
        """SIGKILL: nothing of it runs any more when this returns."""
        os.kill(self.pid, signal.SIGKILL)
        self._process.join()

    def stop(self) -> None:
        """End it in good order."""
        self._process.terminate()
        self._process.join(15)
        if self._process.is_alive():
            self.kill()

    def call(self, method: str, path: str, body: Any = None) -> Any:
        """Parsed JSON of the answer, bytes where it is something else."""
        with urllib.request.urlopen(self._request(method, path, body), timeout=WAIT) as answer:
            data = answer.read()
            return (
                json.loads(data)
                if data and "json" in answer.headers.get("Content-Type", "")
                else data
            )

    def upload(self, patient: int, recording: bytes) -> Any:
        """A recording by way of the page's form."""
        head = b'--x\r\nContent-Disposition: form-data; name="file"; filename="r.zip"\r\nContent-Type: application/zip\r\n\r\n'
        request = self._request("POST", f"/api/patients/{patient}/recordings")
        request.data = head + recording + b"\r\n--x--\r\n"
        request.add_header("Content-Type", "multipart/form-data; boundary=x")
        with urllib.request.urlopen(request, timeout=WAIT) as answer:
            return json.loads(answer.read())

    def _request(self, method: str, path: str, body: Any = None) -> urllib.request.Request:
        data = None if body is None else json.dumps(body).encode()
        headers = {"Cookie": self.cookie} | (
            {"Content-Type": "application/json"} if body is not None else {}
        )
        return urllib.request.Request(self.base + path, data, headers, method=method)

    def _address(self) -> str:
        assert self.runs, (
            f"the server did not start: {(self.data.parent / 'log').read_text()[-2000:]}"
        )
        with suppress(OSError):
            return (self.data / "address").read_text().strip()
        return ""

    def _healthy(self) -> bool:
        try:
            return self.call("GET", "/api/health")["status"] == "ok"
        except (OSError, urllib.error.URLError):
            return False


class ProgramVictim(Victim):
    """The same as a program of its own, with an environment: what the fork cannot have, such as LD_PRELOAD."""

    def __init__(self, data: Path, environment: Mapping[str, str], *words: str) -> None:
        super().__init__(data, *words)
        self._environment = environment

    def start(self, wait: bool = True) -> "ProgramVictim":
        self.data.mkdir(parents=True, exist_ok=True)
        (self.data / "address").unlink(missing_ok=True)
        words = [sys.executable, "-m", "handscope.app.cli", "serve", "--port", "0", "--data"]
        with (self.data.parent / "log").open("ab") as log:
            self._program = subprocess.Popen(
                [*words, str(self.data), *self._words],
                stdout=log,
                stderr=log,
                env={**os.environ, **self._environment},
            )
        if wait:
            self.answers()
        return self

    @property
    def pid(self) -> int:
        return self._program.pid

    @property
    def runs(self) -> bool:
        return self._program.poll() is None

    def kill(self) -> None:
        self._program.kill()
        self._program.wait()

    def stop(self) -> None:
        self._program.terminate()
        try:
            self._program.wait(15)
        except subprocess.TimeoutExpired:
            self.kill()


def wait_for(condition: Callable[[], Any], seconds: float = WAIT) -> Any:
    """The condition's value as soon as it is true."""
    until = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < until, "what the test waits for did not happen"
        time.sleep(0.02)
    return value


def _serve(data: Path, words: tuple[str, ...]) -> None:
    from handscope.app.cli import main

    ignore_terminal_signals()
    fork_server.share()
    disturbing.install(data.parent)
    log = os.open(data.parent / "log", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(log, 1)
    os.dup2(log, 2)
    raise SystemExit(main(["serve", "--port", "0", "--data", str(data), *words]))
