"""Position of the hand against the trunk in a live station: advanced by its tick, independent of
the method, so that neither delays the other."""

import logging
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.data.magnet_streams import find_magnetometers, is_relevant
from handscope.estimators.data.samples import Block, Stream
from handscope.estimators.data.trajectory import PLACE_WORDS
from handscope.estimators.errors import InputError
from handscope.estimators.magnet.pipeline import hand_position
from handscope.estimators.magnet.pipeline.hand_position import PlaceParams, Places, Setting
from handscope.estimators.numerics.typing import Array

log = logging.getLogger(__name__)
QUEUE = 1000  # blocks, some seconds of three streams; older ones are dropped
MM = 1e3


class HandPositionReadout:
    """Position of the hand in trunk axes; fed by the glove's thread, advanced by the station's tick."""

    def __init__(self, params: PlaceParams | None = None) -> None:
        self._params = params or PlaceParams()
        self._queue: deque[Block] = deque(maxlen=QUEUE)
        self._made_for: tuple[Any, ...] = ()  # plate and streams that the setting was made for
        self._setting: Setting | None = None
        self._state: hand_position.State | None = None
        self.latest: Places | None = None  # the newest row
        self._thread: threading.Thread | None = None
        self.reason = ""  # why nothing is tracked though something is worn

    def feed(self, blocks: Sequence[Block]) -> None:
        """Take blocks from the glove's thread; never waits."""
        self._queue.extend(b for b in blocks if is_relevant(b.stream))

    def follow(
        self, plate: Plate | None, streams: Sequence[Stream], mounting: Mapping[str, Array]
    ) -> None:
        """Advance in a thread of its own, unless one is running: on a machine's first use the
        filter compiles for a minute."""
        if (plate is not None or find_magnetometers(streams)) and not (
            self._thread and self._thread.is_alive()
        ):
            self._thread = threading.Thread(
                target=self.advance, args=(plate, streams, mounting), name="place", daemon=True
            )
            self._thread.start()

    def advance(
        self, plate: Plate | None, streams: Sequence[Stream], mounting: Mapping[str, Array]
    ) -> None:
        """Process the blocks since the last call; begin anew where other sensors are worn."""
        worn = tuple(s for s in streams if is_relevant(s))
        if (plate, worn) != self._made_for:
            self._begin(plate, worn, mounting)
        blocks = [self._queue.popleft() for _ in range(len(self._queue))]
        if self._setting is None or not blocks:
            return
        try:
            self._state, places = hand_position.step(
                self._setting, self._state or hand_position.start(self._setting), blocks
            )
        except Exception:  # the station goes on; tracking restarts
            log.exception("tracking of the hand's position failed and begins again")
            self._state = None
            return
        if len(places):
            self.latest = hand_position.newest_row(places)

    def to_json(self) -> dict[str, Any] | None:
        """Position for a page, mm in trunk axes; None where neither plate nor magnetometers are worn."""
        if self.latest is None:
            return {"reason": self.reason} if self.reason else None
        place, sd, flags = self.latest.place[0], self.latest.sd[0], int(self.latest.flags[0])
        known = bool(np.isfinite(place).all())
        return {
            "reason": self.reason,
            "doubts": [words for flag, words in PLACE_WORDS.items() if flags & flag]
            + hand_position.describe_latency(self.latest),
            "mm": [round(float(MM * x)) for x in place] if known else None,
            "distance_mm": round(float(MM * np.linalg.norm(place))) if known else None,
            "sd_mm": max(1, round(float(MM * sd.max()))) if known else None,
            "signal_db": round(float(self.latest.signal[0]), 1)
            if np.isfinite(self.latest.signal[0])
            else None,
        }

    def number(self) -> dict[str, Any] | None:
        """The hand's distance from the trunk as a live number with its standard deviation; None
        where unknown."""
        payload = self.to_json() or {}
        if payload.get("distance_mm") is None:
            return None
        return {
            "name": "place",
            "value": payload["distance_mm"] / 10,
            "unit": "cm",
            "sd": payload["sd_mm"] / 10,
        }

    def _begin(
        self, plate: Plate | None, worn: tuple[Stream, ...], mounting: Mapping[str, Array]
    ) -> None:
        self._made_for, self._setting, self._state, self.latest, self.reason = (
            (plate, worn),
            None,
            None,
            None,
            "",
        )
        self._queue.clear()
        try:
            self._setting = hand_position.make_setting(self._params, plate, worn, mounting)
        except InputError as problem:
            self.reason = str(problem)
