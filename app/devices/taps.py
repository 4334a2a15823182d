"""Which sensor is where: the one that shakes most while somebody taps a place of the hand.

In      blocks of samples as they come, in the glove's thread
Out     the sensor with the largest step of its acceleration since `forget`
Limits  a tap shakes the neighbours, too: the hardest step is taken as that of the place
"""

import threading
from collections.abc import Mapping

import numpy as np

from handscope.estimators.data.samples import ACC, Block
from handscope.estimators.hand.anatomy import CHAINS, SEGMENT
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

TAP = 4.0  # m/s^2 from one sample to the next that are a tap
PLACES: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "thumb": (phrase("doctor.tap_thumb"), CHAINS["thumb"]),
    "index": (phrase("doctor.tap_index"), CHAINS["index"]),
    "middle": (phrase("doctor.tap_middle"), CHAINS["middle"]),
    "ring": (phrase("doctor.tap_ring"), CHAINS["ring"]),
    "little": (phrase("doctor.tap_little"), CHAINS["little"]),
    "hand": (phrase("doctor.tap_hand"), ("hand",)),
    "forearm": (phrase("doctor.tap_forearm"), ("forearm",)),
}  # by place: what to ask for, and the sensors that may shake most


class ShakenSensors:
    """Largest step of each inertial sensor's acceleration (m/s^2); written by the glove's thread, read by another."""

    def __init__(self) -> None:
        self._steps: dict[str, float] = {}
        self._last: dict[str, Array] = {}
        self._lock = threading.Lock()

    def take(self, blocks: list[Block]) -> None:
        """New samples of the glove."""
        with self._lock:
            for block in blocks:
                if ACC in block.stream.quantities and len(block.t):
                    for k, sensor in enumerate(block.stream.sensors):
                        self._take_one(sensor, block.of(ACC)[:, k])

    def _take_one(self, sensor: str, acc: Array) -> None:
        if sensor not in SEGMENT:
            return
        before = self._last.get(sensor, acc[0])
        steps = np.linalg.norm(np.diff(acc, axis=0, prepend=before[None]), axis=1)
        self._last[sensor] = acc[-1]
        largest = float(steps[np.isfinite(steps)].max(initial=0.0))
        self._steps[sensor] = max(self._steps.get(sensor, 0.0), largest)

    def forget(self) -> None:
        """Before the next place is tapped."""
        with self._lock:
            self._steps = dict.fromkeys(self._steps, 0.0)

    def hardest(self) -> tuple[str, float]:
        """The sensor that shook most and its step; "" before the first sample."""
        with self._lock:
            return max(self._steps.items(), key=lambda item: item[1], default=("", 0.0))

    def places(self) -> list[str]:
        """Places of which a sensor gives samples."""
        with self._lock:
            return [p for p, (_, sensors) in PLACES.items() if set(sensors) & set(self._steps)]
