"""Consistent-overhead byte stuffing undone, compiled: the package cobs has no machine code for every platform, and a recording has a million frames.

Source  Cheshire and Baker 1999; `cobs.decode` of the package cobs says the same of every frame (tests/sessions/wire/test_framing.py)
"""

import numpy as np

from handscope.estimators.numerics.jit import looped
from handscope.estimators.numerics.typing import Array


def unstuff(frame: bytes) -> bytes | None:
    """What was stuffed, of a frame without its zero byte at the end; None where the frame cannot be."""
    body = np.empty(len(frame), np.uint8)
    length = _unstuff(np.frombuffer(frame, np.uint8), body)
    return body[:length].tobytes() if length >= 0 else None


@looped
def _unstuff(frame: Array, body: Array) -> int:
    """Fill `body` (n,) from `frame` (n,); gives the bytes filled, -1 where a zero stands in it or a block goes beyond its end."""
    length, k = 0, 0
    while k < len(frame):
        block = frame[k]
        if block == 0 or k + block > len(frame):
            return -1
        for j in range(k + 1, k + block):
            if frame[j] == 0:
                return -1
            body[length] = frame[j]
            length += 1
        k += block
        if block < 255 and k < len(frame):
            body[length] = 0
            length += 1
    return length
