"""The checksum of a recording is of all its files, and costs no second reading of the large ones."""

import hashlib
import itertools
from collections.abc import Iterator
from functools import partial

from handscope.sessions.motion_bids.files import Files, whole, with_checksum

CONTENTS = {"b.tsv": [b"1", b"2"], "a.json": [b"{}"], "c.tsv": [], "d.tsv": [b"3\n"]}
NAMES = sorted(CONTENTS)
EXPECTED = hashlib.sha256(
    b"".join(name.encode() + b"\0" + b"".join(CONTENTS[name]) for name in NAMES)
).hexdigest()


def counted(opened: list[str]) -> tuple[Files, list[str]]:
    def read(name: str) -> Iterator[bytes]:
        opened.append(name)
        yield from CONTENTS[name]

    return {name: partial(read, name) for name in CONTENTS}, opened


def test_the_checksum_does_not_depend_on_what_was_read_before_and_how_far() -> None:
    for first, second, left in itertools.permutations(NAMES, 3):
        files, checksum = with_checksum(counted([])[0])
        next(iter(files[left]()), None)
        assert whole(files[first]) == b"".join(CONTENTS[first])
        assert whole(files[second]) == b"".join(CONTENTS[second])
        assert checksum() == EXPECTED


def test_files_read_in_order_of_name_are_opened_once() -> None:
    counts, opened = counted([])
    files, checksum = with_checksum(counts)
    for name in NAMES[1:3]:
        whole(files[name])
    assert checksum() == EXPECTED
    assert opened == NAMES
