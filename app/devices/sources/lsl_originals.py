"""What an LSL stream gave, as it came: every channel in the stream's own format, LSL's own time stamps, the answers of its clock, its description.

In      what pylsl gives
Out     messages of kind `lsl_info` (the description, XML), `lsl_samples` and `lsl_time_correction`, each with the stream's uid
Source  Lab Streaming Layer, lsl_channel_format_t
"""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from handscope.estimators.numerics.typing import Array
from handscope.sessions.files.original_messages import Original

FORMATS = {1: "<f4", 2: "<f8", 4: "<i4", 5: "<i2", 6: "|i1", 7: "<i8"}  # of numbers
TEXT = 3


def info_message(uid: str, info: Any) -> Original:
    """The stream's description."""
    return Original({"kind": "lsl_info", "stream": uid}, str(info.as_xml()).encode())


def correction_message(uid: str, correction: float, at: float) -> Original:
    """What LSL's time_correction answered, s, at a moment of its local clock, s."""
    head = {"kind": "lsl_time_correction", "stream": uid, "correction": correction, "at": at}
    return Original(head)


def samples_message(
    uid: str, samples: Sequence[Sequence[Any]], t: Sequence[float], number: int
) -> Original:
    """Time stamps (n,), then values (n, channels); `number` is LSL's channel format."""
    dtype = FORMATS.get(number, "json")
    head = {"kind": "lsl_samples", "stream": uid, "samples": len(t), "dtype": dtype}
    head["channels"] = len(samples[0]) if len(samples) else 0
    times = np.asarray(t, "<f8").tobytes()
    if dtype == "json":
        return Original(head, times + json.dumps([list(row) for row in samples]).encode())
    return Original(head, times + np.asarray(samples, dtype).tobytes())


def samples_of(original: Original) -> tuple[Array, Any]:
    """Time stamps (n,) s of the stream's own clock, and values (n, channels): numbers in the stream's format, or lists of texts."""
    count, dtype = int(original.head["samples"]), str(original.head["dtype"])
    t = np.frombuffer(original.body, "<f8", count)
    rest = original.body[8 * count :]
    if dtype == "json":
        return t, json.loads(rest)
    return t, np.frombuffer(rest, dtype).reshape(count, int(original.head["channels"]))
