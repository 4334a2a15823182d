"""Numbers of a table: however a program writes them they are read alike, and what is no number is refused with its place."""

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.sessions.motion_bids.tables import numbers

WRITTEN = {
    "as JSON writes them": b"1.5\t-2e-3\n0\tn/a\n",
    "with signs": b"+1.5\t-2E-03\n-0.0\tn/a\n",
    "without zeros": b"1.5\t-.002\n0.\tNaN\n",
    "as Windows ends lines": b"1.5\t-0.002\r\n0\tn/a\r\n",
    "with blanks": b" 1.5\t-0.002 \n0\t n/a\n",
    "infinite": b"1.5\t-0.002\n0\tinf\n",
}


@pytest.mark.parametrize("text", WRITTEN.values(), ids=WRITTEN)
def test_numbers_are_read_however_they_are_written(text: bytes) -> None:
    np.testing.assert_array_equal(numbers([text], "motion.tsv", 2), [[1.5, -0.002], [0.0, np.nan]])


def test_every_bit_of_a_number_is_read() -> None:
    values = np.random.default_rng(1).standard_normal((50, 3)) * 10.0 ** np.arange(-5, 10, 5)
    text = "\n".join("\t".join(map(repr, row)) for row in values.tolist())
    np.testing.assert_array_equal(numbers([text.encode()], "motion.tsv", 3), values)


@pytest.mark.parametrize(
    "text", [b'1\t"2"\n', b"1\ttrue\n", b"1\tnull\n", b"1\t[2]\n", b"1\t2,3\n", b"1\t2\n\n3\t4\n"]
)
def test_what_json_takes_for_a_value_is_no_number(text: bytes) -> None:
    with pytest.raises(InputError, match=r"motion.tsv, line [12]"):
        numbers([text], "motion.tsv", 2)
