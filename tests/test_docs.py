"""The documentation site builds without a warning, and what its method pages name exists."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from handscope.validation.reproduce import REPRODUCTIONS

ROOT = Path(__file__).parents[1]
METHOD_PAGES = sorted((ROOT / "docs" / "methods").glob("*.md"))
PREFIXES = ("", "self_calibration/", "magnet/", "force/")  # a page's tables say which


def named(page: Path) -> list[str]:
    """What stands in code marks in the tables of a page and looks like a path."""
    rows = [line for line in page.read_text().splitlines() if line.startswith("|")][2:]
    return [w for row in rows for w in re.findall(r"`([^`]+)`", row) if re.search(r"\.py|/$", w)]


def found(folder: Path, words: str) -> Path | None:
    path = words.split(":")[0].removeprefix("tests/estimators/").removeprefix("estimators/")
    candidates = [folder / prefix / path for prefix in PREFIXES]
    return next((p for p in candidates if p.exists()), None)


@pytest.mark.parametrize("page", METHOD_PAGES, ids=lambda p: p.stem)
def test_every_function_and_test_that_a_method_page_names_exists(page: Path) -> None:
    for words in named(page):
        folder = "tests/estimators" if "test_" in words else "estimators"
        path = found(ROOT / folder, words)
        assert path is not None, f"{page.name}: {words}"
        if ":" in words:
            tree = ast.parse(path.read_text())
            defined = {n.name for n in tree.body if isinstance(n, ast.FunctionDef | ast.ClassDef)}
            name = words.split(":")[1].strip()
            assigned = {t.id for n in tree.body if isinstance(n, ast.Assign) for t in n.targets if isinstance(t, ast.Name)}  # fmt: skip
            assert name in defined | assigned, f"{page.name}: {words}"


def test_a_measured_page_is_of_a_reproduction_that_exists() -> None:
    pages = {p.stem for p in (ROOT / "docs" / "validation").glob("*.md")}
    assert pages - {"error-sizes"} <= set(REPRODUCTIONS)


def test_the_readme_is_a_front_page() -> None:
    assert (ROOT / "README.md").read_text().count("\n") <= 100


@pytest.mark.slow
@pytest.mark.process
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    made = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stdout + made.stderr
    pages = list((tmp_path / "site").rglob("*.html"))
    fetched = re.compile(r'(?:src|href)="(https?:)?//[^"]+\.(?:js|css|woff2?)"')
    assert not [p.name for p in pages if fetched.search(p.read_text())]
