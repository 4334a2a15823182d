"""An icon of a Linux desktop opens the pages, logged in, whether a server runs or not."""

import configparser
import shlex
import webbrowser
from pathlib import Path

import pytest

from handscope.app import serving
from handscope.app.cli import main
from handscope.app.commands import desktop_entry
from handscope.sessions.store.folder_lock import hold_folder


def test_the_entry_names_a_program_a_folder_and_an_icon_that_are_there(tmp_path: Path) -> None:
    data = tmp_path / "my data"
    assert main(["desktop-entry", "--data", str(data), "--out", str(tmp_path)]) == 0
    read = configparser.ConfigParser(interpolation=None)
    read.read(tmp_path / "applications" / "handscope.desktop", "utf-8")
    entry = read["Desktop Entry"]
    program, *words = shlex.split(entry["Exec"])
    assert words == ["open", "--data", str(data)]
    assert Path(program).is_file()
    icon = tmp_path / "icons" / "hicolor" / "scalable" / "apps" / f"{entry['Icon']}.svg"
    assert icon.read_text("utf-8").startswith("<svg")


def test_what_has_a_meaning_in_the_entry_is_escaped() -> None:
    assert desktop_entry.quote('50 % "of" $5') == '"50 %% \\\\"of\\\\" \\\\$5"'


def test_a_folder_that_cannot_be_written_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "applications").write_text("a file")
    assert main(["desktop-entry", "--out", str(tmp_path)]) == 2
    assert str(tmp_path) in capsys.readouterr().err


def test_it_opens_the_server_that_runs_and_starts_one_where_none_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    started: list[bool] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setattr(serving, "serve", lambda *_, browser, printed: started.append(browser))
    assert main(["open", "--data", str(tmp_path)]) == 0
    assert (opened, started) == ([], [True])
    (tmp_path / "address").write_text("http://127.0.0.1:8420\n")
    with hold_folder(tmp_path):
        assert main(["open", "--data", str(tmp_path)]) == 0
    assert len(started) == 1
    assert [address.split("=")[0] for address in opened] == ["http://127.0.0.1:8420/login?token"]
