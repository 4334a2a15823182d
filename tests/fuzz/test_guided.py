"""`make fuzz` is guided: what reads an input is imported while atheris watches imports, not at the first input."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.test_architecture import ROOT

# In place of atheris: notes what was imported when it stopped watching, then reads the good inputs
PROGRAM = """
import contextlib, sys, types
from pathlib import Path

@contextlib.contextmanager
def instrument_imports(include):
    yield
    watched.update(sys.modules)

def setup(words, one):
    for place in Path(words[-1]).iterdir():
        one(place.read_bytes())

watched = set()
sys.modules["atheris"] = types.SimpleNamespace(instrument_imports=instrument_imports, Setup=setup, Fuzz=lambda: None)
from tests.fuzz import run
assert run.main() == 0
print(*[name for name in sorted({*sys.modules} - watched) if name.startswith(tuple(run.INSTRUMENTED))])
"""


@pytest.mark.process
@pytest.mark.parametrize("name", ["xdf", pytest.param("xlsx", marks=pytest.mark.slow)])
def test_nothing_that_is_fuzzed_is_imported_later(name: str, tmp_path: Path) -> None:
    words = [sys.executable, "-c", PROGRAM, "--one", name, "--corpus", str(tmp_path)]
    # a command that ran in this process may have asked for a safe path
    found = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, env=found, check=True)
    assert done.stdout.split() == []
