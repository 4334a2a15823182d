"""Tab-separated tables and JSON sidecars of BIDS, with errors that name the file and the line."""

import io
import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import orjson

from handscope.estimators.errors import InputError
from handscope.estimators.messages import Message, Value
from handscope.estimators.numerics.typing import Array

MISSING = "n/a"
NUMERALS = b"0123456789+-.eE\t\n\r n/a"  # of which tables are made as a rule
NO_SEPARATORS = NUMERALS.translate(None, b"\t\n")
TO_COMMAS = bytes.maketrans(b"\t\n", b",,")
BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def json_object(data: bytes, name: str) -> dict[str, Any]:
    """A sidecar's object."""
    try:
        value = json.loads(data.decode("utf-8-sig"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as problem:
        raise InputError("motion_bids.not_json", name=name, problem=str(problem)) from None
    if not isinstance(value, dict):
        raise InputError("motion_bids.not_a_json_object", name=name, example='{"TaskName": ...')
    return value


def rows(data: bytes, name: str, required: tuple[str, ...]) -> dict[int, dict[str, str]]:
    """Rows of a table with a header by the number of their line; InputError where a required column is missing or a line has another number of columns."""
    try:
        lines = data.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise InputError("motion_bids.not_utf8", name=name) from None
    if not lines:
        raise InputError("motion_bids.empty_table", name=name, columns=", ".join(required))
    header = [column.strip() for column in lines[0].split("\t")]
    absent = [column for column in required if column not in header]
    if absent:
        raise InputError(
            "motion_bids.column_missing",
            name=name,
            missing=", ".join(absent),
            columns=", ".join(header),
        )
    table = {}
    for number, line in enumerate(lines[1:], start=2):
        if line.strip():
            cells = [cell.strip() for cell in line.split("\t")]
            if len(cells) != len(header):
                raise InputError(
                    "motion_bids.row_length",
                    name=name,
                    line=number,
                    found=len(cells),
                    count=len(header),
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
            parts.append(_parse_lines(left[:end], name, columns, line))
            left, line = left[end + 1 :], line + left.count(b"\n", 0, end) + 1
    if left := left.rstrip():
        parts.append(_parse_lines(left, name, columns, line))
    return np.concatenate(parts)


def _parse_lines(text: bytes, name: str, columns: int, line: int) -> Array:
    """Whole lines of a table, the first of them with number `line`."""
    table = _parsed_as_json(text)
    if table is None:
        table = _parsed_as_text(text, name, columns, line)
    if table.shape[1] != columns:
        if line > 1:
            raise InputError(_first_fault(text, name, columns, line))
        raise InputError("motion_bids.table_width", name=name, found=table.shape[1], count=columns)
    table[np.isinf(table)] = np.nan
    return table


def _parsed_as_text(text: bytes, name: str, columns: int, line: int) -> Array:
    text = text.replace(b"n/a", b"nan")
    if (
        b"\n\n" in text or b"\n\r" in text or text[:1] in b"\r\n" or text.endswith(b"\n")
    ):  # an empty line would move all samples behind it
        raise InputError(_first_fault(text, name, columns, line))
    try:
        table: Array = np.loadtxt(
            io.BytesIO(text), delimiter="\t", ndmin=2, comments=None, encoding="utf-8"
        )
    except (ValueError, UnicodeDecodeError):
        raise InputError(_first_fault(text, name, columns, line)) from None
    return table


def _parsed_as_json(text: bytes) -> Array | None:
    """The same numbers, read many times faster; None where a number is written as JSON does not, or a row has another length."""
    if text.translate(None, NUMERALS):
        return None
    separators = text.translate(None, NO_SEPARATORS) + b"\n"
    width, height = separators.index(b"\n") + 1, separators.count(b"\n")
    if separators != (b"\t" * (width - 1) + b"\n") * height:
        return None
    listed = text.translate(TO_COMMAS)
    if b"n" in listed:
        listed = listed.replace(b"n/a", b"null")
    try:
        table = np.array(orjson.loads(b"[" + listed + b"]"), dtype=float)  # null is NaN
    except (orjson.JSONDecodeError, ValueError):
        return None
    return table.reshape(height, width) if len(table) == height * width else None


def _first_fault(text: bytes, name: str, columns: int, first: int) -> Message:
    values: dict[str, Value]
    for number, line in enumerate(text.split(b"\n"), start=first):
        cells = line.split(b"\t")
        if len(cells) != columns:
            values = {"name": name, "line": number, "found": len(cells), "count": columns}
            return Message("motion_bids.sample_width", values, "fault")
        for column, cell in enumerate(cells, start=1):
            try:
                float(cell)
            except ValueError:
                shown = cell.decode(errors="replace")[:40]
                values = {"name": name, "line": number, "column": column, "cell": shown}
                return Message("motion_bids.sample_not_a_number", values, "fault")
    return Message("motion_bids.not_a_table", {"name": name}, "fault")
