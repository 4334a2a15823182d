"""A recording that lacks its end goes on where it stopped, wherever that was."""

from pathlib import Path

import pytest

from handscope.estimators.data.samples import Event
from handscope.estimators.errors import InputError
from handscope.sessions.files import native
from handscope.sessions.files.continued_recording import ContinuedRecording, first_metadata
from handscope.sessions.files.recorder import Recorder
from handscope.sessions.files.recording_file import Findings, read_messages
from handscope.sessions.sealing.keys import VARIABLE, make_key
from handscope.sessions.sealing.stored import is_sealed, open_stored


def wires(path: Path) -> tuple[list[bytes], Findings]:
    found = Findings()
    with open_stored(path) as file:
        read = [m.data for topic, m in read_messages(file, found) if topic == "wire"]
    return read, found


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    with Recorder(tmp_path / "r.mcap", {"hand": "left"}, 5.0) as recorder:
        for k in range(4):
            recorder.write(bytes([k]) * 9, 6.0 + k)
    return tmp_path / "r.mcap"


@pytest.mark.parametrize("cut", [0, 1, 30, 49, 50, 51, 80])
def test_a_recording_goes_on_behind_its_last_whole_message(recording: Path, cut: int) -> None:
    data = recording.read_bytes()
    recording.write_bytes(data[: len(data) - cut])
    before, _ = wires(recording)
    assert len(before) == (4 if cut <= 50 else 3)
    going_on = ContinuedRecording(recording)
    assert going_on.written == len(before)
    going_on.write(b"more", 20.0)
    going_on.sync()
    assert wires(recording)[0] == [*before, b"more"]  # already, before it is closed
    going_on.close()
    after, found = wires(recording)
    assert after == [*before, b"more"]
    assert (found.finished, found.damaged, found.unread) == (True, 0, 0)


def test_times_go_on_by_the_same_clock(recording: Path) -> None:
    going_on = ContinuedRecording(recording)
    assert going_on.newest == 9.0
    going_on.write(b"more", 20.0)
    going_on.close()
    with recording.open("rb") as file:
        messages = [message for _, message in read_messages(file, Findings())]
    assert messages[-1].publish_time - messages[0].publish_time == 15_000_000_000
    assert messages[-1].log_time - messages[0].log_time == pytest.approx(15e9, abs=2e3)


def test_a_file_without_a_message_is_not_touched(tmp_path: Path) -> None:
    path = tmp_path / "r.mcap"
    path.write_bytes(b"something else")
    with pytest.raises(InputError):
        ContinuedRecording(path)
    assert path.read_bytes() == b"something else"
    assert first_metadata(path) == {}


@pytest.mark.parametrize("cut", [0, 40, 200])
@pytest.mark.parametrize("sealed", [True, False])
def test_a_stored_recording_with_checkpoints_goes_on_sealed_or_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sealed: bool, cut: int
) -> None:
    """As a relay's, whose server ended after some minutes, closed or killed."""
    if sealed:
        make_key(tmp_path / "key")
        monkeypatch.setenv(VARIABLE, str(tmp_path / "key"))
    path = tmp_path / "r.mcap"
    with Recorder(path, {"port": "relay://7", "hand": "left"}, 5.0, stored=True) as recorder:
        recorder.event("a", Event(1.0, 3.0, "initial_pose"), 6.0)
        for k in range(30):
            recorder.write(bytes([k]) * 900, 6.0 + k)
    path.write_bytes(path.read_bytes()[: path.stat().st_size - cut])
    assert is_sealed(path) == sealed
    assert first_metadata(path)["port"] == "relay://7"
    before, _ = wires(path)
    assert len(before) >= 29
    going_on = ContinuedRecording(path)
    assert going_on.written == len(before)
    for k in range(30):
        going_on.write(bytes([100 + k]), 40.0 + k)
    going_on.sync()
    assert wires(path)[0] == [*before, *(bytes([100 + k]) for k in range(30))]
    going_on.close()
    after, found = wires(path)
    assert len(after) == len(before) + 30
    assert (found.finished, found.damaged, found.unread) == (True, 0, 0)
    assert is_sealed(path) == sealed
    assert [e.trial_type for e in native.read(path).events.values()] == ["initial_pose"]
    assert not list(tmp_path.glob(".*"))
