"""`kill -9` of the server at a random moment of what a clinician does, and what must hold afterwards.

One glove, one data folder, one server after the other: each is killed at work and the next must find everything in order.
"""

import random
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from sqlalchemy import create_engine, text

from handscope.sessions.files import native
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from handscope.sessions.sealing.keys import VARIABLE
from handscope.sessions.sealing.stored import is_sealed
from handscope.sessions.store.database import FILE, upgrade
from tests.app.devices.virtual import virtual_glove
from tests.faults.victim import ProgramVictim, Victim, wait_for
from tests.simulated import pose_and_wiggle

LOST = 1.0  # s at the end of a recording that a kill may cost
ENDED = ("done", "failed")


class Clinic:
    """What was done so far; `kill_during` does one more thing and kills the server in the middle of it.

    With a data `key` the servers seal what they store; this process opens it by the same key, in the environment.
    """

    def __init__(self, folder: Path, port: Path, rng: random.Random, key: Path | None) -> None:
        self.data, self._port, self._rng, self._key = folder / "data", port, rng, key
        began = time.monotonic()
        self.server = self._server_on(self.data).start()
        self._starts_within = time.monotonic() - began  # s
        self.patient = int(self.server.call("POST", "/api/patients", {"pseudonym": "P-1"})["id"])
        self._zip, self._migrated = _zipped(), 0
        self._done = self.server.upload(self.patient, self._zip)["result"]
        wait_for(lambda: self._result(self._done)["state"] == "done")
        self._recorded: dict[
            int, float
        ] = {}  # by session, s of recording that a browser was shown before the kill

    def kill_during(self, stage: str) -> None:
        """Kill at a random moment of the stage, start again, look at everything."""
        getattr(self, f"_{stage}")()
        if not self.server.runs:
            self.server.start()
            wait_for(self._is_repaired)
        self.require_order()

    def require_order(self) -> None:
        """The database is consistent, nothing half-written lies about, every session is closed with all that was flushed."""
        with sqlite3.connect(self.data / FILE) as db:
            assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            assert db.execute("PRAGMA foreign_key_check").fetchall() == []
            files = db.execute(
                "SELECT session.id, session.state, file, sha256 FROM recording JOIN session ON session.id = session_id"
            ).fetchall()
        kept = {p.relative_to(self.data).as_posix() for p in (self.data / "recordings").iterdir()}
        assert kept == {name for _, _, name, _ in files if (self.data / name).exists()}, (
            "a file without a row"
        )
        assert list((self.data / "incoming").iterdir()) == []
        for session, state, name, sha256 in files:
            seen = self._recorded.get(session, 0.0)
            assert state != "open", f"session {session} was left open"
            if sha256 is None:
                assert state == "failed" and seen == 0.0, (
                    f"the recording of session {session} was given up, {seen} s were shown"
                )
                continue
            path = self.data / name
            assert native.file_checksum(path) == sha256, f"{name} changed after it was closed"
            assert is_sealed(path) == (self._key is not None), f"{name} lies there open"
            if session in self._recorded:
                recording = native.load(path)
                assert recording.duration > seen - LOST, (
                    f"{seen} s were shown, {recording.duration} s are in the recording"
                )

    def require_results(self) -> None:
        """Every recorded session ends with a result; one whose computation was killed twice is asked for again."""
        for session in self._sessions():
            if session["state"] == "failed":
                continue
            wanted = self.server.call("POST", f"/api/sessions/{session['id']}/results", {})[
                "result"
            ]
            told = wait_for(
                lambda wanted=wanted: (r := self._result(wanted))["state"] in ENDED and r
            )
            assert (
                told["state"] == "done" or "calibration" in told["error"] or "pose" in told["error"]
            ), told["error"]

    def _recording(self) -> None:
        station, session = self._begin()
        self._wait_randomly(1.5, lambda: self._look(station, session))
        self._kill()

    def _calibration(self) -> None:
        station, session = self._begin()
        snapshot = lambda: self.server.call("GET", f"/api/stations/{station}")  # noqa: E731
        wait_for(lambda: "continue" in snapshot()["wizard"]["actions"])
        for action in ("continue", "start"):
            self.server.call("POST", f"/api/stations/{station}/actions", {"action": action})
        self._wait_randomly(4.0, lambda: self._look(station, session))
        self._kill()

    def _upload(self) -> None:
        self._meanwhile(lambda: self.server.upload(self.patient, self._zip), 0.3)

    def _processing(self) -> None:
        made = self.server.upload(self.patient, self._zip)
        self._wait_randomly(1.0, lambda: self._result(made["result"]))
        self._kill()

    def _report(self) -> None:
        self._meanwhile(
            lambda: self.server.call("GET", f"/api/results/{self._done}/report.pdf"), 1.0
        )
        self.server.start()
        assert self.server.call("GET", f"/api/results/{self._done}/report.pdf").startswith(b"%PDF")
        self._kill()

    def _migration(self) -> None:
        """Another server is killed while it brings the database of an earlier version up to date."""
        self._migrated += 1
        data = self.data.parent / f"old-{self._migrated}"
        data.mkdir()
        _first_schema(data / FILE)
        old = self._server_on(data).start(wait=False)
        time.sleep(self._rng.uniform(0.0, self._starts_within))
        old.kill()
        old.start()
        old.kill()
        with sqlite3.connect(data / FILE) as db:
            assert db.execute("SELECT text FROM note").fetchall() == [("old note",)]
            assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)

    def _server_on(self, data: Path) -> Victim:
        """A program of its own where there is a key: processes that are forked have the environment of their fork server."""
        return ProgramVictim(data, {VARIABLE: str(self._key)}) if self._key else Victim(data)

    def _begin(self) -> tuple[str, int]:
        wait_for(lambda: not any(g["in_use"] for g in self.server.call("GET", "/api/gloves")))
        made = self.server.call(
            "POST",
            f"/api/patients/{self.patient}/sessions",
            {"hand": "left", "port": str(self._port)},
        )
        return made["station"], made["session"]

    def _look(self, station: str, session: int) -> None:
        shown = self.server.call("GET", f"/api/stations/{station}")["glove"]["recorded"]
        self._recorded[session] = max(shown, self._recorded.get(session, 0.0))

    def _wait_randomly(self, most: float, look: Callable[[], Any]) -> None:
        until = time.monotonic() + self._rng.uniform(0.0, most)
        while time.monotonic() < until:
            look()
            time.sleep(0.02)

    def _meanwhile(self, work: Callable[[], Any], most: float) -> None:
        """Kill at a random moment of a request."""

        def ask() -> None:
            with suppress(OSError, ValueError):  # the answer that never came
                work()

        asking = threading.Thread(target=ask)
        asking.start()
        time.sleep(self._rng.uniform(0.0, most))
        self._kill()
        asking.join()

    def _kill(self) -> None:
        self.server.kill()

    def _is_repaired(self) -> bool:
        """Whether no session is being repaired any more."""
        found = self.server.call("GET", "/api/sessions/unfinished")
        return not any(session["repairing"] or session["reading"] for session in found)

    def _result(self, result: int) -> Any:
        return self.server.call("GET", f"/api/results/{result}")

    def _sessions(self) -> list[Any]:
        return list(self.server.call("GET", f"/api/patients/{self.patient}")["sessions"])


STAGES = ("recording", "processing", "upload", "migration", "calibration", "report")


@contextmanager
def clinic(folder: Path, seed: int, key: Path | None = None) -> Iterator[Clinic]:
    """A clinic with a glove; every result must be there in the end."""
    with virtual_glove(folder / "glove", "--strips", "index") as port:
        found = Clinic(folder, port, random.Random(seed), key)
        try:
            yield found
            found.require_results()
        finally:
            found.server.stop()


def _zipped() -> bytes:
    made = pose_and_wiggle("left")
    recording = LoadedRecording(
        made.hand, made.geometry, {}, made.samples, made.events, source={"device": "simulated"}
    )
    return writer.pack(writer.tree(recording, "01", "wiggle"))


def _first_schema(path: Path) -> None:
    engine = create_engine(f"sqlite:///{path}")
    upgrade(engine, "0001")
    with engine.begin() as connection:
        connection.execute(text("INSERT INTO patient (pseudonym, hand_measures, notes, archived, created, version) VALUES ('P', '{}', 'old note', 0, '2024-01-01 00:00:00.000000', 1)"))  # fmt: skip
    engine.dispose()
