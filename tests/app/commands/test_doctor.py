"""The doctor: passes a glove that is well, names what is wrong with one that is not, and says where nobody is."""

import json
import os
from pathlib import Path

import pytest

from handscope.app.cli import main
from handscope.app.commands import record
from handscope.app.devices.diagnosis import SensorFigures, sensors_to_mend
from tests.app.devices.virtual import virtual_glove

GLOVE = ["--strips", "index,forearm"]


def test_a_glove_that_is_well_passes_with_its_figures(tmp_path: Path) -> None:
    table = tmp_path / "glove.json"
    with virtual_glove(tmp_path / "glove", *GLOVE) as port:
        words = ["doctor", str(port), "--seconds", "2.5", "--json", str(table)]
        assert main(words) == 0
    found = json.loads(table.read_text())
    assert found["passed"] and found["to_mend"] == [] and found["device"]["hand"] == "left"
    rates = {s["name"]: s["measured_rate"] for s in found["streams"]}
    assert rates["hand"] == pytest.approx(100, rel=0.02) == rates["index"]
    assert rates["forearm"] is None  # a clock of its own takes time to be known
    assert any("forearm: the rate is judged from 30 s on" in note for note in found["notes"])
    assert all(9 < s["acc_size"] < 10.6 and s["gyr_bias"] < 5 for s in found["sensors"])


def test_losses_on_the_wire_are_named_as_such(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with virtual_glove(tmp_path / "glove", *GLOVE, "--loss", "0.05") as port:
        assert main(["doctor", str(port), "--seconds", "2"]) == 1
    printed = capsys.readouterr().out
    assert "frames were lost or damaged on the wire: try another cable" in printed
    assert "lost by the glove 0" in printed


def test_where_nobody_speaks_is_no_device(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(record, "SPEAK_WAIT", 0.5)
    master, slave = os.openpty()
    try:
        for port, sentence in (
            (str(tmp_path / "missing"), "is the glove plugged in?"),
            (os.ttyname(slave), "no glove speaks there"),
        ):
            assert main(["doctor", port, "--json", str(tmp_path / "no.json")]) == 2
            assert sentence in capsys.readouterr().err
    finally:
        os.close(master)
        os.close(slave)
    assert not (tmp_path / "no.json").exists()


@pytest.mark.parametrize(
    ("gyr_bias", "acc_size", "sentence"),
    [
        (4.0, 9.81, "its gyroscope reads 4.0 deg/s at rest, at most 3 is usual"),
        (0.5, 10.8, "its accelerometer is 101 mg off gravity at rest, at most 80 is usual"),
        (0.5, 9.7, ""),
    ],
)
def test_a_bias_beyond_the_data_sheets_is_to_be_mended(
    gyr_bias: float, acc_size: float, sentence: str
) -> None:
    sensor = SensorFigures("hand", gyr_bias, 0.003, acc_size, 0.07)
    assert [sentence in fault for fault in sensors_to_mend([sensor])] == [True] * bool(sentence)
