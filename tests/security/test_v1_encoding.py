"""ASVS 5, 1.2.10: no table for spreadsheets holds a formula."""

import csv

import pytest

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
