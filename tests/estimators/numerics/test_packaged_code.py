"""Machine code that a package brings: used by a processor of its class with nothing translated, and left alone by any other."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process
KERNELS = """
from handscope.estimators.numerics.jit import looped, rowwise

@rowwise("(n),(n)->()")
def dot(a, b, out):
    out[0] = 0.0
    for k in range(len(a)):
        out[0] += a[k] * b[k]

@looped
def sum_of_squares(a):
    total = 0.0
    for x in a:
        total += x * x
    return total
"""
RUNS = """
import numpy as np
from measured.rooms import kernels

a = np.linspace(0.1, 0.7, 7)
print(kernels.dot(a, a[::-1]).hex(), kernels.sum_of_squares(a).hex())
"""
GATHERS = """
from pathlib import Path
import measured
from handscope.estimators.numerics.translation.packaged_code import gather

gather(Path(measured.__file__).parent)
"""
CLASS = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}


def _said(program: str, folder: Path, **others: str) -> str:
    own = {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1", **others}
    words = [sys.executable, "-P", "-c", program]
    return subprocess.run(
        words, capture_output=True, check=True, text=True, env={**os.environ, **own}
    ).stdout


def test_it_is_taken_by_a_processor_that_can_run_it_and_translated_anew_by_another(
    tmp_path: Path,
) -> None:
    rooms = tmp_path / "measured" / "rooms"
    rooms.mkdir(parents=True)
    (rooms.parent / "__init__.py").touch()
    (rooms / "kernels.py").write_text(KERNELS)
    wanted = _said(RUNS + GATHERS, tmp_path, **CLASS)
    assert list(rooms.glob("__pycache__/*.nb?")) == []
    assert _said(RUNS, tmp_path) == wanted
    assert list(rooms.glob("__pycache__/*.nb?")) == []  # nothing was translated
    about = rooms.parent / "machine_code" / "about.json"
    known = json.loads(about.read_text())
    about.write_text(json.dumps(known | {"processor": ["", "", "+of-a-later-processor"]}))
    assert _said(RUNS, tmp_path) == wanted
    assert len(list(rooms.glob("__pycache__/*.nbc"))) == 3  # a row, its loop over rows, a loop
