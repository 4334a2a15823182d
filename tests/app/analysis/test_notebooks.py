"""The notebooks of docs/notebooks run from their first cell to their last, as somebody runs them in an empty folder."""

from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[3] / "docs/notebooks").glob("*.ipynb"))
LONGEST = 180  # s a cell


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_a_notebook_runs(path: Path, tmp_path: Path) -> None:
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=LONGEST, resources={"metadata": {"path": str(tmp_path)}}
    ).execute()  # an error in a cell is an error here
    assert sum(cell.cell_type == "code" for cell in notebook.cells) >= 4


def test_there_are_two_notebooks_and_none_names_a_folder_of_somebodys() -> None:
    assert [p.stem for p in NOTEBOOKS] == ["analyse_a_recording", "compare_with_an_optical_system"]
    for path in NOTEBOOKS:
        text = path.read_text()
        assert not any(place in text for place in ("/home/", "/tmp/", "/root/", "/work/"))
