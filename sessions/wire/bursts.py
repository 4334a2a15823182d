"""Samples as messages of the wire protocol: one burst while they are evenly spaced, and not too long."""

from collections.abc import Iterator

from handscope.estimators.numerics.typing import Array, Indices
from handscope.sessions.wire.messages import Samples, StreamInfo
from handscope.sessions.wire.sample_values import encode_values

NS = 1e9
BURST = 0.01  # s of samples in a frame
EVEN = 1e-6  # s by which samples of one frame may be off an even spacing


def bursts_of(t: Indices, values: Array, info: StreamInfo, sent: int = 0) -> Iterator[Samples]:
    """Bursts of samples at t (n,) ns with values (n, sensors, width); `sent` samples went before."""
    most = max(1, round(BURST * info.rate))
    first = 0
    for k in range(1, len(t) + 1):
        even = k < len(t) and abs(t[k] - t[first] - (k - first) / info.rate * NS) < EVEN * NS
        if not even or k - first == most:
            data = encode_values(values[first:k], info)
            index = (sent + first) % 2**32
            yield Samples(info.stream, index, int(t[first]), int(t[k - 1]), k - first, data)
            first = k
