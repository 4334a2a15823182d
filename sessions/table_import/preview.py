"""What a person is shown of a table before it is mapped: its first rows and a guess of what they are.

In      a file, and how its text is laid out where a person said so
Out     a Preview; a layout that does not fit is a message in it, not an error
"""

import csv
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from handscope.estimators.errors import InputError
from handscope.estimators.messages import Message
from handscope.sessions.table_import.column_map import TableLayout
from handscope.sessions.table_import.guess import Guess, guess_columns, guess_layout
from handscope.sessions.table_import.importing import read_once
from handscope.sessions.table_import.number_columns import NumberColumns, text_lines
from handscope.sessions.table_import.tables import READERS

SHOWN = 8  # rows
LONGEST = 40  # characters of a cell
MOST_COLUMNS = 400  # shown, and offered for mapping


@dataclass(frozen=True)
class Preview:
    """The beginning of a table."""

    is_text: bool  # so that its layout can be changed
    layout: TableLayout
    names: tuple[str, ...]  # empty where there is no header, or the table cannot be read
    columns: int
    count: int  # rows
    rows: tuple[tuple[str, ...], ...]  # the first ones, as they are written
    key: str  # the same for tables of the same columns
    guess: Guess | None
    problem: Message | str | None  # why it cannot be read by this layout


def preview(path: Path, layout: TableLayout | None = None) -> Preview:
    """The beginning of a file; InputError where it is no table at all."""
    layout = layout or guess_layout(path)
    is_text = path.suffix.lower() not in READERS
    try:
        table = read_once(path, layout)
    except InputError as problem:
        if not is_text:
            raise
        rows = _first_cells(path, layout)
        why = problem.message or str(problem)
        return Preview(True, layout, (), max(map(len, rows), default=0), 0, rows, "", None, why)
    rows = _first_cells(path, layout) if is_text else _first_numbers(table)
    return Preview(
        is_text,
        layout,
        table.names[:MOST_COLUMNS],
        table.values.shape[1],
        len(table.values),
        rows,
        header_key(table.names, table.values.shape[1]),
        guess_columns(table, path.stem, layout),
        None,
    )


def header_key(names: Sequence[str], columns: int) -> str:
    """The same for tables with the same columns, whatever their order; of tables without a header by their number of columns."""
    text = "\0".join(sorted(names)) if names else f"{columns} columns"
    return hashlib.sha256(text.encode()).hexdigest()


def _first_cells(path: Path, layout: TableLayout) -> tuple[tuple[str, ...], ...]:
    """Cells of the first rows below the header, as text."""
    lines = text_lines(path)[layout.skip : layout.skip + 4 * SHOWN]
    rows = csv.reader(lines, delimiter=layout.delimiter)
    try:
        found = [_shorten(row) for row in rows if any(cell.strip() for cell in row)]
    except csv.Error:
        return ()
    return tuple(found[layout.header : SHOWN + layout.header])


def _shorten(row: Sequence[str]) -> tuple[str, ...]:
    return tuple(cell.strip()[:LONGEST] for cell in islice(row, MOST_COLUMNS))


def _first_numbers(table: NumberColumns) -> tuple[tuple[str, ...], ...]:
    return tuple(
        tuple(f"{value:.6g}" for value in row[:MOST_COLUMNS]) for row in table.values[:SHOWN]
    )
