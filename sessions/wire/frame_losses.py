"""Where frames were lost: in the glove, whose bytes nobody took, or on the wire behind it.

In      the glove's own count of dropped frames (Status.overruns), and the numbers that are missing among the frames that came
Out     FrameLosses since the recording began
Source  docs/wire-protocol.md: a frame that the glove drops has taken its number, so it is missing, too
Limits  what is missing since the newest Status (one a second) is not attributed yet; bytes that this machine's serial
        driver dropped before they were read count as lost on the wire
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class FrameLosses:
    """Frames by where they were lost."""

    glove: int = 0  # dropped because the host did not take the bytes
    wire: int = 0  # sent, and did not come whole
    open: int = 0  # missing since the newest Status

    @property
    def total(self) -> int:
        return self.glove + self.wire + self.open


@dataclass
class LossAttribution:
    """Attributes missing frames whenever the glove sends its Status."""

    _glove: int = 0
    _wire: int = 0
    _missing: int = 0  # at the newest Status
    _overruns: int | None = None  # of the newest Status; None before the first one

    def update(self, overruns: int, missing: int) -> None:
        """Take a Status and the count of missing frames at that moment; the first may count drops of before."""
        new = missing - self._missing
        if self._overruns is None:
            dropped = min(overruns, new)
        elif overruns >= self._overruns:
            dropped = overruns - self._overruns
        else:  # the glove began again
            dropped = overruns
        self._glove += dropped
        self._wire += max(0, new - dropped)
        self._overruns, self._missing = overruns, missing

    def losses(self, missing: int) -> FrameLosses:
        """What is known now, with the count of missing frames."""
        return FrameLosses(self._glove, self._wire, missing - self._missing)
