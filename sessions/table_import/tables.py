"""A logger's table as numbers by column: text, Excel, Parquet or MATLAB.

In      a file, how its text is laid out
Out     names and values (rows, columns), NaN where a cell is empty
"""

import csv
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.numerics.typing import Array
from handscope.sessions.table_import.column_map import Column, TableLayout

MOST_BYTES = 2**30
LARGEST = 1e30  # beyond it a cell is no reading


@dataclass(frozen=True)
class NumberColumns:
    """Columns of numbers; `names` is empty where the table has no header."""

    file: str
    names: tuple[str, ...]
    values: Array  # (rows, columns), NaN where a cell is no number
    faults: Mapping[int, str] = field(
        default_factory=dict
    )  # of a column the first cell that is no number but looks like one

    def column(self, wanted: Column) -> Array:
        """A column (rows,) by name, or by number from 0; InputError where it is not there."""
        if isinstance(wanted, int):
            if not 0 <= wanted < self.values.shape[1]:
                raise InputError(
                    "import.has_no_column",
                    file=self.file,
                    wanted=wanted,
                    shape=self.values.shape[1],
                )
            return self._whole(wanted)
        if self.names.count(wanted) != 1:
            known = ", ".join(self.names[:40]) or "none: it has no header, give numbers from 0"
            many = "no" if wanted not in self.names else "more than one"
            raise InputError(
                "import.has_column", file=self.file, many=many, wanted=wanted, known=known
            )
        return self._whole(self.names.index(wanted))

    def _whole(self, k: int) -> Array:
        if k in self.faults:
            raise InputError(self.faults[k])
        return np.asarray(self.values[:, k])


def read_table(path: Path, layout: TableLayout) -> NumberColumns:
    """The table; a cell that is no number matters, and is named, when its column is asked for."""
    try:
        size = path.stat().st_size
    except OSError as problem:
        raise InputError(
            "file.cannot_read", name=str(path), problem=str(problem.strerror)
        ) from None
    if size > MOST_BYTES:
        raise InputError("import.too_large", name=path.name, size=size / 2**30)
    return READERS.get(path.suffix.lower(), _read_text)(path, layout)


def text_lines(path: Path) -> list[str]:
    """The lines of a text file; InputError where it is none."""
    data = path.read_bytes()
    for encoding in (
        ("utf-8-sig", "utf-16")
        if data[:2] in (b"\xff\xfe", b"\xfe\xff")
        else (
            "utf-8-sig",
            "latin-1",
        )
    ):
        try:
            text = data.decode(encoding)
        except UnicodeError:
            continue
        if "\0" in text:
            break
        return text.splitlines()
    raise InputError("import.no_text_csv_tsv", name=path.name)


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
        raise InputError("import.cannot_read_table", name=path.name, problem=str(problem)) from None
    if not values:
        raise InputError("import.has_no_rows_numbers", name=path.name, first=first - 1)
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
        for k, value in enumerate(numbers):
            if value is None:
                column = names[k] if names else k
                faults.setdefault(
                    k,
                    f"{file}, line {number}, column {column}: {row[k].strip()[:40]!r} is not a number; is the decimal mark {decimal!r}?",
                )
        yield [float("nan") if value is None else value for value in numbers]


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
                "import.files_need_pandas", suffix=path.suffix, package=package
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
        raise InputError(
            "import.cannot_read_matlab_5", name=path.name, problem=str(problem)
        ) from None
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
        raise InputError("import.holds_no_columns_numbers", name=path.name)
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


READERS: Mapping[str, Callable[[Path, TableLayout], NumberColumns]] = {
    ".xlsx": _frame_reader("read_excel", "openpyxl"),
    ".parquet": _frame_reader("read_parquet", "pyarrow"),
    ".mat": _read_matlab,
}
