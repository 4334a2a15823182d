"""Columns of numbers with names, and the lines of a text file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from handscope.estimators.errors import InputError
from handscope.estimators.numerics.typing import Array
from handscope.sessions.table_import.column_map import Column, nearest


@dataclass(frozen=True)
class NumberColumns:
    """Columns of numbers; `names` is empty where the table has no header."""

    file: str
    names: tuple[str, ...]
    values: Array  # (rows, columns), NaN where a cell is no number
    # of a column the first cell that is no number but looks like one
    faults: Mapping[int, str] = field(default_factory=dict)

    def column(self, wanted: Column) -> Array:
        """A column (rows,) by name, or by number from 0; InputError where it is not there."""
        if isinstance(wanted, int):
            if not 0 <= wanted < self.values.shape[1]:
                raise InputError(
                    "import.column_number_missing",
                    file=self.file,
                    wanted=wanted,
                    shape=self.values.shape[1],
                )
            return self._whole(wanted)
        if self.names.count(wanted) != 1:
            known = nearest(wanted, self.names) or "none: it has no header, give numbers from 0"
            many = "no" if wanted not in self.names else "more than one"
            raise InputError(
                "import.column_not_unique", file=self.file, many=many, wanted=wanted, known=known
            )
        return self._whole(self.names.index(wanted))

    def _whole(self, k: int) -> Array:
        if k in self.faults:
            raise InputError(self.faults[k])
        return np.asarray(self.values[:, k])


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
    raise InputError("import.unknown_format", name=path.name)
