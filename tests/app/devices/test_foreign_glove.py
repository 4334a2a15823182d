"""A glove in another language, written from the protocol's page alone, over TCP: recorded without a lost sample, its faults named."""

import json
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.sessions.formats import recordings as formats_recordings

GLOVE = Path(__file__).with_name("glove.pl")
RATE = 200  # Hz
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
    with foreign_glove(seconds + 1) as url:
        assert main(["record", url, "--out", str(out), "--seconds", str(seconds)]) == 0
    recording = formats_recordings.load(out)
    assert recording.warnings == () and not any(recording.losses.values())
    assert sum(len(stream.sensors) for stream in recording.streams) == 17
    for block in recording.samples.values():
        assert len(block.t) > (seconds - 0.5) * RATE
        np.testing.assert_allclose(np.diff(block.t), 1 / RATE, atol=2e-9)


def test_its_faults_are_named_and_the_rest_is_recorded_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, table = tmp_path / "glove.mcap", tmp_path / "glove.json"
    with foreign_glove(20, "version", "crc", "garbage", "slot", "rates", "strips") as url:
        assert main(["record", url, "--out", str(out), "--seconds", "1.5"]) == 0
        assert main(["doctor", url, "--seconds", "1.5", "--json", str(table)]) == 1
    printed = capsys.readouterr().err + capsys.readouterr().out
    recording = formats_recordings.load(out)
    assert not any(recording.losses.values())
    for sentence in (
        "speaks version 2 of the wire protocol",
        "damaged",
        "slot 3 was claimed by strips",
        "messages of the glove were left out (stream 20",
        "state the same place (trunk)",
    ):
        assert any(sentence in warning for warning in recording.warnings), sentence
    found = json.loads(table.read_text())["to_mend"]
    assert any("speaks version 2" in fault for fault in found)
    assert "Traceback" not in printed
