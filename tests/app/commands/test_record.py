"""A recording replayed through the virtual glove, recorded and tracked live, against the same recording in batch; recordings that fail or end early."""

import os
import re
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.app.commands import record
from handscope.app.devices.virtual_glove.firmware import AHEAD
from handscope.sessions.files import native
from tests.app.commands.test_commands import refused, table
from tests.app.devices.virtual import virtual_glove


@pytest.mark.slow
def test_a_replayed_recording_gives_the_same_live_in_batch_and_from_its_original(
    tmp_path: Path,
) -> None:
    original = tmp_path / "original.zip"
    assert main(["simulate", "wiggle", "--out", str(original), "--seed", "2"]) == 0
    with virtual_glove(tmp_path / "glove", "--replay", str(original)) as port:
        assert (
            main(
                [
                    "record",
                    str(port),
                    "--out",
                    str(tmp_path / "r.mcap"),
                    "--method",
                    "m2",
                    "--live",
                    str(tmp_path / "live"),
                ]
            )
            == 0
        )
    by_m2 = ["--method", "m2", "--out"]
    assert main(["process", str(original), *by_m2, str(tmp_path / "batch")]) == 0
    assert main(["process", str(tmp_path / "r.mcap"), *by_m2, str(tmp_path / "native")]) == 0
    columns, batch = table(tmp_path / "batch", "desc-m2")
    names, native = table(tmp_path / "native", "desc-m2")
    shown_names, shown = table(tmp_path / "live", "desc-m2")
    assert columns == names == shown_names
    np.testing.assert_allclose(
        native, batch, atol=2e-6, equal_nan=True
    )  # rad, m: the wire carries float32
    same = native[np.searchsorted(native[:, 0], shown[0, 0]) :]
    assert len(shown) > 500
    np.testing.assert_array_equal(shown, same)


def test_a_recording_that_could_not_begin_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(record, "SPEAK_WAIT", 1.0)
    master, slave = os.openpty()
    out, live = tmp_path / "r.mcap", tmp_path / "live"
    try:
        for port, sentence in (
            (str(tmp_path / "missing"), "is the glove plugged in?"),
            ("/dev/null", "cannot be opened as a serial port"),
            (os.ttyname(slave), "no glove speaks there"),
        ):
            assert sentence in refused(
                ["record", port, "--out", str(out), "--live", str(live)], capsys
            )
            assert not list(tmp_path.iterdir()), port
    finally:
        os.close(master), os.close(slave)


def test_a_glove_of_the_other_hand_is_refused_at_once_and_may_be_recorded_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "r.mcap"
    with virtual_glove(tmp_path / "glove", "--hand", "left") as port:
        words = ["record", str(port), "--out", str(out), "--seconds", "1"]
        assert "this is a left glove, --hand says right" in refused(
            [*words, "--hand", "right"], capsys
        )
        assert not out.exists()
        assert main(words) == 0
    assert native.load(out).hand == "left"


@pytest.mark.slow
def test_strips_and_cables_that_were_pulled_are_told_with_their_times(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "r.mcap"
    faults = ("--pull", "index@5", "--plug", "index@6.5", "--unplug", "8")
    with virtual_glove(tmp_path / "glove", "--task", "wiggle", *faults) as port:
        assert main(["record", str(port), "--out", str(out), "--seconds", "30"]) == 1
    recorded = capsys.readouterr().out
    assert main(["info", str(out)]) == 0
    known = capsys.readouterr().out
    for told in (recorded, known):
        ended = re.search(r"([\d.]+) s of 30 s: the glove was unplugged at ([\d.]+) s", told)
        assert ended and ended[1] == ended[2]
        assert float(ended[1]) == pytest.approx(native.load(out).duration, abs=0.1)
        absent = re.findall(r"(\w+) was absent from ([\d.]+) s to ([\d.]+) s \(([\d.]+) s\)", told)
        assert [a[0] for a in absent] == ["index"]
        assert float(absent[0][3]) == pytest.approx(
            1.5, abs=2.1 * AHEAD
        )  # s; the virtual glove makes its samples ahead
        assert float(absent[0][2]) - float(absent[0][1]) == pytest.approx(
            float(absent[0][3]), abs=0.11
        )


@pytest.mark.parametrize(
    ("recorded", "asked", "why", "sentence"),
    [
        (14.1, 14.0, "", ""),
        (9.6, 14.0, "the glove was unplugged", "9.6 s of 14 s: the glove was unplugged at 9.6 s"),
        (9.6, 14.0, "", "9.6 s of 14 s: the glove fell silent at 9.6 s"),
        (9.6, None, "the glove was unplugged", "9.6 s: the glove was unplugged at 9.6 s"),
        (9.6, None, "", ""),
    ],
)
def test_a_recording_that_ended_early_says_how_long_it_is_and_why(
    recorded: float, asked: float | None, why: str, sentence: str
) -> None:
    assert record.ending(recorded, asked, why) == sentence
