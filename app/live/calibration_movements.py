"""The movements of a functional calibration in a live session: stored as events, evaluated, taken back or used."""

from collections.abc import Callable
from dataclasses import replace

from handscope.app.devices.glove import Glove
from handscope.app.live.tracking import Tracking
from handscope.app.live.wizard.effects import MeasureStep
from handscope.estimators.alignment.functional_movements import CalibrationMovement
from handscope.estimators.data.samples import Event


class CalibrationMovements:
    """Movements of the current calibration, with their events' ids."""

    def __init__(self, glove: Glove, tracking: Tracking, number: Callable[[], int]) -> None:
        self._glove, self._tracking, self._number = glove, tracking, number
        self._measured: dict[str, tuple[str, Event, CalibrationMovement]] = {}

    def measure(self, effect: MeasureStep) -> CalibrationMovement:
        """Store the movement that just ended as an event, and evaluate it."""
        self._take_back(effect.task, "redone")
        movement_of = self._tracking.measure(effect.task, effect.onset, effect.end)
        event_id, event = (
            f"step-{self._number()}",
            Event(effect.onset, effect.end - effect.onset, effect.task, {}),
        )
        self._glove.keep_event(event_id, event)
        self._measured[effect.task] = (event_id, event, movement_of)
        return movement_of

    def drop(self, step: str = "") -> None:
        """Take back one step, or all where `step` is empty; their events become annotations."""
        for each in [step] if step else list(self._measured):
            self._take_back(each, "redone" if step else "not used")

    def use(self) -> None:
        """Combine every later pose with the good movements."""
        good = {
            step: movement_of
            for step, (_, _, movement_of) in self._measured.items()
            if not movement_of.problems
        }
        self._tracking.movements = {**self._tracking.movements, **good}
        self._measured.clear()

    def reset(self) -> None:
        """Drop all movements: their strips were read for other fingers."""
        self._measured.clear()

    def movement_of(self, step: str | None) -> CalibrationMovement | None:
        """The movement of a step of the current calibration; None before it was done."""
        return self._measured[step][2] if step in self._measured else None

    def _take_back(self, step: str, outcome: str) -> None:
        if step in self._measured:
            event_id, event, _ = self._measured.pop(step)
            self._glove.keep_event(
                event_id,
                replace(
                    event, trial_type="annotation", details={"task_name": step, "outcome": outcome}
                ),
            )
