"""Self-calibration from free movement in a live session.

meter     observability once a second, in a thread of its own (observability_meter.py); a person may end it early and is warned
solver    in a process of its own or on a cluster (workers/self_calibration.py); the wizard waits in FREE_WORK and may leave it
result    lengths and alignments serve every later pose and are stored with the patient once a person accepts them
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from handscope.app.devices.glove import Glove
from handscope.app.live.readouts.observability_meter import FreeMeter
from handscope.app.live.tracking import Tracking
from handscope.app.live.wizard.effects import FreeEffect, LeaveFree, SolveFree, UseFree, WatchFree
from handscope.app.workers.self_calibration import SelfCalibrationSolver
from handscope.estimators.data.calibration import PriorCalibration
from handscope.estimators.data.samples import Event
from handscope.sessions.clinic.self_calibrations import ALL, FoundCalibration, select_parts
from handscope.sessions.files.recording import LoadedRecording


class FreeMovement:
    """One for a station; `keep` stores an accepted solution."""

    def __init__(
        self,
        glove: Glove,
        tracking: Tracking,
        number: Callable[[], int],
        keep: Callable[[FoundCalibration, str], object],
        scheduler: str | None = None,
    ) -> None:
        self._glove, self._tracking, self._number, self._keep = glove, tracking, number, keep
        self._scheduler = scheduler
        self.solver: SelfCalibrationSolver | None = None
        self.meter: FreeMeter | None = None  # of the newest free movement
        self._moving = False
        self.solution: FoundCalibration | None = None
        self._event: tuple[str, Event] | None = None
        self._used: PriorCalibration | None = None

    def prior(self, earlier: PriorCalibration | None, of_glove: str) -> PriorCalibration | None:
        """The prior of the next pose: the solution accepted here, else the one chosen when the session began."""
        if self._used is None and earlier is not None:
            return prior_for_glove(earlier, of_glove, self.glove_id)
        return self._used

    def reset(self) -> None:
        """Drop the solution: the strips are read for other fingers."""
        self._leave("not used")
        self._used = None

    def carry_out(self, effect: FreeEffect) -> None:
        """Carry out an effect of the wizard that concerns free movement."""
        match effect:
            case WatchFree(onset):
                self.meter, self._moving = FreeMeter(self._tracking, onset), True
                self.solution = None
            case SolveFree():
                self._moving = False
                self._begin(effect)
            case LeaveFree(outcome):
                self._leave(outcome)
            case UseFree():
                self._use()

    def update_meter(self) -> None:
        """Let the meter take in the newest movement."""
        if self.meter is not None and self._moving:
            self.meter.follow()

    @property
    def is_enough(self) -> bool:
        """Whether everything that self-calibration estimates is observable by now."""
        return self.meter is not None and self.meter.is_enough

    def poll_solver(self) -> bool:
        """Whether the solver has just ended, with a solution or a refusal."""
        if self.solver is None:
            return False
        self.solver.poll()
        self.solution = self.solver.solution
        return self.solver.is_over

    def take_refusal(self) -> str:
        """Close the solver that ended; returns why there is no solution, else nothing."""
        refusal = self.solver.refusal if self.solver else ""
        self.solver = None
        if refusal:
            self._take_back("refused")
        return refusal

    def close(self) -> None:
        """End the solver."""
        if self.solver is not None:
            self.solver.close()
            self.solver = None

    def to_json(self) -> dict[str, Any]:
        """For a page: the meter joint by joint, progress of the solver, the solution."""
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
            "enough": self.is_enough,
            "share": None if self.solver is None else round(self.solver.share, 2),
            "found": None
            if self.solution is None
            else {"table": self.solution.table, "told": list(self.solution.messages)},
        }

    @property
    def glove_id(self) -> str:
        """Device id of the glove; empty before it announced itself."""
        identity = self._glove.assembler.identity
        return "" if identity is None else f"{identity.device_id:016x}"

    def _use(self) -> None:
        """Use the solution from the next pose on, and keep it."""
        if self.solution is not None:
            self._used = select_parts(self.solution.table, ALL)
            self._keep(self.solution, self.glove_id)
            self._event = None

    def _begin(self, effect: SolveFree) -> None:
        """Store the movement as an event, and start the solver."""
        self.close()
        tracking, event = (
            self._tracking,
            Event(effect.onset, effect.end - effect.onset, effect.task, {}),
        )
        self._event = (f"free-{self._number()}", event)
        self._glove.keep_event(*self._event)
        samples = {
            b.stream.name: b
            for b in (b.between(effect.onset, effect.end) for b in tracking.samples(effect.onset))
            if len(b.t)
        }
        self.solver = SelfCalibrationSolver(
            LoadedRecording(
                tracking.hand, tracking.geometry, self._glove.assembler.mounting, samples, (event,)
            ),
            self._scheduler,
        )

    def _leave(self, outcome: str) -> None:
        self.close()
        self.solution, self._moving = None, False
        self._take_back(outcome)

    def _take_back(self, outcome: str) -> None:
        """Turn the movement's event into an annotation."""
        if self._event is not None:
            event_id, event = self._event
            details = {"task_name": event.trial_type, "outcome": outcome}
            self._glove.keep_event(
                event_id, replace(event, trial_type="annotation", details=details)
            )
            self._event = None


def prior_for_glove(prior: PriorCalibration, of_glove: str, glove_id: str) -> PriorCalibration:
    """The part of an earlier self-calibration that holds: of another glove only its lengths."""
    return prior.of_hand() if of_glove and glove_id and of_glove != glove_id else prior
