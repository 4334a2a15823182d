"""The steps of a functional calibration in a live session: kept in the recording under their own names, measured, taken back or brought into force."""

from collections.abc import Callable
from dataclasses import replace

from handscope.app.devices.glove import Glove
from handscope.app.live.tracking import Tracking
from handscope.app.live.wizard.machine import Order
from handscope.estimators.alignment.functional_movements import Piece
from handscope.estimators.data.samples import Event


class MeasuredSteps:
    """Steps of the calibration that goes on, with their events' ids."""

    def __init__(self, glove: Glove, tracking: Tracking, number: Callable[[], int]) -> None:
        self._glove, self._tracking, self._number = glove, tracking, number
        self._measured: dict[str, tuple[str, Event, Piece]] = {}

    def measure(self, order: Order) -> Piece:
        """A step was done: keep it in the recording, and judge it."""
        self._take_back(order.task, "redone")
        piece = self._tracking.measure(order.task, order.onset, order.end)
        event_id, event = (
            f"step-{self._number()}",
            Event(order.onset, order.end - order.onset, order.task, {}),
        )
        self._glove.keep_event(event_id, event)
        self._measured[order.task] = (event_id, event, piece)
        return piece

    def drop(self, step: str) -> None:
        """A step, or all where none is named, is not to count: the recording says that it was done, and no more."""
        for each in [step] if step else list(self._measured):
            self._take_back(each, "redone" if step else "not used")

    def use(self) -> None:
        """Every pose from now on is combined with the steps that were done well."""
        good = {step: piece for step, (_, _, piece) in self._measured.items() if not piece.problems}
        self._tracking.pieces = {**self._tracking.pieces, **good}
        self._measured.clear()

    def forget(self) -> None:
        """What was measured was read in another way."""
        self._measured.clear()

    def piece(self, step: str | None) -> Piece | None:
        """What a step of the calibration that goes on tells."""
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
