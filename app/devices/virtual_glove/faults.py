"""What can go wrong between a glove and its host, on purpose: frames lost, repeated, damaged, late; a strip pulled; the cable pulled."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option

HICCUP = 3.0  # s between two delayed bursts


@dataclass(frozen=True, kw_only=True)
class FaultParams:
    """Shares of frames lost, repeated or damaged, and their delay in s."""

    loss: float = option(0.0, "", "share of frames that are lost", "fault")
    repeat: float = option(0.0, "", "share of frames that are sent twice", "fault")
    corrupt: float = option(0.0, "", "share of frames with a flipped bit", "fault")
    garbage: float = option(0.0, "", "share of frames followed by random bytes", "fault")
    delay: float = option(
        0.0, "s", "length of a hold-up every 3 s, after which everything comes at once", "fault"
    )


@dataclass
class Faults:
    """Feed the frames of every moment in order; gives the bytes that reach the host."""

    params: FaultParams
    rng: np.random.Generator
    _held: bytes = b""

    def pass_on(self, frames: Sequence[bytes], t: float) -> bytes:
        """Bytes for the host at time t."""
        sent = b"".join(self._worn(frame) for frame in frames)
        if self.params.delay > 0 and t % HICCUP < self.params.delay:
            self._held += sent
            return b""
        sent, self._held = self._held + sent, b""
        return sent

    def _worn(self, frame: bytes) -> bytes:
        p, draw = self.params, self.rng.random(4)
        if draw[0] < p.loss:
            return b""
        if draw[1] < p.corrupt:
            broken = bytearray(frame)
            broken[int(self.rng.integers(len(frame) - 1))] ^= 1 << int(self.rng.integers(8))
            frame = bytes(broken)
        if draw[2] < p.repeat:
            frame = frame + frame
        if draw[3] < p.garbage:
            frame += self.rng.bytes(int(self.rng.integers(1, 60)))
        return frame
