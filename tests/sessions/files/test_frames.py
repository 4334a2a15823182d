"""Tables for notebooks, and the examples in docs/examples as somebody runs them."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from handscope.app.cli import main
from handscope.estimators.hand.anatomy import FLEXION, JOINT
from handscope.estimators.measures.assessment import assess
from handscope.sessions.files.frames import figures, frame, movement
from tests.simulated import DEG, pose_and_wiggle

ROOT = Path(__file__).parents[3]
EXAMPLES = sorted((ROOT / "docs/examples").glob("*.py"))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("examples") / "tapping.zip"
    assert main(["simulate", "tapping", "--out", str(path)]) == 0
    return path


def test_a_movement_is_columns_in_the_units_a_person_reads() -> None:
    truth = pose_and_wiggle("left").truth
    columns = movement(truth)
    assert {len(v) for v in columns.values()} == {len(truth)}
    np.testing.assert_allclose(columns["time"], truth.t)
    np.testing.assert_allclose(
        columns["index_pip_flexion_deg"] * DEG, truth.angles[:, JOINT["index_pip"], FLEXION]
    )
    assert 100 < columns["middle_tip_y_mm"].max() < 220
    assert "hand_quat_w" in columns


def test_figures_are_rows_with_the_task_that_they_belong_to() -> None:
    results = assess(pose_and_wiggle("left").truth, [])
    columns = figures(results)
    assert {len(v) for v in columns.values()} == {sum(len(r.figures) for r in results)}
    assert set(columns["task"]) == {"whole recording"}
    assert columns["name"][0] == results[0].figures[0].name


def test_a_data_frame_has_the_columns() -> None:
    pytest.importorskip("pandas")
    table = frame({"a": [1, 2], "b": ["x", "y"]})
    assert list(table) == ["a", "b"]
    assert len(table) == 2


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda p: p.stem)
@pytest.mark.filterwarnings("ignore")
def test_the_examples_run(
    example: Path,
    recording: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("pandas")
    made = {"01_load_and_plot": ["movement.png"], "02_measures": ["figures.csv"]}.get(
        example.stem, []
    )
    given = [str(recording), *(str(tmp_path / name) for name in made)] if made else []
    monkeypatch.setattr(sys, "argv", [str(example), *given])
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(example), run_name="__main__")
    assert all((tmp_path / name).stat().st_size > 500 for name in made)
    assert {
        "01_load_and_plot": "index_pip_flexion_deg",
        "02_measures": "tapping_rate",
        "03_tapping_from_arrays": "do not increase",
    }[example.stem] in capsys.readouterr().out


def test_there_are_three_examples() -> None:
    assert len(EXAMPLES) == 3
