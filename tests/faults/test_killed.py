"""A server killed at work, again and again, with plain and with sealed files; `make faults` does it a hundred times each."""

import os
import random
import time
from pathlib import Path

import pytest

from handscope.sessions.sealing.keys import VARIABLE, make_key
from tests.faults.killing import STAGES, clinic

TIMES = int(os.environ.get("HANDSCOPE_KILLS", "4"))


@pytest.fixture(params=["plain", "sealed"])
def key(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path | None:
    """The data key of the servers and of this process; None: nothing is sealed."""
    if request.param == "plain":
        return None
    pytest.importorskip("cryptography")
    make_key(tmp_path / "key")
    monkeypatch.setenv(VARIABLE, str(tmp_path / "key"))
    return tmp_path / "key"


@pytest.mark.slow
def test_a_server_killed_at_any_moment_has_lost_nothing(tmp_path: Path, key: Path | None) -> None:
    order = [STAGES[k % len(STAGES)] for k in range(TIMES)]
    random.Random(TIMES).shuffle(order)
    with clinic(tmp_path, TIMES, key) as found:
        for k, stage in enumerate(order):
            print(f"{time.monotonic():.1f} kill {k + 1} of {TIMES}: {stage}", flush=True)  # noqa: T201  seen with `make faults`
            found.kill_during(stage)
