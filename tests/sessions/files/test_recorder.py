"""Writing a native recording: what a killed program, a full disk and a closed file leave behind."""

import errno
import io
import itertools
import threading
import time
import tracemalloc
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from handscope.estimators.data.samples import Event
from handscope.sessions.files import native
from handscope.sessions.files.original_messages import Original, pack, read_originals
from handscope.sessions.files.recorder import SYNC_EVERY, Recorder
from handscope.sessions.files.recording_file import Findings

BEGAN = datetime(2025, 3, 1, 12, 0, 0, tzinfo=UTC)


class Disk(io.BytesIO):
    """A file that takes `room` bytes and then says that the disk is full; counts how often it is put on the disk."""

    def __init__(self, room: int = 10**9) -> None:
        super().__init__()
        self.room, self.flushed, self.kept = room, 0, b""

    def write(self, data: bytes) -> int:
        if self.tell() + len(data) > self.room:
            super().write(data[: self.room - self.tell()])
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(data)

    def flush(self) -> None:
        self.flushed += 1

    def fileno(self) -> int:
        raise io.UnsupportedOperation("fileno")

    def close(self) -> None:
        self.kept = self.getvalue()
        super().close()


def test_everything_written_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Recorder(path, {"hand": "left", "note": "Łódź"}, 50.0, BEGAN) as recorder:
        recorder.write(b"\1\2\3", 50.25)
        recorder.command(b"\4", 50.5)
        recorder.event(
            "e1",
            Event(
                1.0,
                3.0,
                "task",
                {"task_name": "rom", "angle": np.float64(2.5), "list": np.arange(2)},
            ),
            51.0,
        )
        recorder.write(b"\5", 51.5)
        assert recorder.bytes_written > 5
    contents = native.read(path)
    assert contents.wire == [
        (pytest.approx(50.25, abs=1e-9), b"\1\2\3"),
        (pytest.approx(51.5, abs=1e-9), b"\5"),
    ]
    assert contents.events == {
        "e1": Event(1.0, 3.0, "task", {"task_name": "rom", "angle": 2.5, "list": [0, 1]})
    }
    assert contents.metadata["note"] == "Łódź"
    assert contents.metadata["start_utc"] == "2025-03-01T12:00:00+00:00"
    assert (contents.file.finished, contents.file.damaged, contents.file.unread) == (True, 0, 0)


def test_an_event_may_be_replaced_and_taken_back_and_metadata_changed(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Recorder(path, {"hand": "left", "task": "rom"}, 0.0) as recorder:
        recorder.event("a", Event(1.0, 3.0, "task"), 1.0)
        recorder.event("b", Event(5.0, 3.0, "task"), 5.0)
        recorder.event("a", Event(1.0, 2.5, "task"), 6.0)
        recorder.event("b", None, 7.0)
        recorder.event("never", None, 7.0)
        recorder.metadata({"task": "tapping"}, 8.0)
    contents = native.read(path)
    assert contents.events == {"a": Event(1.0, 2.5, "task")}
    assert (contents.metadata["task"], contents.metadata["hand"]) == ("tapping", "left")


def test_times_of_arrival_come_back_to_the_bit_where_they_are_whole_nanoseconds(
    tmp_path: Path,
) -> None:
    """So that a recording played again maps clocks exactly as the live view did: take monotonic_ns() * 1e-9."""
    arrivals = [ns * 1e-9 for ns in (1, 123_456_789_012_345, 999_999_999_999_999)]
    path = tmp_path / "a.mcap"
    with Recorder(path, {"hand": "left"}, 0.0) as recorder:
        for arrival in arrivals:
            recorder.write(b"x", arrival)
    assert [arrival for arrival, _ in native.read(path).wire] == arrivals


def test_any_mcap_reader_can_read_a_finished_recording(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Recorder(path, {"hand": "left"}, 0.0, BEGAN) as recorder:
        recorder.write(b"abc", 0.5)
    with path.open("rb") as file:
        found = [
            (channel.topic, message.data, message.log_time)
            for _, channel, message in make_reader(file).iter_messages()
        ]
    assert [topic for topic, _, _ in found] == ["metadata", "wire"]
    assert found[1] == ("wire", b"abc", round(BEGAN.timestamp() * 1e9) + 500_000_000)


def test_what_a_source_gave_comes_back_and_is_numbered_by_itself(tmp_path: Path) -> None:
    """So that a program that does not know its channel misses nothing; what rests, and shrinks to nothing, is read as well."""
    path, rests = tmp_path / "a.mcap", bytes(3 * 2**20)
    with Recorder(path, {"hand": "left"}, 0.0, BEGAN) as recorder:
        for k in range(30):
            recorder.original(pack(Original({"kind": "k", "number": k}, rests)), float(k))
            recorder.write(b"abc", k + 0.5)
    found = Findings()
    kept = list(read_originals(path, found))
    assert [(o.head["number"], o.body == rests) for o in kept] == [(k, True) for k in range(30)]
    assert (found.damaged, found.finished) == (0, True)
    with path.open("rb") as file:
        messages = [m for _, channel, m in make_reader(file).iter_messages() if channel.id < 5]
    assert [m.sequence for m in messages] == list(range(31))


def test_a_damaged_message_of_a_source_is_counted(tmp_path: Path) -> None:
    path, bodies = tmp_path / "a.mcap", [np.random.default_rng(k).bytes(2000) for k in range(3)]
    with Recorder(path, {"hand": "left"}, 0.0, BEGAN) as recorder:
        for k, body in enumerate(bodies):
            recorder.original(pack(Original({"kind": "k"}, body)), float(k))
            recorder.write(b"abc", k + 0.5)
    data = path.read_bytes()
    path.write_bytes(data.replace(bodies[1][500:600], bytes(100)))
    found = Findings()
    assert [o.body for o in read_originals(path, found)] == [bodies[0], bodies[2]]
    assert found.damaged == 1
    assert len(native.read(path).wire) == 3


def test_an_existing_recording_is_never_written_over(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(FileExistsError):
        Recorder(path, {}, 0.0)
    assert path.read_bytes() == b"precious"


def test_each_message_is_handed_to_the_system_at_once_and_to_the_disk_every_second(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    synced: list[int] = []
    monkeypatch.setattr("handscope.sessions.files.recorder.os.fsync", synced.append)
    path = tmp_path / "a.mcap"
    recorder = Recorder(path, {"hand": "left"}, 0.0)
    for k in range(1, 31):
        recorder.write(bytes([k]), 0.1 * k)
        assert native.read(path).wire[-1][1] == bytes([k])  # without closing
        while len(synced) < int(0.1 * k / SYNC_EVERY):  # by another thread
            time.sleep(1e-3)
    assert len(synced) == 3
    recorder.close()
    assert len(synced) == 4


def test_what_comes_while_the_disk_is_slow_is_written_and_its_failure_told_by_a_later_write(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    is_there = threading.Event()

    def fail_late(_: int) -> None:
        is_there.wait()
        raise OSError("no such disk any more")

    path = tmp_path / "a.mcap"
    recorder = Recorder(path, {"hand": "left"}, 0.0)
    with monkeypatch.context() as slow:
        slow.setattr("handscope.sessions.files.recorder.os.fsync", fail_late)
        for k in range(1, 4):
            recorder.write(bytes([k]), SYNC_EVERY * k)
            assert native.read(path).wire[-1][1] == bytes([k])
        is_there.set()
        with pytest.raises(OSError, match="no such disk"):
            _write_on(recorder)
    recorder.close()


def _write_on(recorder: Recorder) -> None:
    for k in range(4, 10_000):
        recorder.write(b"later", SYNC_EVERY * k)


def _taken(recorder: Recorder, data: bytes) -> bool:
    try:
        recorder.write(data, 0.0)
    except OSError:
        return False
    return True


def test_a_full_disk_is_told_and_leaves_what_was_written_before(tmp_path: Path) -> None:
    disk = Disk(room=5000)
    recorder = Recorder(tmp_path / "x", {"hand": "left"}, 0.0, file=disk)
    sent = [b"%d" % k * 20 for k in range(1000)]
    written = list(itertools.takewhile(lambda data: _taken(recorder, data), sent))
    with pytest.raises(OSError, match="No space"):
        recorder.write(sent[len(written)], 0.0)
    with pytest.raises(OSError):
        recorder.close()
    assert disk.closed
    path = tmp_path / "full.mcap"
    path.write_bytes(disk.kept)
    contents = native.read(path)
    assert [data for _, data in contents.wire] == written
    assert not contents.file.finished


def test_when_there_is_room_again_the_recording_goes_on(tmp_path: Path) -> None:
    disk = Disk(room=3000)
    recorder = Recorder(tmp_path / "x", {"hand": "left"}, 0.0, file=disk)
    sent, failed = [b"%d" % k * 20 for k in range(60)], []
    for k, data in enumerate(sent):
        if k == 40:
            disk.room = 10**6
        if not _taken(recorder, data):
            failed.append(data)
    path = tmp_path / "again.mcap"
    path.write_bytes(disk.getvalue())
    contents = native.read(path)
    assert failed
    assert [data for _, data in contents.wire] == [data for data in sent if data not in failed]
    assert contents.file.damaged == len(failed)


def test_closing_twice_is_closing_once(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", {"hand": "left"}, 0.0)
    recorder.close()
    size = (tmp_path / "a.mcap").stat().st_size
    recorder.close()
    assert (tmp_path / "a.mcap").stat().st_size == size


def test_a_long_recording_needs_no_more_memory_than_a_short_one(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.mcap", {"hand": "left"}, 0.0)
    recorder.write(bytes(100), 0.0)
    tracemalloc.start()
    try:
        for k in range(3000):
            recorder.write(bytes(100), 1e-6 * k)
        grown, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        recorder.close()
    assert grown < 20_000  # bytes; an index entry a message would be 1 MB
