"""The doctor: passes a glove that is well, names what is wrong with one that is not, and says where nobody is."""

import json
import os
from pathlib import Path

import pytest

from handscope.app.cli import main
from handscope.app.commands import record
from tests.app.devices.virtual import virtual_glove

GLOVE = ["--strips", "index,forearm"]


def test_a_glove_that_is_well_passes_with_its_figures(tmp_path: Path) -> None:
    table = tmp_path / "glove.json"
    with virtual_glove(tmp_path / "glove", *GLOVE) as port:
        words = ["doctor", str(port), "--seconds", "2.5", "--json", str(table)]
        assert main(words) == 0
    found = json.loads(table.read_text())
    assert found["passed"] and found["to_mend"] == [] and found["device"]["hand"] == "left"
    assert {s["name"] for s in found["streams"]} == {"hand", "index", "forearm"}
    assert all(abs(s["measured_rate"] / s["stated_rate"] - 1) < 0.02 for s in found["streams"])
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
