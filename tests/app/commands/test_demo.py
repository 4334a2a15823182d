"""The demonstration, as a program and as a process that was told to end: however it is ended, its virtual gloves end with it."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from handscope.app.workers.process import CONTEXT
from tests import fork_server

WAIT = 120.0  # s until a test gives up


def words(folder: Path) -> list[str]:
    return ["demo", "--no-browser", "--no-examples", "--port", "0", "--data", str(folder)]


def gloves_of(folder: Path) -> list[Path]:
    gloves = list((folder / "gloves").iterdir())
    assert len(gloves) == 2
    return gloves


@pytest.mark.slow
def test_ctrl_c_at_the_program_ends_its_gloves(tmp_path: Path) -> None:
    program = [sys.executable, "-P", "-m", "handscope.app.cli", *words(tmp_path)]
    with subprocess.Popen(
        program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as demo:
        assert demo.stdout is not None
        next(line for line in demo.stdout if line.startswith("Research use"))
        gloves = gloves_of(tmp_path)
        demo.send_signal(signal.SIGINT)
        _, errors = demo.communicate(
            timeout=WAIT
        )  # until nobody has the pipe any more: the gloves have it, too
    assert (demo.returncode, errors) == (130, "")
    assert not any(glove.is_symlink() for glove in gloves)


@pytest.mark.skipif(sys.platform != "linux", reason="forked on Linux alone")
def test_a_request_to_end_ends_its_gloves(tmp_path: Path) -> None:
    (out, its_out), (errors, its_errors) = CONTEXT.Pipe(duplex=False), CONTEXT.Pipe(duplex=False)
    demo = CONTEXT.Process(target=fork_server.run, args=(words(tmp_path), its_out, its_errors))
    demo.start()
    its_out.close(), its_errors.close()
    with (
        open(out.fileno(), closefd=False) as said,
        open(errors.fileno(), closefd=False) as complained,
    ):
        next(line for line in said if line.startswith("Research use"))
        gloves = gloves_of(tmp_path)
        assert demo.pid is not None
        os.kill(demo.pid, signal.SIGTERM)
        assert (
            complained.read() == ""
        )  # until nobody has the pipe any more: the gloves have it, too
    out.close(), errors.close()
    demo.join(WAIT)
    assert demo.exitcode == 143
    assert not any(glove.is_symlink() for glove in gloves)
