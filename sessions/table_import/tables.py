"""A logger's table as numbers by column: text, Excel, Parquet, MATLAB, or a maker's own format.

In      a file, how its text is laid out
Out     names and values (rows, columns), NaN where a cell is empty
"""

import csv
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.messages.system import describe
from handscope.sessions.table_import.column_map import TableLayout
from handscope.sessions.table_import.number_columns import NumberColumns, text_lines

MOST_BYTES = 2**30
LARGEST = 1e30  # beyond it a cell is no reading


def read_table(path: Path, layout: TableLayout) -> NumberColumns:
    """The table; a cell that is no number matters, and is named, when its column is asked for."""
    try:
        size = path.stat().st_size
    except OSError as problem:
        raise InputError("file.cannot_read", name=str(path), problem=describe(problem)) from None
    if size > MOST_BYTES:
        raise InputError("import.too_large", name=path.name, size=size / 2**30)
    return READERS.get(path.suffix.lower(), _read_text)(path, layout)


def _read_text(path: Path, layout: TableLayout) -> NumberColumns:
    lines = text_lines(path)[layout.skip :]
    rows = csv.reader(lines, delimiter=layout.delimiter)
    names: tuple[str, ...] = ()
    first = layout.skip + layout.header + 1
    try:
        if layout.header:
            names = tuple(cell.strip() for cell in next(rows, []))
        faults: dict[int, str] = {}
        values = list(_numbers(rows, names, first, path.name, layout.decimal, faults))
    except csv.Error as problem:
        raise InputError("import.not_a_table", name=path.name, problem=str(problem)) from None
    if not values:
        raise InputError("import.no_rows", name=path.name, first=first - 1)
    return NumberColumns(path.name, names, np.array(values), faults)


def _numbers(
    rows: Iterator[list[str]],
    names: Sequence[str],
    first: int,
    file: str,
    decimal: str,
    faults: dict[int, str],
) -> Iterator[list[float]]:
    """The rows; what is wrong with a column is put into `faults`: it matters only where somebody maps it."""
    width = len(names)
    for number, row in enumerate(rows, start=first):
        if not any(cell.strip() for cell in row):
            continue
        while len(row) > width > 0 and not row[-1].strip():
            row.pop()  # a delimiter at the end of the line
        width = width or len(row)
        if len(row) != width:
            raise InputError(
                "import.row_length", file=file, number=number, row=len(row), width=width
            )
        numbers = [_number(cell.strip(), decimal) for cell in row]
        if number == first and names and all(_is_word(cell) for cell in row):
            continue  # units below the names
        for k, value in enumerate(numbers):
            if value is None:
                column = names[k] if names else k
                faults.setdefault(
                    k,
                    f"{file}, line {number}, column {column}: {row[k].strip()[:40]!r} is not a number; is the decimal mark {decimal!r}?",
                )
        yield [float("nan") if value is None else value for value in numbers]


def _is_word(cell: str) -> bool:
    text = cell.strip()
    return not text or (not (text[0].isdigit() or text[0] in "+-.,") and text.lower() != "nan")


def _number(text: str, decimal: str) -> float | None:
    """A cell as a number; NaN where it is empty or words, None where it only looks like a number."""
    try:
        if decimal != "." and "." in text:
            raise ValueError  # 1.234 would be a thousand, or one and a bit
        value = float(text.replace(decimal, "."))
        return value if abs(value) < LARGEST else float("nan")
    except ValueError:
        is_like = any(c.isdigit() for c in text) and not any(c.isalpha() for c in text)
        return None if is_like else float("nan")


def _frame_reader(function: str, package: str) -> Callable[[Path, TableLayout], NumberColumns]:
    def read(path: Path, layout: TableLayout) -> NumberColumns:
        try:
            pandas = import_module("pandas")
            import_module(package)
        except ImportError:
            raise InputError(
                "import.package_missing", suffix=path.suffix, package=package
            ) from None
        options: Mapping[str, Any] = (
            {"header": 0 if layout.header else None, "skiprows": layout.skip}
            if function == "read_excel"
            else {}
        )
        try:
            frame = getattr(pandas, function)(path, **options)
        except Exception as problem:  # whatever the library raises on a foreign file
            raise InputError("file.cannot_read", name=path.name, problem=str(problem)) from None
        numbers = frame.apply(pandas.to_numeric, errors="coerce").to_numpy(dtype=float)
        return NumberColumns(path.name, tuple(str(c).strip() for c in frame.columns), numbers)

    return read


def _read_matlab(path: Path, layout: TableLayout) -> NumberColumns:
    from scipy.io import loadmat

    del layout
    try:
        found = loadmat(path, simplify_cells=True)
    except Exception as problem:  # whatever a foreign file raises
        raise InputError("import.not_matlab", name=path.name, problem=str(problem)) from None
    names, columns = [], []
    for name, value in _flatten("", found):
        array = np.asarray(value)
        if array.dtype.kind in "fiu" and array.ndim in (1, 2) and array.size > 1:
            wide = array[:, None] if array.ndim == 1 else array
            several = wide.shape[1] > 1
            names += [f"{name}_{k}" if several else name for k in range(wide.shape[1])]
            columns += list(wide.T.astype(float))
    rows = max((len(c) for c in columns), key=[len(c) for c in columns].count, default=0)
    kept = [(n, c) for n, c in zip(names, columns) if len(c) == rows]
    if not kept:
        raise InputError("import.no_columns", name=path.name)
    return NumberColumns(
        path.name, tuple(n for n, _ in kept), np.column_stack([c for _, c in kept])
    )


def _flatten(prefix: str, value: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, inner in value.items():
        if name.startswith("__"):
            continue
        if isinstance(inner, dict):
            yield from _flatten(f"{prefix}{name}.", inner)
        else:
            yield f"{prefix}{name}", inner


def _reader_of(module: str, function: str) -> Callable[[Path, TableLayout], NumberColumns]:
    """A reader of a maker's format, loaded when a file asks for it."""

    def read(path: Path, layout: TableLayout) -> NumberColumns:
        del layout
        found: Callable[[Path], NumberColumns] = getattr(
            import_module(f"handscope.sessions.table_import.formats.{module}"), function
        )
        return found(path)

    return read


READERS: Mapping[str, Callable[[Path, TableLayout], NumberColumns]] = {
    ".xlsx": _frame_reader("read_excel", "openpyxl"),
    ".parquet": _frame_reader("read_parquet", "pyarrow"),
    ".mat": _read_matlab,
    ".mvnx": _reader_of("mvnx", "read_mvnx"),
    ".bvh": _reader_of("bvh", "read_bvh"),
    ".h5": _reader_of("apdm", "read_apdm"),
    ".hdf5": _reader_of("apdm", "read_apdm"),
    ".xdf": _reader_of("xdf", "read_xdf"),
}
