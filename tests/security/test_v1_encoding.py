"""ASVS 5, 1.2.10: no table for spreadsheets holds a formula. 1.5.1: XML brings in nothing."""

import csv
from pathlib import Path

import pytest

from handscope.estimators.errors import InputError
from handscope.sessions.table_import.formats.mvnx import read_mvnx
from handscope.sessions.tables_io.spreadsheet import write_table

FORMULAS = ("=1+1", "+cmd", "-cmd|' /C calc'!A0", "@SUM(A1)", "\t=1", "\r=1", " =1", "P;=1+1")


@pytest.mark.parametrize("formula", FORMULAS)
def test_no_cell_of_a_table_begins_a_formula(formula: str) -> None:
    written = write_table((formula, "b"), [(formula, 1.0)], [f"patient: x,{formula}"]).decode()
    for mark in ",;\t":
        for line in csv.reader(written.splitlines(), delimiter=mark):
            for cell in line:
                text = cell.strip()
                assert not text.startswith(("=", "+", "@", "-")), (mark, line)


def test_numbers_stay_numbers() -> None:
    written = write_table(("a", "b", "c"), [(-1.5, "-2.5", None)]).decode()
    assert written == "a,b,c\n-1.5,-2.5,\n"


@pytest.mark.parametrize(
    ("entities", "used"),
    [
        ('<!ENTITY a SYSTEM "file:///etc/passwd">', "&a;"),
        ("".join(f'<!ENTITY a{k} "{10 * f"&a{k - 1};"}">' for k in range(1, 10)), "&a9;"),
        (f'<!ENTITY a "{"x" * 100_000}">', 20_000 * "&a;"),
    ],
    ids=["a file of the server", "a billion laughs", "a long one often"],
)
def test_an_xml_file_brings_in_nothing_and_grows_no_further(
    tmp_path: Path, entities: str, used: str
) -> None:
    """ASVS 5, 1.5.1: the expat that Python brings resolves no external entity and bounds what entities grow to."""
    place = tmp_path / "a.mvnx"
    place.write_text(
        f'<!DOCTYPE mvnx [<!ENTITY a0 "ten letters">{entities}]><mvnx><comment>{used}</comment></mvnx>'
    )
    with pytest.raises(InputError, match="cannot be read as mvnx"):
        read_mvnx(place)
