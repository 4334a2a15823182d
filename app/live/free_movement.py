"""The rung "free movement" of a live session: what can be observed already while the hand moves, then solving beside the session, then what was found.

watched      once a second, in a thread of its own (free_meter.py); a person may say "enough" before the meter does, and is warned
solved       in a process of its own (solving.py); the wizard waits in FREE_WORK and may leave it
used         lengths and seats serve every pose from now on, and are kept with the patient: accepting is the decision
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from handscope.app.devices.glove import Glove
from handscope.app.live.readouts.observability_meter import FreeMeter
from handscope.app.live.tracking import Tracking
from handscope.app.live.wizard.machine import Order
from handscope.app.workers.self_calibration import Solving
from handscope.estimators.data.calibration import Known
from handscope.estimators.data.samples import Event
from handscope.sessions.clinic.self_calibrations import ALL, Found, taken_over
from handscope.sessions.files.recording import LoadedRecording


class FreeMovement:
    """One for a station; `keep` takes what was found and accepted."""

    def __init__(
        self,
        glove: Glove,
        tracking: Tracking,
        number: Callable[[], int],
        keep: Callable[[Found, str], object],
    ) -> None:
        self._glove, self._tracking, self._number, self._keep = glove, tracking, number, keep
        self.solving: Solving | None = None
        self.meter: FreeMeter | None = None  # of the newest free movement
        self._moving = False
        self.found: Found | None = None
        self._event: tuple[str, Event] | None = None
        self._used: Known | None = None

    def known(self, earlier: Known | None, of_glove: str) -> Known | None:
        """What the next pose takes over: what was found and accepted here, else what was decided when the session began."""
        if self._used is None and earlier is not None:
            return reused(earlier, of_glove, self.worn)
        return self._used

    def forget(self) -> None:
        """The strips were read in another way: what was found of them holds no longer."""
        self._leave("not used")
        self._used = None

    def do(self, order: Order) -> None:
        """An order of the wizard's about free movement."""
        if order.kind == "watch_free":
            self.meter, self._moving, self.found = (
                FreeMeter(self._tracking, order.onset),
                True,
                None,
            )
        elif order.kind == "solve_free":
            self._moving = False
            self._begin(order)
        elif order.kind == "leave_free":
            self._leave(order.reason)
        elif order.kind == "use_free" and self.found is not None:
            self._used = taken_over(self.found.table, ALL)
            self._keep(self.found, self.worn)
            self._event = None

    def watch(self) -> None:
        """Have the meter take in the newest movement."""
        if self.meter is not None and self._moving:
            self.meter.follow()

    @property
    def enough(self) -> bool:
        """Whether the movement so far tells all that self-calibration looks for."""
        return self.meter is not None and self.meter.enough

    def solved(self) -> bool:
        """Whether the computation came to an end just now, in `found` or `refusal`."""
        if self.solving is None:
            return False
        self.solving.look()
        self.found = self.solving.found
        return self.solving.over

    def settle(self) -> str:
        """The computation that came to an end is put away; gives why it found nothing."""
        refusal = self.solving.refusal if self.solving else ""
        self.solving = None
        if refusal:
            self._take_back("refused")
        return refusal

    def close(self) -> None:
        """End what is being computed."""
        if self.solving is not None:
            self.solving.close()
            self.solving = None

    def told(self) -> dict[str, Any]:
        """For a page: the meter joint by joint, how far the computation is, what was found."""
        return {
            "meter": [
                {
                    "joint": o.joint,
                    "share": math.floor(100 * o.share) / 100,  # 1 is enough, and nothing less
                    "excursion_deg": round(float(np.degrees(o.excursion))),
                    "length_mm": round(1e3 * o.length_sd, 1),
                }
                for o in (self.meter.observed if self.meter else ())
            ],
            "enough": self.enough,
            "share": None if self.solving is None else round(self.solving.share, 2),
            "found": None
            if self.found is None
            else {"table": self.found.table, "told": list(self.found.told)},
        }

    @property
    def worn(self) -> str:
        """The number of the glove that is worn; "" before it said so."""
        identity = self._glove.assembler.identity
        return "" if identity is None else f"{identity.device_id:016x}"

    def _begin(self, order: Order) -> None:
        """The movement is kept in the recording, and solved."""
        self.close()
        tracking, event = (
            self._tracking,
            Event(order.onset, order.end - order.onset, order.task, {}),
        )
        self._event = (f"free-{self._number()}", event)
        self._glove.keep_event(*self._event)
        samples = {
            b.stream.name: b
            for b in (b.between(order.onset, order.end) for b in tracking.samples(order.onset))
            if len(b.t)
        }
        self.solving = Solving(
            LoadedRecording(
                tracking.hand, tracking.geometry, self._glove.assembler.mounting, samples, (event,)
            )
        )

    def _leave(self, outcome: str) -> None:
        self.close()
        self.found, self._moving = None, False
        self._take_back(outcome)

    def _take_back(self, outcome: str) -> None:
        """It is not to count: the recording says that it was done, and no more."""
        if self._event is not None:
            event_id, event = self._event
            details = {"task_name": event.trial_type, "outcome": outcome}
            self._glove.keep_event(
                event_id, replace(event, trial_type="annotation", details=details)
            )
            self._event = None


def reused(known: Known, of_glove: str, worn: str) -> Known:
    """What an earlier self-calibration gives a session: of another glove its lengths alone."""
    return known.of_hand() if of_glove and worn and of_glove != worn else known
