"""The program inside viser's page: packed by zstd and written in base 88, as the page's own first script unpacks it.

The page's policy names it by its checksum, so that no other inline script runs.
"""

import re

import numpy as np
import zstandard

_DIGITS = (
    "!#$%()*+,-./0123456789:;=?@ABCDEFGHIJKLMNOPQRSTUVWXYZ[\\]^_abcdefghijklmnopqrstuvwxyz{|}~"
)
_PACKED = re.compile(r'<script data-p="([^"]*)" data-ss="(\d+)" data-cs="(\d+)">')


def program(page: str) -> bytes:
    """The script that the page puts into itself."""
    match = _PACKED.search(page)
    assert match is not None, "viser packs its page in another way"
    packed, styles, length = match[1], int(match[2]), int(match[3])
    unpacked = zstandard.ZstdDecompressor().decompress(
        _bytes(packed), max_output_size=styles + length
    )
    return unpacked[styles : styles + length]


def _bytes(text: str) -> bytes:
    """Five digits are four bytes, the first of both the greatest; r digits at the end are r - 1 bytes."""
    digit = np.zeros(128, np.uint64)
    digit[[ord(c) for c in _DIGITS]] = np.arange(len(_DIGITS))
    digits = digit[np.frombuffer(text.encode("ascii"), np.uint8)]
    whole = len(digits) // 5 * 5
    numbers = digits[:whole].reshape(-1, 5) @ (88 ** np.arange(4, -1, -1)).astype(np.uint64)
    rest = 0
    for one in digits[whole:]:
        rest = 88 * rest + int(one)
    return numbers.astype(">u4").tobytes() + rest.to_bytes(max(0, len(digits) - whole - 1), "big")
