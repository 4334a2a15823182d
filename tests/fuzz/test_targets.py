"""A short, always equal run of what `make fuzz` does for as long as one likes; and everything that was ever found."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fuzz.targets import TARGETS, run, seeds, writes_within

FOUND = sorted((Path(__file__).parent / "found").glob("*/*"))
Change = Callable[[bytes], bytes]
TELLING = [
    b"\0",
    b"\xff",
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\0" * 8,
    b"\xff" * 8,
    b"NaN",
    b"1e999",
    b"-1",
    b"../",
    b"\t",
    b"\n",
    b'"',
    b"n/a",
]


@st.composite
def changes(draw: st.DrawFn) -> Change:
    """Overwrite, insert, take out, repeat or cut at a place that is a share of the whole."""
    where, kind = (
        draw(st.floats(0, 1)),
        draw(st.sampled_from(("over", "into", "out", "again", "cut"))),
    )
    piece, length = (
        draw(st.one_of(st.sampled_from(TELLING), st.binary(min_size=1, max_size=12))),
        draw(st.integers(1, 200)),
    )

    def change(data: bytes) -> bytes:
        k = int(where * len(data))
        match kind:
            case "over":
                return data[:k] + piece + data[k + len(piece) :]
            case "into":
                return data[:k] + piece + data[k:]
            case "out":
                return data[:k] + data[k + length :]
            case "again":
                return data[: k + length] + data[k:]
        return data[:k]

    return change


@pytest.mark.parametrize("name", TARGETS)
def test_good_input_is_taken(name: str) -> None:
    assert all(run(name, seed) for seed in seeds(name))


@pytest.mark.parametrize("name", TARGETS)
@given(data=st.data())
def test_bad_input_is_taken_or_refused_in_words(name: str, data: st.DataObject) -> None:
    given_ = (
        data.draw(st.sampled_from(seeds(name)))
        if data.draw(st.integers(0, 9))
        else data.draw(st.binary(max_size=400))
    )
    for change in data.draw(st.lists(changes(), min_size=1, max_size=4)):
        given_ = change(given_)
    run(name, given_)


@pytest.mark.parametrize("path", FOUND, ids=lambda p: f"{p.parent.name}-{p.name}")
def test_what_was_found_stays_mended(path: Path) -> None:
    run(path.parent.name, path.read_bytes())


def test_a_file_written_elsewhere_is_noticed(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    with writes_within(tmp_path / "in"):
        (tmp_path / "in" / "a").write_bytes(b"")
    with pytest.raises(AssertionError, match="outside its folder"), writes_within(tmp_path / "in"):
        (tmp_path / "b").write_bytes(b"")
