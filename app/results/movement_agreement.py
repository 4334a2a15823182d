"""Two recordings of one movement brought to one clock, and how far they agree: what `handscope compare` and the pages share."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.samples import Event
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.measures import clock_drift, comparison, synchronisation
from handscope.estimators.measures.comparison import Agreement, Pair
from handscope.estimators.measures.synchronisation import Lag, Signal


@dataclass(frozen=True)
class Movement:
    """The movement of one recording, and its events on the same clock."""

    name: str  # of its file, for sentences
    trajectory: Trajectory
    events: tuple[Event, ...] = ()


@dataclass(frozen=True)
class MovementAgreement:
    """How far B is from A, quantity by quantity and stretch by stretch."""

    b: Movement  # by A's clock
    pairs: list[Pair]
    stretches: list[tuple[str, float, float]]  # name, onset and end on A's clock
    agreements: tuple[Agreement, ...]


def find_lag(a: Movement, b: Movement, longest: float = np.inf) -> Lag:
    """The lag of at most `longest` s and the drift at which B fits A best; InputError where none convinces."""
    return clock_drift.synchronised_clocks(*_common_signals(a, b), longest)


def given_lag(a: Movement, b: Movement, seconds: float) -> Lag:
    """A lag that is known, with how well B fits there."""
    return synchronisation.fit_at(*_common_signals(a, b), seconds)


def measure_agreement(a: Movement, b: Movement, lag: Lag) -> MovementAgreement:
    """The whole recording and each task of A, or of B where A has none; InputError where nothing is seen by both."""
    b = _on_clock(b, lag)
    pairs = comparison.pair_quantities(a.trajectory, b.trajectory, 0.0)
    span = (float(a.trajectory.t[0]), float(a.trajectory.t[-1]))
    stretches = comparison.list_stretches(a.events, b.events, 0.0, span)
    found = comparison.agreements(pairs, stretches)
    if not found:
        raise InputError("command.no_common_sample")
    return MovementAgreement(b, pairs, stretches, tuple(found))


def _common_signals(a: Movement, b: Movement) -> tuple[Signal, Signal]:
    names, on_a, on_b = comparison.shared_names(a.trajectory, b.trajectory)
    if not names:
        raise InputError("command.no_common_joint", name=a.name, name2=b.name)
    return on_a, on_b


def _on_clock(b: Movement, lag: Lag) -> Movement:
    """B by A's clock."""
    trajectory = replace(b.trajectory, t=lag.on_a(b.trajectory.t))
    return replace(b, trajectory=trajectory, events=_events_on_clock(b.events, lag))


def _events_on_clock(events: Sequence[Event], lag: Lag) -> tuple[Event, ...]:
    onset, end = (
        lag.on_a(np.array([getattr(e, end) for e in events], dtype=float))
        for end in ("onset", "end")
    )
    return tuple(
        replace(e, onset=float(first), duration=float(last - first))
        for e, first, last in zip(events, onset, end)
    )
