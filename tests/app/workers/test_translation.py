"""Translating beside a server: begun where nothing is kept, ended with the server, not begun again."""

import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from handscope.app.workers import translation
from tests.app.devices.virtual import wait_for


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A module of estimators that are not ours; what is kept stands elsewhere."""
    kept, rooms = tmp_path / "kept", tmp_path / "estimators"
    kept.mkdir(), rooms.mkdir()
    monkeypatch.setattr(translation, "kept_in", lambda: kept)
    monkeypatch.setattr(translation, "estimators", SimpleNamespace(__path__=[str(rooms)]))
    (rooms / "kernels.py").write_text("")
    return rooms / "kernels.py"


def test_what_is_kept_is_not_translated_again_until_a_file_changes(
    module: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    translation.note_kept()
    monkeypatch.setattr(translation, "COMMAND", ("no such program",))
    with translation.beside():
        pass
    os.utime(module, (0, 0))
    with pytest.raises(FileNotFoundError), translation.beside():
        pass


@pytest.mark.process
def test_the_end_of_a_server_ends_it(
    module: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = tmp_path / "begun"
    program = f"import os, time; open({str(begun)!r}, 'w').write(str(os.getpid())); time.sleep(600)"
    monkeypatch.setattr(translation, "COMMAND", (sys.executable, "-c", program))
    with translation.beside():
        wait_for(lambda: begun.exists() and begun.read_text())
    with pytest.raises(ProcessLookupError):
        os.kill(int(begun.read_text()), 0)


def test_a_place_where_nothing_can_be_kept_costs_no_error(
    module: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(translation, "kept_in", lambda: module / "nowhere")
    translation.note_kept()
    assert not translation.is_kept()
