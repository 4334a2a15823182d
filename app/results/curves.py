"""Curves of stored results for pages: in deg and mm, thinned without losing a peak; two results on one clock.

Two results of one recording share its clock, so they have a difference. Two recordings are aligned at the onset of
a trial of the same task.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handscope.app.report.units import DEG
from handscope.app.results.make import load_replay
from handscope.app.results.quantity_curve import value_of
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import DOF_NAMES
from handscope.estimators.measures.comparison import Agreement, Pair, agreements
from handscope.estimators.numerics.typing import Array
from handscope.sessions.db.tables import Result
from handscope.sessions.store.store import Store

APERTURE = "aperture"
LEAD = 1.0  # s before and after a task in which two recordings are in step


@dataclass(frozen=True)
class ResultComparison:
    """One quantity of two results; t from the trial's onset, or on the recording's clock; NaN where unknown."""

    t: Array  # (n,) s
    a: Array  # (n,) deg or mm
    b: Array  # (n,)
    difference: Array  # (n,) b less a, of one recording only
    agreement: Agreement | None  # of one recording only: the same movement
    offsets: tuple[float, float]  # s, what t = 0 is on either's clock


def require_quantities(what: Sequence[str]) -> None:
    """InputError for an unknown quantity."""
    unknown = [w for w in what if w != APERTURE and w not in DOF_NAMES]
    if unknown:
        raise InputError("result.unknown_curve", name=unknown[0])


def load_curves(
    store: Store, result: Result, what: Sequence[str], start: float, stop: float, points: int
) -> tuple[Array, dict[str, Array]]:
    """Times (n,) and values (n,) by quantity between two moments, `points` at most."""
    require_quantities(what)
    rows = _rows(store, result, start, stop)
    thin = thinned(rows.t, [value_of(rows, w) for w in what], points)
    return thin[0], dict(zip(what, thin[1]))


def thinned(t: Array, values: Sequence[Array], points: int) -> tuple[Array, list[Array]]:
    """At most `points` samples of curves (n,) on one clock: of every stretch its extremes in their order."""
    size = -(-2 * len(t) // points)  # samples in a stretch; two of them remain
    if size <= 2:
        return t, list(values)
    count = -(-len(t) // size)
    spare = count * size - len(t)
    places = np.stack(
        [t[::size], t[np.minimum(np.arange(count) * size + size // 2, len(t) - 1)]], axis=1
    ).ravel()
    return places, [
        _ends(np.pad(v, (0, spare), constant_values=np.nan).reshape(count, size)) for v in values
    ]


def compare_results(
    store: Store, a: Result, b: Result, what: str, event: int | None, points: int
) -> ResultComparison:
    """A quantity of two results: of a task (the event of A's recording) or, within one recording, of all of it."""
    require_quantities([what])
    same = a.recording_id == b.recording_id
    if event is None and not same:
        raise InputError("result.trial_not_given")
    onsets, length = _trials(a, b, event) if event is not None else ((0.0, 0.0), np.inf)
    first, second = (
        _rows(store, r, onset if event is not None else -np.inf, onset + length)
        for r, onset in zip((a, b), onsets)
    )
    on_a = value_of(first, what)
    on_b = _at(first.t - onsets[0], second.t - onsets[1], value_of(second, what))
    found = agreements([_pair(what, first.t, on_a, on_b)], [("", -np.inf, np.inf)]) if same else []
    t, (thin_a, thin_b, difference) = thinned(
        first.t - onsets[0], [on_a, on_b, on_b - on_a], points
    )
    return ResultComparison(t, thin_a, thin_b, difference, found[0] if found else None, onsets)


@dataclass(frozen=True)
class MatchedTask:
    """A task of one recording and the same of another."""

    onset: float  # s of the one's clock
    other: float  # s of the other's
    length: float  # s, of the longer


def matching_tasks(a: Result, b: Result) -> tuple[MatchedTask, ...]:
    """The tasks that A and B share, in order of time; none for one recording. InputError where they share none."""
    if a.recording_id == b.recording_id:
        return ()
    tasks, others = _tasks(a), {e.get("task_name") for e in _tasks(b).values()}
    found = [_trials(a, b, event) for event, e in tasks.items() if e.get("task_name") in others]
    if not found:
        raise InputError("result.no_common_task")
    return tuple(
        sorted((MatchedTask(*onsets, length) for onsets, length in found), key=lambda s: s.onset)
    )


def at_other(steps: Sequence[MatchedTask], t: float) -> float:
    """The other's time at t, within the current or last task; outside it the other rests, LEAD s beyond the task's ends."""
    if not steps:
        return t
    step = next((s for s in reversed(steps) if s.onset - LEAD <= t), steps[0])
    return step.other + float(np.clip(t - step.onset, -LEAD, step.length + LEAD))


def _trials(a: Result, b: Result, event: int) -> tuple[tuple[float, float], float]:
    """Onsets of A's trial and of the same trial in B (its last where it has fewer), and the longer duration."""
    events = [_tasks(r) for r in (a, b)]
    wanted = events[0].get(event)
    if wanted is None:
        raise InputError("result.task_unknown", number=event, result=a.id)
    mine, others = (
        [e for e in found.values() if e.get("task_name") == wanted.get("task_name")]
        for found in events
    )
    if not others:
        raise InputError(
            "result.other_session_without_task", task=str(wanted.get("task_name")).replace("_", " ")
        )
    other = (
        others[min(mine.index(wanted), len(others) - 1)]
        if a.recording_id != b.recording_id
        else wanted
    )
    return (wanted["onset"], other["onset"]), max(wanted["duration"], other["duration"])


def _tasks(result: Result) -> dict[int, Mapping[str, Any]]:
    return {
        k: e for k, e in enumerate(result.content.get("events", [])) if e["trial_type"] == "task"
    }


def _rows(store: Store, result: Result, start: float, stop: float) -> Trajectory:
    """The stored trajectory between two instants, as far as curves need it."""
    arrays = load_replay(store, result)
    first, last = np.searchsorted(arrays["t"], [start, np.nextafter(stop, np.inf)])
    part = {name: arrays[name][first:last] for name in ("t", "angles", "tips")}
    return Trajectory(
        "left", part["t"], part["angles"], np.empty(0), part["tips"], np.empty(0, np.uint8)
    )


def _at(t: Array, other_t: Array, other: Array) -> Array:
    """The other's values at times t, NaN outside and next to unknown values."""
    if len(other_t) < 2:
        return np.full(len(t), np.nan)
    return np.asarray(np.interp(t, other_t, other, left=np.nan, right=np.nan))


def _pair(what: str, t: Array, a: Array, b: Array) -> Pair:
    return (
        Pair(what, "m", t, a / 1e3, b / 1e3)
        if what == APERTURE
        else Pair(what, "rad", t, a / DEG, b / DEG)
    )


def _ends(stretches: Array) -> Array:
    """The extremes of every row (k, size) in their order (2 k,); NaN for a row without values."""
    empty = np.asarray(np.isnan(stretches).all(axis=1))
    filled = np.where(empty[:, None], 0.0, stretches)
    low, high = np.nanargmin(filled, axis=1), np.nanargmax(filled, axis=1)
    picked = np.take_along_axis(
        filled, np.stack([np.minimum(low, high), np.maximum(low, high)], axis=1), axis=1
    )
    return np.asarray(np.where(empty[:, None], np.nan, picked).ravel())
