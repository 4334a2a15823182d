"""A processed recording of either hand, thinned, as the writers of formats take it."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handscope.app.exporting.measured import gather
from handscope.estimators.data.samples import Event
from handscope.estimators.methods import m2
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import Processed, process
from handscope.sessions.exports import export
from handscope.sessions.exports.measured import Exported, Measured
from handscope.sessions.files.recording import LoadedRecording
from tests.simulated import INSTANT, loaded, pose_and_wiggle

THINNED = 7
START = "2026-03-04T05:06:07+00:00"


@cache
def processed(hand: str) -> tuple[LoadedRecording, Processed]:
    recording = loaded(pose_and_wiggle(hand))
    task = Event(4.0, 8.0, "task", {"task_name": "rom_mcp"})
    named = replace(
        recording,
        events=(*recording.events, task),
        checksum="ab" * 32,
        start_utc=START,
        source={"device": "simulated"},
    )
    return named, process(m2, INSTANT, named)


@pytest.fixture(scope="session", params=["left", "right"])
def measured(request: pytest.FixtureRequest) -> Measured:
    recording, made = processed(request.param)
    whole = gather(recording, made, "m2", INSTANT)
    return replace(whole, movement=whole.movement.at(slice(None, None, THINNED)))


@pytest.fixture(scope="session")
def without_ring(measured: Measured) -> Measured:
    """The same, one joint of the ring finger and the wrist never measured, and a gap in the index finger's."""
    angles = measured.movement.angles.copy()
    from handscope.estimators.hand.anatomy import JOINT

    angles[:, [JOINT["ring_pip"], JOINT["wrist"]]] = np.nan
    angles[50:60, JOINT["index_pip"]] = np.nan
    return replace(measured, movement=replace(measured.movement, angles=angles))


@pytest.fixture(scope="session")
def exported(measured: Measured) -> Callable[[str], Exported]:
    return cache(lambda name: export(measured, name))


def instants(n: int, count: int = 100) -> Array:
    """Rows spread over a movement."""
    return np.unique(np.linspace(0, n - 1, count).astype(int))
