"""`handscope reproduce` as a person uses it."""

import json
from datetime import date
from pathlib import Path

import pytest

from handscope.app.cli import main
from handscope.validation.papers import mechanical_finger


def refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line on standard error of a command that ends with exit code 2."""
    assert main(["reproduce", *words]) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1
    return said.err


def test_one_experiment_of_table_6_is_printed_written_and_put_on_a_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pages, figures = tmp_path / "pages", tmp_path / "all.json"
    words = [
        "table6",
        "--seeds",
        "1",
        "--experiment",
        "F-F2",
        "--jobs",
        "1",
        "--json",
        str(figures),
        "--markdown",
        str(pages),
    ]
    assert main(["reproduce", *words]) == 0
    said = capsys.readouterr().out
    assert "Salchow-Hoemmen 2019, Table 6" in said
    assert (
        "middle of the angle of the sensor against its segment, about a random axis 7.5 deg" in said
    )
    found = json.loads(figures.read_text())["reproductions"][0]
    tips = found["tables"][0]
    assert [row["name"] for row in tips["rows"]] == ["F-F2"]
    assert tips["rows"][0]["theirs"] == {"b": 2.1, "m1": 0.6, "m2": 0.6, "m2 heading": 0.6}
    assert 0.0 < tips["rows"][0]["ours"]["m2"]["mean"] < 3.0  # cm
    written = (pages / "table6.md").read_text()
    assert written.startswith("# One finger moves")
    assert "| F-F2 |" in written


def test_the_mechanical_finger_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mechanical_finger, "METHODS", ("m2",))  # the one that is drawn
    figures = tmp_path / "figures"
    pages = tmp_path / "pages"
    assert (
        main(
            [
                "reproduce",
                "mechanical-finger",
                "--seeds",
                "1",
                "--out",
                str(figures),
                "--markdown",
                str(pages),
            ]
        )
        == 0
    )
    assert (figures / "reproduce-mechanical-finger.svg").read_text().count("<svg") == 1
    page = (pages / "mechanical-finger.md").read_text()
    assert "(../figures/reproduce-mechanical-finger.svg)" in page
    title, _, written = page.splitlines()[:3]
    assert title.startswith("# One joint after the other")
    assert f"mechanical-finger --seeds 1` on {date.today():%Y-%m-%d}, version" in written
    assert (pages / "error-sizes.md").read_text().startswith("# Error sizes")


def test_trials_in_processes_of_their_own_give_the_same(tmp_path: Path) -> None:
    found = []
    for jobs in ("1", "2"):
        path = tmp_path / f"{jobs}.json"
        assert (
            main(
                [
                    "reproduce",
                    "table6",
                    "--seeds",
                    "2",
                    "--experiment",
                    "A-F3",
                    "--jobs",
                    jobs,
                    "--json",
                    str(path),
                ]
            )
            == 0
        )
        found.append(json.loads(path.read_text())["reproductions"])
    assert found[0] == found[1]


def test_mistakes_are_said_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "there is no reproduction 'table8'; reproductions are table6, table7" in refused(
        ["table8"], capsys
    )
    assert "there is no experiment 'A-F9'" in refused(["table6", "--experiment", "A-F9"], capsys)
    assert "table7 has none of the experiments A-F1" in refused(
        ["table7", "--experiment", "A-F1"], capsys
    )
    assert "--seeds 0 is less than 1" in refused(["table6", "--seeds", "0"], capsys)
    assert "github.com/dlaidig/broad" in refused(["broad", "--broad-data", str(tmp_path)], capsys)
