"""Lab Streaming Layer: raw samples, joint angles, fingertips and markers, each a stream that names its channels and units.

Time stamps are those of the samples on LSL's clock. Anybody in the network who looks for LSL streams can read them.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from handscope.app.live.outputs.pose_message import ANGLE_NAMES, TIP_NAMES, angle_table
from handscope.estimators.data.samples import COMPONENTS, UNITS, Block, Stream
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

MISSING = phrase("live.lsl_missing")


def is_installed() -> bool:
    """Whether pylsl and the library that it wraps are here."""
    try:
        import pylsl  # noqa: F401
    except (ImportError, RuntimeError):  # RuntimeError: the wrapper without its library
        return False
    return True


class LslOutlet:
    """The streams of one session; `now` gives the recording's time (s) of this moment, None before the first sample."""

    name = "lsl"

    def __init__(
        self, hand: Hand, source: str, method: str, now: Callable[[], float | None]
    ) -> None:
        try:
            import pylsl
        except (ImportError, RuntimeError):
            raise InputError(MISSING) from None
        self._lsl, self._hand, self._source, self._method = pylsl, hand, source, method
        self._now = now
        self._raw: dict[str, Any] = {}
        self._angles = self._outlet("angles", "MoCap", [(n, "rad", "angle") for n in ANGLE_NAMES])
        tips = [(n, "m", "position") for n in TIP_NAMES]
        self._tips = self._outlet("tips", "MoCap", tips)
        self._markers = self._outlet("markers", "Markers", [("marker", "", "event")], text=True)

    def send_samples(self, block: Block) -> None:
        if not len(block.t):
            return
        stream = block.stream
        if stream.name not in self._raw:
            self._raw[stream.name] = self._outlet(
                f"raw_{stream.name}", "IMU", _channels(stream), stream.rate
            )
        self._push(self._raw[stream.name], block.t, block.values.reshape(len(block.t), -1))

    def send_poses(self, rows: Trajectory) -> None:
        self._push(self._angles, rows.t, angle_table(rows))
        self._push(self._tips, rows.t, rows.tips.reshape(len(rows), -1))

    def send_marker(self, t: float, text: str) -> None:
        self._markers.push_sample([text], t + self._offset(t))

    def close(self) -> None:
        self._raw.clear()  # an outlet ends when nothing refers to it
        del self._angles, self._tips, self._markers

    def _push(self, outlet: Any, t: Array, values: Array) -> None:
        stamps = (t + self._offset(float(t[-1]))).tolist()
        outlet.push_chunk(np.ascontiguousarray(values, np.float32), stamps)

    def _offset(self, newest: float) -> float:
        """What takes the recording's time to LSL's clock, s; without the glove's clock the newest sample is of this moment."""
        now = self._now()
        return float(self._lsl.local_clock()) - (newest if now is None else now)

    def _outlet(
        self,
        what: str,
        kind: str,
        channels: Sequence[tuple[str, str, str]],
        rate: float = 0.0,
        text: bool = False,
    ) -> Any:
        lsl = self._lsl
        info = lsl.StreamInfo(
            f"handscope_{self._hand}_{what}",
            kind,
            len(channels),
            rate or lsl.IRREGULAR_RATE,
            lsl.cf_string if text else lsl.cf_float32,
            f"handscope-{self._source}-{what}",
        )
        about = info.desc()
        for key, value in (
            ("manufacturer", "Handscope"),
            ("hand", self._hand),
            ("method", self._method),
            ("notice", "research use; not a medical device"),
        ):
            about.append_child_value(key, value)
        listed = about.append_child("channels")
        for label, unit, quantity in channels:
            one = listed.append_child("channel")
            for key, value in (("label", label), ("unit", unit), ("type", quantity)):
                one.append_child_value(key, value)
        return lsl.StreamOutlet(info)


def _channels(stream: Stream) -> list[tuple[str, str, str]]:
    return [
        (f"{sensor}_{quantity}_{axis}", UNITS[quantity], quantity)
        for sensor in stream.sensors
        for quantity in stream.quantities
        for axis in COMPONENTS[quantity]
    ]
