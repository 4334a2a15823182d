"""Tab-separated tables and JSON sidecars of BIDS, with errors that name the file and the line."""

import io
import json
from collections.abc import Iterable
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.numerics.typing import Array

MISSING = "n/a"
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def json_object(data: bytes, name: str) -> dict[str, Any]:
    """A sidecar's object."""
    try:
        value = json.loads(data.decode("utf-8-sig"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as problem:
        raise InputError(
            f"{name} is not valid JSON ({problem}); mend it there or export it again"
        ) from None
    if not isinstance(value, dict):
        raise InputError(f'{name} does not hold a JSON object; it begins with {{"TaskName": ...')
    return value


def rows(data: bytes, name: str, required: tuple[str, ...]) -> dict[int, dict[str, str]]:
    """Rows of a table with a header by the number of their line; InputError where a required column is missing or a line has another number of columns."""
    try:
        lines = data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"{name} is not UTF-8 text; save it as UTF-8") from None
    if not lines:
        raise InputError(f"{name} is empty; its first line names the columns {', '.join(required)}")
    header = [column.strip() for column in lines[0].split("\t")]
    absent = [column for column in required if column not in header]
    if absent:
        raise InputError(
            f"{name} has no column {', '.join(absent)}; its columns are {', '.join(header)}"
        )
    table = {}
    for number, line in enumerate(lines[1:], start=2):
        if line.strip():
            cells = [cell.strip() for cell in line.split("\t")]
            if len(cells) != len(header):
                raise InputError(
                    f"{name}, line {number}: {len(cells)} columns instead of {len(header)}"
                )
            table[number] = dict(zip(header, cells))
    return table


def numbers(text: Iterable[bytes], name: str, columns: int) -> Array:
    """A table without header as (n, columns) float64; n/a and NaN are NaN. Read piece by piece: as text it is several times as large."""
    parts, left, line = [np.empty((0, columns))], b"", 1
    for piece in text:
        left = (left + piece).removeprefix(BYTE_ORDER_MARK) if line == 1 else left + piece
        end = left.rstrip().rfind(b"\n")
        if end >= 0:
            parts.append(_parsed(left[:end], name, columns, line))
            left, line = left[end + 1 :], line + left.count(b"\n", 0, end) + 1
    if left := left.rstrip():
        parts.append(_parsed(left, name, columns, line))
    return np.concatenate(parts)


def _parsed(text: bytes, name: str, columns: int, line: int) -> Array:
    """Whole lines of a table, the first of them with number `line`."""
    text = text.replace(b"n/a", b"nan")
    if (
        b"\n\n" in text or b"\n\r" in text or text[:1] in b"\r\n"
    ):  # an empty line would move all samples behind it
        raise InputError(_first_fault(text, name, columns, line))
    try:
        table: Array = np.loadtxt(
            io.BytesIO(text), delimiter="\t", ndmin=2, comments=None, encoding="utf-8"
        )
    except (ValueError, UnicodeDecodeError):
        raise InputError(_first_fault(text, name, columns, line)) from None
    if table.shape[1] != columns:
        everywhere = f"{name} has {table.shape[1]} columns, its channels.tsv names {columns}"
        raise InputError(everywhere if line == 1 else _first_fault(text, name, columns, line))
    table[np.isinf(table)] = np.nan
    return table


def _first_fault(text: bytes, name: str, columns: int, first: int) -> str:
    for number, line in enumerate(text.splitlines(), start=first):
        cells = line.split(b"\t")
        if len(cells) != columns:
            return f"{name}, line {number}: {len(cells)} columns, its channels.tsv names {columns}"
        for column, cell in enumerate(cells, start=1):
            try:
                float(cell)
            except ValueError:
                return f"{name}, line {number}, column {column}: {cell.decode(errors='replace')[:40]!r} is not a number (missing samples are n/a)"
    return f"{name} cannot be read as a table of numbers"
