"""The demonstration where a system has no pseudo-terminals and no file locks, as Windows: led through by the API alone."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import requests

from handscope.app.cli import main
from tests.app.commands.test_demo import WAIT, words

VERBS = ("glove", "record", "doctor", "simulate", "process", "assess", "info", "serve", "export")
HIDDEN = """
import builtins, importlib, os
absent = {"fcntl", "pty", "pwd", "resource", "termios", "tty"}
real, by_name = builtins.__import__, importlib.import_module
def hiding(name, globals=None, *rest, **more):
    if name in absent and (globals or {}).get("__name__", "").startswith("handscope"):
        raise ImportError(f"{name} is hidden")
    return real(name, globals, *rest, **more)
def hiding_by_name(name, package=None):
    if name in absent:
        raise ImportError(f"{name} is hidden")
    return by_name(name, package)
builtins.__import__, importlib.import_module = hiding, hiding_by_name
del os.openpty
"""  # in every Python that the demonstration starts


@pytest.fixture
def demo(tmp_path: Path) -> Iterator[tuple[requests.Session, str]]:
    """A browser's session, logged in, and the server's address."""
    hide = tmp_path / "hide"
    hide.mkdir()
    (hide / "sitecustomize.py").write_text(HIDDEN)
    program = [sys.executable, "-P", "-m", "handscope.app.cli", *words(tmp_path / "data")]
    environment = {**os.environ, "PYTHONPATH": str(hide)}
    here = tmp_path / "here"  # a folder with files of names that the program's modules have
    here.mkdir()
    for name in ("estimators", "app", "sessions", "numpy", "json", "serialx"):
        (here / f"{name}.py").write_text("raise SystemExit('imported from the working folder')\n")
    with (
        subprocess.Popen(
            program, stdout=subprocess.PIPE, text=True, env=environment, cwd=here
        ) as process,
        requests.Session() as session,
    ):
        assert process.stdout is not None
        address = next(line for line in process.stdout if "/login?token=" in line).split()[-1]
        base = address.split("/login")[0]
        token = address.split("token=")[1]
        session.headers["Origin"] = base
        session.post(f"{base}/api/login", json={"token": token}).raise_for_status()
        yield session, base
        process.send_signal(signal.SIGINT)
        assert process.wait(WAIT) == 130


def eventually(condition: Callable[[], Any]) -> Any:
    until = time.monotonic() + WAIT
    while not (value := condition()):
        assert time.monotonic() < until, "what the test waits for did not happen"
        time.sleep(0.1)
    return value


@pytest.mark.slow
def test_a_session_is_recorded_and_assessed_without_pseudo_terminals(
    demo: tuple[requests.Session, str], tmp_path: Path
) -> None:
    session, base = demo

    def ask(method: str, path: str, body: object = None) -> Any:
        answer = session.request(method, base + path, json=body)
        assert answer.ok, answer.text
        return answer.json() if answer.content else None

    gloves = ask("GET", "/api/gloves")
    port = next(g["path"] for g in gloves if g["description"] == "virtual left glove")
    assert port.startswith("socket://127.0.0.1:")
    begun = ask("POST", "/api/patients/1/sessions", {"hand": "left", "port": port})
    station = f"/api/stations/{begun['station']}"
    eventually(lambda: ask("GET", station)["glove"]["state"] == "opened")
    eventually(lambda: ask("GET", station)["wizard"]["state"] != "connecting")
    eventually(lambda: ask("GET", station)["glove"]["recorded"] > 1)
    ask("DELETE", station)
    (recording,) = (tmp_path / "data").rglob("*.mcap")
    assert main(["info", str(recording)]) == 0
    elsewhere = session.post(
        f"{base}/api/patients/1/sessions", json={"hand": "left", "port": "socket://127.0.0.1:22"}
    )
    assert elsewhere.status_code == 422 and "--allow-port" in elsewhere.text


def test_every_verb_is_read_where_a_system_has_no_terminals_and_file_locks(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(HIDDEN)
    read = f"from importlib import import_module\nfor verb in {VERBS}:\n    import_module(f'handscope.app.commands.{{verb}}')"
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-P", "-c", read],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
