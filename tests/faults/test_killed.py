"""A server killed at work, again and again; `make faults` does it a hundred times."""

import os
import random
import time
from pathlib import Path

import pytest

from tests.faults.killing import STAGES, clinic

TIMES = int(os.environ.get("HANDSCOPE_KILLS", "4"))


@pytest.mark.slow
def test_a_server_killed_at_any_moment_has_lost_nothing(tmp_path: Path) -> None:
    order = [STAGES[k % len(STAGES)] for k in range(TIMES)]
    random.Random(TIMES).shuffle(order)
    with clinic(tmp_path, TIMES) as found:
        for k, stage in enumerate(order):
            print(f"{time.monotonic():.1f} kill {k + 1} of {TIMES}: {stage}", flush=True)  # noqa: T201  seen with `make faults`
            found.kill_during(stage)
