"""One simulated recording of tapping, processed once for all formats."""

from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.app.results.export_content import Content
from handscope.estimators.methods import METHODS
from handscope.estimators.pipeline.process import process
from handscope.sessions.formats import recordings


@pytest.fixture(scope="package")
def content(tmp_path_factory: pytest.TempPathFactory) -> Content:
    path: Path = tmp_path_factory.mktemp("exports") / "tapping.zip"
    assert main(["simulate", "tapping", "--out", str(path), "--seed", "4", "--hand", "right"]) == 0
    recording, method = recordings.load(path), METHODS["ekf"]
    return Content(recording, process(method, method.Params(), recording), "ekf", method.Params())


@pytest.fixture(scope="package")
def rows(content: Content) -> np.ndarray:
    """A hundred instants at which every joint is known."""
    known = np.flatnonzero(np.isfinite(content.moved.tips).all(axis=(1, 2)))
    return known[np.linspace(0, len(known) - 1, 100).astype(int)]
