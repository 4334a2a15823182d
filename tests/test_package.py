"""What is installed: one name, every file of the rooms, every import declared, and programs that ignore the folder they are started in."""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from tests.app.devices.virtual import virtual_glove
from tests.test_architecture import MODULES, ROOT, imports

ROOMS = ("app", "estimators", "sessions", "static", "validation")
PROGRAM = Path(sys.executable).with_name("handscope")
BY_NAME = {"python-multipart"}  # FastAPI reads forms with it and nobody imports it


def _wheel(folder: Path, **environment: str) -> Path:
    """A wheel made from the files that git knows."""
    source = folder / "source"  # a build leaves folders beside what it reads
    for name in _listed("*.py", "*.toml", "README.md", "LICENSE", "handscope", *ROOMS):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, source / name)
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--wheel-dir",
        "..",
        ".",
    ]
    subprocess.run(
        command, cwd=source, check=True, capture_output=True, env={**os.environ, **environment}
    )
    (wheel,) = folder.glob("*.whl")
    return wheel


def test_the_wheel_holds_one_name_and_every_file_of_the_rooms(tmp_path: Path) -> None:
    wheel = _wheel(tmp_path)
    assert wheel.name.endswith("-py3-none-any.whl")
    held = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in held if ".dist-info/" not in name} == {"handscope"}
    assert [name for name in _listed(*ROOMS) if f"handscope/{name}" not in held] == []


PROCESSES = """
import sys
import numpy as np
from handscope.app.workers import translation
import handscope as hs

print(translation.is_kept())
for method in ("m2", "ekf"):
    np.save(sys.stdout.buffer, hs.process(hs.load(sys.argv[1]), method=method).trajectory.angles)
"""


@pytest.mark.slow
@pytest.mark.process
def test_the_wheel_of_this_platform_translates_nothing_and_computes_the_same(
    tmp_path: Path,
) -> None:
    installed, cache, recording = tmp_path / "installed", tmp_path / "cache", tmp_path / "r.zip"
    with zipfile.ZipFile(_wheel(tmp_path, HANDSCOPE_TRANSLATED="1")) as wheel:
        wheel.extractall(installed)
    subprocess.run(
        [PROGRAM, "simulate", "rom_fist", "--out", recording], check=True, capture_output=True
    )
    own = {"XDG_CACHE_HOME": str(cache), "PYTHONPATH": str(installed), "OPENBLAS_NUM_THREADS": "1"}
    here, there = (
        subprocess.run(
            [sys.executable, "-P", "-c", PROCESSES, recording],
            check=True,
            capture_output=True,
            env={**os.environ, **environment},
        ).stdout
        for environment in ({"OPENBLAS_NUM_THREADS": "1"}, own)
    )
    assert there.startswith(b"True\n")
    assert there.partition(b"\n")[2] == here.partition(b"\n")[2]
    code = {p.relative_to(installed).parts[1] for p in installed.rglob("*.nb[ic]")}
    assert (code, cache.exists()) == ({"machine_code"}, False)


def _listed(*patterns: str) -> list[str]:
    """Files that git knows."""
    return subprocess.run(
        ["git", "ls-files", *patterns], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.split()


def test_a_recording_ignores_files_of_the_folder_it_is_started_in(tmp_path: Path) -> None:
    here = tmp_path / "here"
    here.mkdir()
    for name in ("estimators", "app", "sessions", "numpy", "json", "serialx"):
        (here / f"{name}.py").write_text("raise SystemExit('imported from the working folder')\n")
    with virtual_glove(tmp_path / "glove", "--hand", "left") as port:
        words = [str(PROGRAM), "record", str(port), "--out", "r.mcap", "--seconds", "1"]
        done = subprocess.run(words, cwd=here, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert (here / "r.mcap").stat().st_size > 10_000


def _names(requirements: list[str]) -> set[str]:
    """Names of distributions as they are compared: lower case, one kind of dash."""
    return {re.split(r"[\[<>=!~; ]", r)[0].lower().replace("_", "-") for r in requirements}


def _imported() -> set[str]:
    """Distributions that modules outside the tests import."""
    product = [p for p in MODULES if p.relative_to(ROOT).parts[0] != "tests"]
    names = {i.split(".")[0] for p in product for i in imports(p, "handscope.x") if i}
    known = packages_distributions()
    return _names([known[name][0] for name in names if name in known]) - {"handscope"}


def test_what_is_imported_is_declared_and_what_is_declared_is_used() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    declared = _names(project["dependencies"])
    extras = _names(
        [r for extra, rs in project["optional-dependencies"].items() if extra != "dev" for r in rs]
    )
    imported = _imported()
    assert sorted(imported - declared - extras) == []
    assert sorted(declared - imported - BY_NAME) == []


def test_files_of_others_are_those_that_the_list_names() -> None:
    lines = (ROOT / "static" / "vendor" / "MANIFEST.txt").read_text().splitlines()[1:]
    listed = {path: digest for _, _, digest, path in map(str.split, lines)}
    folders = [ROOT / f for f in ("static/vendor", "tests/vendor", "docs/site/katex")]
    there = [p for f in folders for p in f.rglob("*") if p.is_file() and p.name != "MANIFEST.txt"]
    found = {str(p.relative_to(ROOT)): hashlib.sha256(p.read_bytes()).hexdigest() for p in there}
    assert found == listed
