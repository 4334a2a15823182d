"""Tables of numbers as tab-separated text, made piece by piece so that a long recording never stands in memory as text."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import orjson

from handscope.estimators.numerics.typing import Array

SLICE = 2000  # rows made at a time
TAB, NEWLINE, COMMA = b"\t\n,"


@dataclass(frozen=True)
class NumberTable:
    """Columns of equal length side by side; iterating gives the text in pieces, `bytes` the whole.

    Every number has just the digits that bring it back exactly; NaN is n/a.
    """

    parts: tuple[Array, ...]  # (n,) or (n, columns) each

    def __iter__(self) -> Iterator[bytes]:
        for start in range(0, len(self.parts[0]), SLICE):
            rows = np.column_stack([part[start : start + SLICE] for part in self.parts])
            listed = orjson.dumps(rows.ravel(), option=orjson.OPT_SERIALIZE_NUMPY)
            text = np.frombuffer(bytearray(listed), np.uint8)[1:]
            text[-1] = NEWLINE  # in place of the list's end
            commas = np.flatnonzero(text == COMMA)
            text[commas] = TAB
            text[commas[rows.shape[1] - 1 :: rows.shape[1]]] = NEWLINE
            whole = text.tobytes()
            yield whole if np.isfinite(rows).all() else whole.replace(b"null", b"n/a")

    def __bytes__(self) -> bytes:
        return b"".join(self)


Data = bytes | NumberTable  # what a file to be written holds


def pieces(data: Data) -> Iterator[bytes]:
    """The bytes of a file, in pieces."""
    if isinstance(data, bytes):
        yield data
    else:
        yield from data
