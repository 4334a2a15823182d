"""Corrections that were accepted in a session: kept as events of the recording, and applied to what comes from now on.

In      the text of a correction (sessions/files/sensor_corrections.py)
Out     blocks read with all of them; the recording asks for them from its beginning, its samples stay raw
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from handscope.app.devices.glove import Glove
from handscope.estimators.data.samples import Block, Event
from handscope.sessions.files import sensor_corrections
from handscope.sessions.files.sensor_corrections import CORRECTION, SensorCorrection


@dataclass
class LiveCorrections:
    """The corrections in force, by their event's name."""

    next_number: Callable[[], int]
    in_force: dict[str, SensorCorrection] = field(default_factory=dict)

    def read(self, blocks: Sequence[Block]) -> list[Block]:
        """Blocks as they are read with the corrections."""
        corrections = tuple(self.in_force.values())
        return [sensor_corrections.correct_block(b, corrections) for b in blocks]

    def add(self, text: str, t: float, glove: Glove) -> None:
        """Correct from now on, and keep it in the recording."""
        name = f"correction-{self.next_number()}"
        glove.keep_event(name, Event(max(0.0, t), 0.0, CORRECTION, {CORRECTION: text}))
        self.in_force = {**self.in_force, name: sensor_corrections.parse(text)}

    def withdraw(self, glove: Glove) -> None:
        """Take all back, where strips change fingers: the checks find them anew."""
        for name in self.in_force:
            glove.keep_event(name, None)
        self.in_force = {}
