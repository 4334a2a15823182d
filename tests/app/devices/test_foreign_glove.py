"""A glove in another language, written from the protocol's page alone, over TCP: recorded without a lost sample, its faults named."""

import json
import re
import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.app.commands import record
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats_recordings

GLOVE = Path(__file__).with_name("glove.pl")
RATE = 200  # Hz
NO_GLOVE = {
    "silence": "is open, but no glove speaks there",
    "hangs up": "hung up; does another program use the glove?",
}
pytestmark = [
    pytest.mark.process,
    pytest.mark.skipif(shutil.which("perl") is None, reason="there is no Perl here"),
]


@contextmanager
def foreign_glove(seconds: float, *faults: str) -> Iterator[str]:
    """Its address; it falls silent after so many seconds of samples."""
    words = ["perl", str(GLOVE), str(RATE), str(seconds), *faults]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as glove:
        assert glove.stdout is not None
        try:
            yield glove.stdout.readline().strip()
        finally:
            glove.kill()


@pytest.mark.parametrize("seconds", [3.0, pytest.param(60.0, marks=pytest.mark.slow)])
def test_17_sensors_at_200_hz_are_recorded_without_a_lost_sample(
    seconds: float, tmp_path: Path
) -> None:
    out = tmp_path / "glove.mcap"
    with foreign_glove(seconds + 60) as url:
        assert main(["record", url, "--out", str(out), "--seconds", str(seconds)]) == 0
    recording = formats_recordings.load(out)
    assert recording.warnings == () and not any(recording.losses.values())
    assert sum(len(stream.sensors) for stream in recording.streams) == 17
    for block in recording.samples.values():
        assert len(block.t) > (seconds - 0.5) * RATE
        np.testing.assert_allclose(np.diff(block.t), 1 / RATE, atol=2e-9)


@pytest.fixture(scope="module")
def faulty(tmp_path_factory: pytest.TempPathFactory) -> tuple[LoadedRecording, list[str], str]:
    """A glove with every fault: what was recorded, what the doctor would mend, and what was printed."""
    folder = tmp_path_factory.mktemp("faulty")
    out, table = folder / "glove.mcap", folder / "glove.json"
    every = ("version", "crc", "half", "garbage", "slot", "rates", "strips", "pose")
    with foreign_glove(20, *every) as url, redirect_stdout(StringIO()) as printed:
        assert main(["record", url, "--out", str(out), "--seconds", "1.5"]) == 0
        assert main(["doctor", url, "--seconds", "1.5", "--json", str(table)]) == 1
    to_mend = json.loads(table.read_text())["to_mend"]
    return formats_recordings.load(out), to_mend, printed.getvalue()


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("another version", r"speaks version 2 of the wire protocol.*use firmware of version 1"),
        (
            "half frames, wrong checksums",
            r"damaged \(\d+\), of \d+|frames? (was|were) lost or damaged",
        ),
        ("a slot that is taken", r"slot 3 was claimed by strips.*plug only one of them in"),
        ("64 strips for one place", r"slots 100, 101, .*163 state the same place \(trunk\)"),
        ("rates of 0 and 1e9", r"messages of the glove were left out \(stream 20[01].*firmware"),
    ],
)
def test_a_fault_is_named_in_a_sentence_by_recording_and_doctor(
    faulty: tuple[LoadedRecording, list[str], str], fault: str, sentence: str
) -> None:
    recording, to_mend, printed = faulty
    for sentences in (recording.warnings, to_mend):
        assert any(re.search(sentence, one) for one in sentences), fault
    assert "Traceback" not in printed


def test_a_pose_that_cannot_be_used_is_a_warning_and_the_recording_goes_on(
    faulty: tuple[LoadedRecording, list[str], str],
) -> None:
    recording, _, printed = faulty
    assert "the live tracker is not calibrated, the recording goes on: the initial pose" in printed
    assert recording.duration > 1.4


def test_a_glove_with_every_fault_loses_no_sample_of_the_rest(
    faulty: tuple[LoadedRecording, list[str], str],
) -> None:
    recording, _, _ = faulty
    assert not any(recording.losses.values())
    assert {s.name for s in recording.streams} == {
        "hand",
        "forearm",
        "thumb",
        "middle",
        "ring",
        "little",
    }
    for block in recording.samples.values():  # the index finger's slot is claimed by two strips
        np.testing.assert_allclose(np.diff(block.t), 1 / RATE, atol=2e-9)


@pytest.fixture(params=["text", "noise", "silence", "hangs up"])
def no_glove(request: pytest.FixtureRequest) -> Iterator[tuple[str, str]]:
    """The address of a service that is no glove, and what it does."""
    listener = socket.create_server(("127.0.0.1", 0))
    spoken: dict[str, bytes | None] = {
        "text": b"$GPGGA,123519,4807.038,N*47\r\n",
        "noise": bytes(range(256)),
        "silence": b"",
        "hangs up": None,
    }

    def serve() -> None:
        with suppress(OSError):
            while True:
                host, _ = listener.accept()
                with host, suppress(OSError):
                    while (words := spoken[request.param]) is not None:
                        host.sendall(words)
                        threading.Event().wait(0.02)

    threading.Thread(target=serve, daemon=True).start()
    yield f"socket://127.0.0.1:{listener.getsockname()[1]}", request.param
    listener.shutdown(socket.SHUT_RDWR)
    listener.close()


def test_a_port_that_speaks_something_else_is_named_and_nothing_is_left(
    no_glove: tuple[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    url, what = no_glove
    monkeypatch.setattr(record, "SPEAK_WAIT", 0.5)
    assert main(["record", url, "--out", str(tmp_path / "r.mcap")]) == 2
    said = capsys.readouterr().err
    assert NO_GLOVE.get(what, "sends something else than the wire protocol; choose") in said
    assert "Traceback" not in said
    assert list(tmp_path.iterdir()) == []
