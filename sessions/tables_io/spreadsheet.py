"""CSV and TSV for spreadsheets: text that one would take for a formula gets a leading apostrophe (OWASP, CSV injection).

Number tables that programs read, such as Motion-BIDS, are not written here: there a leading minus is a number.
"""

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any

FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "\uff1d", "\uff0b", "\uff0d", "\uff20")
# a formula behind a mark
INNER = re.compile("([,;\t\r\n]\\s*)(?=[=+@\uff1d\uff0b\uff0d\uff20]|-(?![\\d.]))")


def write_table(
    header: Sequence[str],
    rows: Iterable[Sequence[Any]],
    preamble: Iterable[str] = (),
    delimiter: str = ",",
) -> bytes:
    """UTF-8: comment lines (#), the header, a line a row. Floats are written whole, None is empty."""
    buffer = io.StringIO()
    for line in preamble:
        buffer.write(_comment(line))
    writer = csv.writer(buffer, lineterminator="\n", delimiter=delimiter)
    writer.writerow([cell(name) for name in header])
    writer.writerows([cell(value) for value in row] for row in rows)
    return buffer.getvalue().encode()


def cell(value: Any) -> Any:
    """A value as it stands in a table."""
    if value is None:
        return ""
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else ""
    return neutralise(value) if isinstance(value, str) else value


def neutralise(text: str) -> str:
    """Text that no spreadsheet runs, whichever mark it splits lines at; what is a number stays one."""
    text = INNER.sub(r"\1'", text)
    if not text.lstrip(" ").startswith(FORMULA):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def _comment(line: str) -> str:
    """A comment on one line. It begins no formula, as its first character is #; nor do the cells that a spreadsheet splits it into."""
    return "# " + INNER.sub(r"\1'", " ".join(line.split())) + "\n"
