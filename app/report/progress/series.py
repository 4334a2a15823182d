"""How a patient's figures went over the sessions: series by hand, each change judged by the minimal detectable change, the other hand beside them.

A value is compared with the hand's first session and with the one before; the band is drawn round these. Source of the band: app/report/changes.py.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise
from typing import Literal

from handscope.app.protocols import Protocol
from handscope.app.report.changes import Judge, judged_by, read_as
from handscope.app.report.content import asked
from handscope.app.report.progress.importance import finger_of, rank
from handscope.app.report.references import Reference, references
from handscope.estimators.hand.anatomy import ANGLES, HANDS, Hand
from handscope.sessions.clinic.repeatability import Key, Occasion, ProcessedSession

ENDS: Mapping[str, Literal["largest", "smallest"]] = {"max": "largest", "min": "smallest"}
Processing = tuple[str, str]  # method and options


@dataclass(frozen=True)
class Point:
    """A figure in one session, in the unit a person reads."""

    session: int
    started: datetime
    value: float
    since_first: bool | None  # whether the change exceeds the MDC; None: not judged, or the first
    since_before: bool | None


@dataclass(frozen=True)
class Course:
    """A figure of one hand over its sessions."""

    points: tuple[Point, ...]
    judge: Judge


@dataclass(frozen=True)
class Series:
    """A figure on both hands."""

    measure: str
    task: str
    name: str
    unit: str
    finger: str  # "" where the figure is of no single finger
    important: bool  # comes first where there are many
    joint: str  # "" where the figure is of no single joint
    angle: str
    end: Literal["largest", "smallest", ""]
    hands: Mapping[Hand, Course]
    reference: Reference | None


@dataclass(frozen=True)
class Progress:
    """Everything that the sessions processed in one way say."""

    method: str
    sessions: Mapping[Hand, tuple[Occasion, ...]]
    series: tuple[Series, ...]


def progress(
    visits: Sequence[ProcessedSession], protocols: Mapping[str, Protocol]
) -> Progress | None:
    """The course of every figure that a task asked for, the important ones first, by the way in which most sessions were processed; None without a session."""
    if not visits:
        return None
    processing = _most_used(visits)
    selected = [v for v in visits if v.occasion.processing[1:] == processing]
    by_hand: dict[Hand, list[ProcessedSession]] = {
        hand: [v for v in selected if v.occasion.hand == hand] for hand in HANDS
    }
    every = dict.fromkeys(key for v in selected for key in v.values)
    asked_for = [
        key for key in every if not key[2].endswith("_range") and _is_asked(key, protocols)
    ]
    ranks = {key: place for key in asked_for if (place := rank(key)) is not None}
    first = sorted(ranks, key=ranks.__getitem__)  # of one rank in the order of measuring
    keys = [*first, *(key for key in asked_for if key not in first)]
    return Progress(
        processing[0],
        {hand: tuple(v.occasion for v in found) for hand, found in by_hand.items() if found},
        tuple(_series(key, by_hand) for key in keys),
    )


def _most_used(visits: Iterable[ProcessedSession]) -> Processing:
    """Of the ways the one of most sessions; of several the newest."""
    sessions: dict[Processing, list[int]] = defaultdict(list)
    for v in visits:
        sessions[v.occasion.processing[1:]].append(v.occasion.session)
    return max(
        sessions, key=lambda processing: (len(sessions[processing]), max(sessions[processing]))
    )


def _is_asked(key: Key, protocols: Mapping[str, Protocol]) -> bool:
    """Whether the task asked for this figure; of joints that it left alone there is nothing to follow."""
    wanted = asked(protocols.get(key[1])) if key[0] == "range_of_motion" else None
    return wanted is None or key[2].rpartition("_")[0] in wanted


def _series(key: Key, by_hand: Mapping[Hand, Sequence[ProcessedSession]]) -> Series:
    joint, angle, end = _parts(key[2])
    courses = {
        hand: _course(key, found)
        for hand, visits in by_hand.items()
        if (found := [v for v in visits if key in v.values])
    }
    unit = next(
        read_as(key, *v.values[key])[1]
        for visits in by_hand.values()
        for v in visits
        if key in v.values
    )
    reference = next(
        (r for r in references() if (r.joint, r.angle, r.end) == (joint, angle, end)), None
    )
    finger, important = finger_of(key[2]), rank(key) is not None
    return Series(*key, unit, finger, important, joint, angle, end, courses, reference)


def _course(key: Key, visits: Sequence[ProcessedSession]) -> Course:
    newest = visits[-1]
    judge = judged_by(key, newest.values[key][1], newest.own, newest.glove)
    values = [read_as(key, *v.values[key])[0] for v in visits]
    before = [None, *(_is_beyond(now - then, judge) for then, now in pairwise(values))]
    first = [None, *(_is_beyond(value - values[0], judge) for value in values[1:])]
    points = zip(visits, values, first, before)
    return Course(
        tuple(
            Point(v.occasion.session, v.occasion.started, value, f, b) for v, value, f, b in points
        ),
        judge,
    )


def _is_beyond(change: float, judge: Judge) -> bool | None:
    return None if judge.mdc95 is None else abs(change) > judge.mdc95


def _parts(name: str) -> tuple[str, str, Literal["largest", "smallest", ""]]:
    """Joint, angle and end of index_pip_flexion_max; three times "" for a figure of no single joint."""
    rest, _, end = name.rpartition("_")
    joint, _, angle = rest.rpartition("_")
    return (joint, angle, ENDS[end]) if end in ENDS and angle in ANGLES else ("", "", "")
