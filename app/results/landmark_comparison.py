"""A stored result beside a camera's hand landmarks: angles, lag and agreement as `handscope compare` gives them.

A result's stored trajectory is thinned to 60 Hz at least, twice the rate of such a camera.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handscope.app.results.curves import thinned
from handscope.app.results.make import load_replay
from handscope.app.results.movement_agreement import Movement, find_lag, measure_agreement
from handscope.estimators.data.samples import Event
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import SEGMENTS
from handscope.estimators.measures.comparison import WHOLE, Agreement, Pair
from handscope.estimators.measures.synchronisation import Lag
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.landmark_trajectory import trajectory_of
from handscope.sessions.db.tables import Result
from handscope.sessions.formats.landmarks import SUFFIXES, read_landmarks
from handscope.sessions.store import records
from handscope.sessions.store.store import Store

EVENT = "event"  # of a task's details: its number among the recording's events


@dataclass(frozen=True)
class Curve:
    """An angle of both, thinned; NaN where unknown."""

    t: Array  # (n,) s, the recording's clock
    a: Array  # (n,) rad, the result
    b: Array  # (n,) rad, the camera
    difference: Array  # (n,) rad, camera less result


@dataclass(frozen=True)
class LandmarkComparison:
    """How far a camera's landmarks are from a result."""

    frames: int  # of the camera
    seen: float  # share of them that show a hand
    lag: Lag
    curves: Mapping[str, Curve]  # by angle
    stretches: tuple[tuple[int | None, tuple[Agreement, ...]], ...]  # event of a task, None: all


def movement_of(store: Store, result: Result, name: str) -> Movement:
    """The stored movement of a result with its tasks."""
    arrays = load_replay(store, result)
    n = len(arrays["t"])
    nowhere = np.full((n, len(SEGMENTS), 4), np.nan)  # orientations take no part
    hand = records.hand_of(result.recording.session.hand)
    trajectory = Trajectory(
        hand, arrays["t"], arrays["angles"], nowhere, arrays["tips"], arrays["flags"]
    )
    events = tuple(_event(k, e) for k, e in enumerate(result.content.get("events", [])))
    return Movement(name, trajectory, events)


def compare_landmarks(path: Path, measured: Movement, points: int) -> LandmarkComparison:
    """The landmarks of a file beside a movement; curves of `points` samples at most.

    InputError where the file is no landmarks, of the other hand, or of another movement.
    """
    hand = measured.trajectory.hand
    if path.suffix.lower() not in SUFFIXES:
        raise InputError("landmarks.neither_json_nor_csv", name=path.name)
    landmarks = read_landmarks(path)
    if landmarks.hand and landmarks.hand != hand:
        raise InputError("landmarks.of_other_hand", name=path.name, hand=landmarks.hand, hand2=hand)
    camera = Movement(path.name, trajectory_of(landmarks, hand))
    lag = find_lag(measured, camera)
    agreed = measure_agreement(measured, camera, lag)
    seen = float(np.isfinite(landmarks.places).all(axis=(1, 2)).mean())
    curves = {pair.name: _curve(pair, points) for pair in agreed.pairs}
    return LandmarkComparison(
        len(landmarks.t), seen, lag, curves, _by_event(measured, agreed.agreements)
    )


def _event(number: int, event: Mapping[str, Any]) -> Event:
    return Event(event["onset"], event["duration"], event["trial_type"], {**event, EVENT: number})


def _by_event(
    measured: Movement, agreements: tuple[Agreement, ...]
) -> tuple[tuple[int | None, tuple[Agreement, ...]], ...]:
    """The agreements of the whole recording, then of each task that the camera saw."""
    numbers = {
        (e.onset, e.end): e.details[EVENT] for e in measured.events if e.trial_type == "task"
    }
    found: dict[int | None, list[Agreement]] = {}
    for agreement in agreements:
        number = numbers.get((agreement.onset, agreement.end)) if agreement.task != WHOLE else None
        found.setdefault(number, []).append(agreement)
    return tuple((number, tuple(rows)) for number, rows in found.items())


def _curve(pair: Pair, points: int) -> Curve:
    t, (a, b, difference) = thinned(pair.t, [pair.a, pair.b, pair.b - pair.a], points)
    return Curve(t, a, b, difference)
