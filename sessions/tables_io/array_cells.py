"""Cells of a text table: any separator, decimal commas, quotes, cells that hold x, y and z.

In      text, cut anywhere into lines
Out     lines with their numbers, numbers of cells
"""

import csv
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from handscope.estimators.errors import InputError

MISSING = {"", "n/a", "na", "nan", "null", "none"}
COMMENT = ("#", "%")
BRACKETS = {"(": ")", "[": "]"}  # around a cell of three
Line = tuple[int, list[str]]  # its number and its cells


@contextmanager
def read_lines(path: Path, largest: int, instead: str) -> Iterator[Iterator[Line]]:
    """Lines of a file; InputError where there is none, or it exceeds `largest` bytes: `instead`
    says how much that is and what to do."""
    if not path.is_file():
        raise InputError("reference.not_file", name=str(path))
    if path.stat().st_size > largest:
        raise InputError("array.too_large", name=path.name, instead=instead)
    with path.open(encoding="utf-8-sig", errors="replace", newline=None) as file:
        yield _split_lines(file)


def _split_lines(file: TextIO) -> Iterator[Line]:
    """Cells of every line that is neither empty nor a comment."""
    mark: str | None = None
    for number, line in enumerate(file, 1):
        text = line.rstrip("\r\n")
        if not text.strip() or text.lstrip().startswith(COMMENT):
            continue
        if mark is None:
            mark = next((m for m in "\t;," if m in text), " ")
        cells = (
            text.split()
            if mark == " "
            else _split_quoted(text, mark, number)
            if '"' in text
            else text.split(mark)
        )
        cells = [cell.strip().strip('"') for cell in cells]
        yield (
            number,
            cells
            if mark == ","
            else [cell if split_triple(cell) else cell.replace(",", ".") for cell in cells],
        )


def _split_quoted(text: str, mark: str, number: int) -> list[str]:
    try:
        return next(csv.reader([text], delimiter=mark, skipinitialspace=True))
    except csv.Error as problem:
        raise InputError("array.line_unreadable", number=number, problem=str(problem)) from problem


def split_triple(cell: str) -> list[str]:
    """The numbers of a cell that holds x, y and z; empty of any other cell."""
    if len(cell) < 2 or BRACKETS.get(cell[0]) != cell[-1]:
        return []
    return cell[1:-1].replace(",", " ").replace(";", " ").split()


def drop_empty_end(cells: list[str], many: int = 1) -> list[str]:
    """Without empty cells after the last separator of a line."""
    while len(cells) > many and not cells[-1]:
        cells = cells[:-1]
    return cells


def is_number(cell: str) -> bool:
    """Whether a cell holds a number."""
    try:
        float(cell)
    except ValueError:
        return cell.lower() in MISSING
    return True


def expand_triples(cells: Sequence[str], wide: Sequence[bool]) -> list[str]:
    """Every cell that holds three as three."""
    single: list[str] = []
    for cell, three in zip(cells, wide):
        parts = (split_triple(cell) or [cell] * 3) if three else [cell]
        if three and len(parts) != 3:
            raise ValueError(f"{cell} are {len(parts)} numbers where x, y and z are looked for")
        single += parts
    return single


def parse_number(cell: str) -> float:
    """The number of a cell; NaN where it is missing."""
    return float("nan") if cell.lower() in MISSING else float(cell)
