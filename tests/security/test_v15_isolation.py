"""ASVS 5, 15.2.5: a file that ends the process which reads it ends nothing else, and is refused in words."""

import asyncio
import os
import subprocess
import sys
from pathlib import Path

import pytest

from handscope.app.cli import main
from handscope.app.workers.upload_reader import UploadReader
from handscope.estimators.errors import InputError
from handscope.sessions.table_import.column_map import TableLayout
from handscope.sessions.table_import.tables import read_table
from tests.fuzz.binary_tables import ROWS, matlabs

AT, BAD = 705, 7  # the type of a part of the second column, as `make fuzz` damaged it
# What SciPy does with it hangs on what lies in memory: in some processes it is an error and not the end
TRIES = 5


@pytest.fixture
def damaged(tmp_path: Path) -> Path:
    """A MATLAB file with one byte changed."""
    content = bytearray(matlabs()[0])
    content[AT] = BAD
    path = tmp_path / "damaged.mat"
    path.write_bytes(content)
    return path


def test_a_file_that_ends_its_reading_process_ends_nothing_else(damaged: Path) -> None:
    """Damaged bytes end it with one memory and are an error with another: `abort` ends it with any."""
    good = damaged.with_name("good.mat")
    good.write_bytes(matlabs()[0])
    with UploadReader() as reader:
        with pytest.raises(InputError, match="the process that read it ended"):
            asyncio.run(reader.call(os.abort))
        with pytest.raises(InputError, match=r"the process that read it ended|damaged\.mat"):
            asyncio.run(reader.call(read_table, damaged, TableLayout()))
        found = asyncio.run(reader.call(read_table, good, TableLayout()))
    assert len(found.values) == ROWS


def test_it_is_the_file_that_ends_its_reader(damaged: Path) -> None:
    read = "import sys; from scipy.io import loadmat; loadmat(sys.argv[1], simplify_cells=True)"
    words = [sys.executable, "-c", read, damaged]
    ends = (subprocess.run(words, capture_output=True).returncode < 0 for _ in range(TRIES))
    assert any(ends), "SciPy refuses it now: read MATLAB files in the fuzz targets, too"


@pytest.mark.process
def test_a_command_refuses_it_in_a_sentence(
    damaged: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = damaged.with_name("map.json")
    assert main(["import", str(damaged), "--guess", str(out)]) == 2
    (said,) = capfd.readouterr().err.splitlines()
    assert "the process that read it ended" in said or "cannot be read as MATLAB" in said
    assert not out.exists()
    good = damaged.with_name("good.mat")
    good.write_bytes(matlabs()[0])
    assert main(["import", str(good), "--guess", str(out)]) == 0
