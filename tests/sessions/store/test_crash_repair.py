"""What a killed server left open is closed from the ends of its recording, however long that is, and read whole afterwards."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from handscope.sessions.clinic import patients
from handscope.sessions.files import native
from handscope.sessions.files.recorder import CHECKPOINT
from handscope.sessions.files.recording_ends import read_ends
from handscope.sessions.files.recording_file import find_last_chunk
from handscope.sessions.store import crash_repair, records
from handscope.sessions.store.store import open_store
from tests.sessions.store.left_open import write_left_open


def _bytes_read(work: Callable[[], object]) -> int:
    """Bytes that this process asked of the system while it worked."""

    def so_far() -> int:
        lines = Path("/proc/self/io").read_text().splitlines()
        return int(dict(line.split(": ") for line in lines)["rchar"])

    before = so_far()
    work()
    return so_far() - before


@pytest.mark.skipif(
    sys.platform != "linux", reason="only Linux counts the bytes that a process reads"
)
def test_repair_reads_no_more_of_a_long_recording_than_of_a_short_one(tmp_path: Path) -> None:
    write_left_open(tmp_path / "short.mcap", 1.0)
    write_left_open(tmp_path / "long.mcap", 8.0)
    short, long = (
        _bytes_read(lambda n=n: read_ends(tmp_path / n)) for n in ("short.mcap", "long.mcap")
    )
    grown = (tmp_path / "long.mcap").stat().st_size - (tmp_path / "short.mcap").stat().st_size
    assert abs(long - short) < 0.1 * grown


def test_a_session_is_closed_from_the_ends_and_read_whole_afterwards(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    with store.database() as db:
        session, file = records.begin(db, store, patients.create(db, "P-1"), "left", {})
        write_left_open(store.path_of(file.file), 0.5)
        assert crash_repair.close_from_ends(db, store, session.id).state == "recorded"
        ends = dict(file.summary)
        assert (file.sha256, [s.id for s in crash_repair.list_unread(db)]) == (None, [session.id])
        assert crash_repair.read_whole(db, store, session.id).state == "recorded"
        assert (file.sha256, crash_repair.list_unread(db)) == (
            native.file_checksum(store.path_of(file.file)),
            [],
        )
        assert [e["task"] for e in file.summary["events"]] == ["tapping"]
        assert ends["events"] == file.summary["events"]
        assert ends["source"]["device_id"] == file.summary["source"]["device_id"]
        streams = [{k: v for k, v in s.items() if k != "samples"} for s in file.summary["streams"]]
        assert ends["streams"] == streams
    store.close()


def test_a_damaged_checkpoint_is_passed_over_for_the_one_before(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    write_left_open(path, 0.5)
    data = bytearray(path.read_bytes())
    with path.open("rb") as file:
        at = find_last_chunk(file, CHECKPOINT, 0, len(data))
    assert at is not None
    data[at + 60] ^= 1
    path.write_bytes(bytes(data))
    found = read_ends(path)
    assert found is not None
    assert list(found.events) == list(native.read(path).events.values()) != []


def test_a_recording_without_a_checkpoint_is_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    write_left_open(path, 0.0)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 4])
    assert native.read(path).wire
    assert read_ends(path) is None


def test_a_checkpoint_costs_no_message_its_number(tmp_path: Path) -> None:
    write_left_open(tmp_path / "r.mcap", 1.0, close=True)
    contents = native.read(tmp_path / "r.mcap")
    assert (contents.file.finished, contents.file.damaged) == (True, 0)
