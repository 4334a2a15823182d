"""What all verbs share: how the program names itself to a person who is to run it again."""

import os
import sys
from pathlib import Path

import pytest

from handscope.app import serving


@pytest.mark.parametrize("is_on_path", [False, True])
def test_the_command_for_another_address_can_be_run_as_it_is_printed(
    is_on_path: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    started = tmp_path / "bin" / "handscope"
    started.parent.mkdir()
    started.touch(0o755)
    monkeypatch.setattr(sys, "argv", [str(started), "demo"])
    folders = [str(started.parent)] if is_on_path else []
    monkeypatch.setenv("PATH", os.pathsep.join([*folders, str(tmp_path)]))
    serving._announce("http://127.0.0.1:8420", tmp_path, printed=False, browser=False)
    named = "handscope" if is_on_path else started
    assert f"with: {named} login --data {tmp_path}\n" in capsys.readouterr().out
