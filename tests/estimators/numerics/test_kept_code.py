"""Kernels that were kept: loaded without what translates, and linked by kernels that are translated later."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from handscope.estimators.numerics import quaternions as quat

LOADS_A_KERNEL = """
import sys
import numpy as np
from handscope.estimators.numerics import quaternions as quat, tail_probabilities
print(quat.normalize(np.array([0.0, 0.0, 3.0, 4.0])), tail_probabilities.chi2_sf(3.0, 2))
print([m for m in ("numba.np.linalg", "numba.typed.typeddict", "numpy.f2py", "scipy.linalg") if m in sys.modules])
import numpy.f2py
print(numpy.f2py.__name__, numpy.ma.masked)
"""
KERNELS = """
import sys
from handscope.estimators.numerics.jit import looped

@looped
def square(x):
    return x * x

@looped
def sum_of_squares(n):
    total = 0.0
    for k in range(n):
        total += square(float(k))
    return total

print(square(3.0), *(sum_of_squares(4) for _ in sys.argv[1:]))
"""


def _said(*words: str, folder: Path) -> list[str]:
    done = subprocess.run(
        [sys.executable, *words],
        capture_output=True,
        check=True,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONSAFEPATH": "1"},
    )
    return done.stdout.splitlines()


def test_a_kept_kernel_is_loaded_without_what_translates(tmp_path: Path) -> None:
    quat.normalize(np.array([0.0, 0.0, 3.0, 4.0]))  # kept from here on
    result, imported, later = _said("-c", LOADS_A_KERNEL, folder=tmp_path)
    assert result == "[0.  0.  0.6 0.8] 0.22313016014842982"
    assert imported == "[]"
    assert later == "numpy.f2py --"  # who asks for it by its name gets it


def test_a_new_kernel_links_one_that_was_kept(tmp_path: Path) -> None:
    (tmp_path / "kernels.py").write_text(KERNELS, "utf-8")
    assert _said("kernels.py", folder=tmp_path) == ["9.0"]
    (kept,) = tmp_path.glob("__pycache__/*square*.nbc")
    assert b"handscope" not in kept.read_bytes()  # who reads it needs no module of ours
    assert _said("kernels.py", "both", folder=tmp_path) == ["9.0 14.0"]  # translated here
    assert _said("kernels.py", "both", folder=tmp_path) == ["9.0 14.0"]  # and loaded here
