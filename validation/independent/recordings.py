"""Recordings of the simulator that shares no line with the estimators, through files, as anybody's glove might write them."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats
from handscope.validation.independent.simulator.free_movement import (
    Held,
    Movement,
    Setup,
    Truth,
    written,
)


def write_and_load(
    setup: Setup, movement: Movement | None = None, held: Sequence[Held] = ()
) -> tuple[LoadedRecording, Truth]:
    """What a set-up's person records, and what is true of it; of the free movement where no other is given."""
    with TemporaryDirectory() as folder:
        at = Path(folder) / "recording"
        true = written(setup, at, movement, held)
        return formats.load(at), true
