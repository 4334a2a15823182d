"""Sessions to report on, simulated once: what was recorded, what the method made of it, what was measured."""

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np

from handscope.app.protocols import load_all
from handscope.app.report.content import Content, Visit, content
from handscope.estimators.data.samples import Block
from handscope.estimators.hand.anatomy import SEGMENTS, Hand
from handscope.estimators.hand.geometry import sized
from handscope.estimators.measures.assessment import TaskResult, assess
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import Processed, process
from handscope.estimators.simulation.scenario import simulate
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions.files.recording import LoadedRecording

ROM = ("rom_fist", "rom_spread", "rom_thumb", "rom_wrist")
NORMAL = ("initial_pose", *ROM, "tapping")
CHECKSUM = "3f2a9c0d" * 8
VISIT = Visit(
    patient="P-0042",
    date=datetime(2026, 11, 21, 10, 32, tzinfo=UTC),
    examiner="A. Examiner",
    dominant="right",
    affected="left",
    notes="Pain 2/10 on full flexion.",
)
Session = tuple[LoadedRecording, Processed, tuple[TaskResult, ...]]

ERRORS = SensorErrors(misalignment=5.0, misalignment_width=0.0, skin_angle=0.0, skin_shift=0.0)


def gap_in_the_little_finger(blocks: dict[str, Block]) -> dict[str, Block]:
    """A third of the little finger's proximal samples missing, in stretches short enough to be bridged."""
    block = blocks["imu"]
    values = block.values.copy()
    k = block.stream.sensors.index("little_proximal")
    for start in range(700, len(block.t), 30):
        values[start : start + 10, k] = np.nan
    return {"imu": replace(block, values=values)}


@cache
def session(
    tasks: tuple[str, ...] = NORMAL,
    hand: Hand = "left",
    segments: tuple[str, ...] = SEGMENTS,
    change: Callable[[dict[str, Block]], dict[str, Block]] = lambda blocks: blocks,
) -> Session:
    """A session of tasks as the virtual patient performs them."""
    made = simulate(tasks, hand, sized(hand), np.random.default_rng(3), ERRORS, segments, rate=60.0)
    source = {"device": "Glove <7>", "device_id": "00a7", "firmware": "1.2.0", "format": "native"}
    recording = LoadedRecording(
        hand,
        made.geometry,
        {},
        change(dict(made.samples)),
        made.events,
        (),
        "2026-11-21T10:30:00+00:00",
        CHECKSUM,
        source,
        {"imu": 12},
    )
    processed = process(m2, m2.Params(), recording)
    return recording, processed, tuple(assess(processed.trajectory, recording.events))


def report(
    of: Session | None = None, visit: Visit = VISIT, params: Any = None, **recorded: Any
) -> Content:
    """The content of a session's report; `recorded` replaces fields of its recording."""
    recording, processed, results = of or session()
    return content(
        visit,
        replace(recording, **recorded),
        processed,
        "m2",
        params or m2.Params(),
        results,
        "handscope 1.2.3",
        load_all(),
    )
