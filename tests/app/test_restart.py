"""A real server killed while it computes: the next one on the same data takes up what was running and what waited."""

from pathlib import Path

from sqlalchemy import select

from handscope.app.version import software_version
from handscope.sessions.clinic import patients, results
from handscope.sessions.db.tables import Result
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.motion_bids import writer
from handscope.sessions.store import records
from handscope.sessions.store.store import Store, open_store
from tests.faults.victim import Victim, wait_for
from tests.simulated import pose_and_wiggle

WAYS = (("m2", {}), ("m2", {"alignment": "heading"}), ("m2", {"gyr_reading": "instant"}))


def queued(store: Store) -> list[int]:
    """A kept recording with a result a way, none begun."""
    made = pose_and_wiggle("left")
    recording = LoadedRecording(
        made.hand, made.geometry, {}, made.samples, made.events, source={"device": "simulated"}
    )
    place = store.incoming / "r.zip"
    place.write_bytes(writer.pack(writer.tree(recording, "01", "wiggle")))
    with store.database() as db:
        session = records.add_upload(db, store, patients.create(db, "P-1"), place, "r.zip", None)
        return [
            results.find_matching(db, session.recordings[0], method, options, software_version()).id
            for method, options in WAYS
        ]


def states(store: Store) -> list[str]:
    with store.database() as db:
        return list(db.scalars(select(Result.state).order_by(Result.id)))


def test_what_a_killed_server_left_is_computed_by_the_next(tmp_path: Path) -> None:
    store = open_store(tmp_path / "data")
    made = queued(store)
    server = Victim(store.folder).start()
    wait_for(lambda: "running" in states(store))
    server.kill()
    at_the_end = states(store)
    assert {"running", "queued"} <= set(at_the_end), at_the_end
    server.start()
    wait_for(lambda: not any(s in results.UNFINISHED for s in states(store)))
    told = [server.call("GET", f"/api/results/{k}") for k in made]
    server.stop()
    assert [(r["state"], r["error"]) for r in told] == [("done", "")] * len(WAYS)
    assert all(r["figures"] for r in told)
    assert [r["progress"] for r in told] == [1.0] * len(WAYS)
