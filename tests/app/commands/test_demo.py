"""The demonstration as a program: however it is ended, its virtual gloves end with it."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

WAIT = 30.0  # s until a test gives up


@pytest.mark.parametrize(("told", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_whoever_ends_the_demonstration_ends_its_gloves(told: signal.Signals, code: int, tmp_path: Path) -> None:
    words = [sys.executable, "-m", "app.cli", "demo", "--no-browser", "--port", "0", "--data", str(tmp_path)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as demo:
        assert demo.stdout is not None
        next(line for line in demo.stdout if line.startswith("Research use"))
        gloves = list((tmp_path / "gloves").iterdir())
        assert len(gloves) == 2
        demo.send_signal(told)
        _, errors = demo.communicate(timeout=WAIT)  # until nobody has the pipe any more: the gloves have it, too
    assert (demo.returncode, errors) == (code, "")
    assert not any(glove.is_symlink() for glove in gloves)
