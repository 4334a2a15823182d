"""What a clinician sees of a trial before keeping it: the curves of all fingers that count with their marks, the three figures that matter beside last time's
and the other hand's, and what was wrong in one sentence.

Source  figures are those of the assessment (estimators.measures), of this trial alone
"""

import logging
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handscope.app.language import Language
from handscope.app.live.tracking import Tracking
from handscope.app.live.wizard.machine import State, Wizard
from handscope.app.protocols import CURVES, Protocol
from handscope.app.report.change_words import value_words
from handscope.app.report.progress.importance import HEADLINES
from handscope.app.report.progress.labels import label
from handscope.app.report.units import places_of, reading, signed
from handscope.app.report.words import named
from handscope.app.results.quantity_curve import value_of
from handscope.estimators.data.samples import Block, Event
from handscope.estimators.data.trajectory import Flag, Trajectory
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import repetitions, tapping
from handscope.estimators.measures.assessment import TaskResult, assess
from handscope.estimators.measures.figure import TRUSTED, Figure
from handscope.estimators.measures.task_request import PAUSE
from handscope.sessions.clinic.repeatability import Values

log = logging.getLogger(__name__)
POINTS = 240  # of a curve
MOST = 3  # figures
UNCOUNTED = ("reach", "force", "contacts")  # groups whose tasks have no taps and no repetitions
LEAST = 8.0  # deg: a curve that goes less far shows no repetition
EARLY = 0.9  # of the time asked for, below which a trial was stopped early
SETTLE = tapping.MARGIN  # s after the trial until all samples have arrived that a measure looks at


@dataclass(frozen=True)
class EarlierFigures:
    """Figures of sessions before, SI: of this hand last time, and of the other hand."""

    last: Values = field(default_factory=dict)
    other: Values = field(default_factory=dict)


def review(
    rows: Trajectory,
    blocks: Sequence[Block],
    protocol: Protocol,
    curve: str,
    trial: tuple[float, float, tuple[tuple[float, float], ...]],
    geometry: HandGeometry,
    earlier: EarlierFigures,
) -> dict[str, Any]:
    """The whole review, for a page: s, deg, mm. `trial` is onset, end and pauses, s; rows and blocks may reach beyond it."""
    onset, end, pauses = trial
    details = {"task_name": protocol.name, **protocol.details}
    events = [
        Event(onset, end - onset, "task", details),
        *(
            Event(a, b - a, "annotation", {"task_name": protocol.name, "phase": PAUSE})
            for a, b in pauses
        ),
    ]
    results = assess(rows, events, geometry)
    shown = rows.between(onset, end).without(pauses)
    values = value_of(shown, curve) if len(shown) else np.empty(0)
    return {
        "onset": onset,
        "end": end,
        "curve": curve,
        **_curves(shown, curve),
        "marks": []
        if protocol.group in UNCOUNTED
        else [round(float(t), 3) for t in _marks(results, shown.t, values, curve)],
        "figures": [_figure(r, f, curve, earlier) for r, f in select_figures(results, curve)],
        "fingers": _fingers(results, curve),
        "problem": lost_heading(shown) or problem_of(blocks, protocol, curve, values, trial),
        "taps": next((r.details.count for r in results if r.measure == "tapping"), None),
    }


def select_figures(results: Sequence[TaskResult], curve: str) -> list[tuple[TaskResult, Figure]]:
    """At most three: the measure's headlines, else those of the joint that the task is about."""
    known = [(r, f) for r in results for f in r.figures if np.isfinite(f.value)]
    first = [
        (r, f)
        for r, f in known
        if (f.what or f.name) in HEADLINES.get(r.measure, ()) and not f.detail
    ]
    ends = (f"{curve}_max", f"{curve}_min", f"{curve}_range")
    own = [(r, f) for end in ends for r, f in known if f.name == end]
    return [*first, *own][:MOST]


def lost_heading(rows: Trajectory) -> dict[str, Any] | None:
    """The problem that the heading of segments was lost in a gap, None where it was not: graver than any of `problem_of`, since all that is shown afterwards is wrong."""
    lost = (rows.flags & np.uint8(Flag.HEADING_LOST)).any(axis=1)
    return {"kind": "heading"} if len(rows) and lost.mean() > TRUSTED else None


def problem_of(
    blocks: Sequence[Block],
    protocol: Protocol,
    curve: str,
    values: np.ndarray,
    trial: tuple[float, float, tuple[tuple[float, float], ...]],
) -> dict[str, Any] | None:
    """What was wrong with the trial, the gravest alone; None where nothing was."""
    onset, end, pauses = trial
    done = end - onset - sum(b - a for a, b in pauses)
    lost = {b.stream.name: _share_lost(b, onset, end) for b in blocks if b.stream.inertial}
    worst = max(lost, key=lambda name: lost[name], default="")
    if worst and lost[worst] > TRUSTED:
        part = next(b.stream.sensors[0] for b in blocks if b.stream.name == worst)
        return {"kind": "lost", "part": part, "percent": round(100 * lost[worst])}
    if not len(values) or np.isnan(values).mean() > TRUSTED:
        share = 100 if not len(values) else round(100 * float(np.isnan(values).mean()))
        return {"kind": "unknown", "percent": share}
    if protocol.length and done < EARLY * protocol.length:
        return {"kind": "early", "seconds": round(done), "asked": round(protocol.length)}
    found = repetitions.count(values, LEAST)
    if protocol.repetitions and curve != "aperture" and found < protocol.repetitions:
        return {"kind": "few", "done": found, "asked": protocol.repetitions}
    return None


def _share_lost(block: Block, onset: float, end: float) -> float:
    """Share of a stream's samples between two instants that did not arrive."""
    within = block.between(onset, end)
    expected = max(1.0, (end - onset) * block.stream.rate)
    arrived = np.isfinite(within.values[:, 0]).all(axis=-1).sum() if len(within.t) else 0
    return float(max(0.0, 1.0 - arrived / expected))


def _curves(rows: Trajectory, curve: str) -> dict[str, Any]:
    """The quantity of the task, and the same joint of every other finger that is measured: times, and values by curve."""
    every = max(1, len(rows) // POINTS)
    found = []
    for what in (curve, *(w for w in same_joint(curve) if w != curve)):
        values = value_of(rows, what)[::every]
        if np.isfinite(values).any():
            points = [None if np.isnan(v) else round(float(v), 1) for v in values]
            found.append({"what": what, "values": points})
    return {"t": [round(float(t), 3) for t in rows.t[::every]], "curves": found}


def same_joint(curve: str) -> list[str]:
    """The same angle of every finger, the thumb left out; the curve alone where it is no finger's."""
    finger, _, rest = curve.partition("_")
    if finger not in FINGERS[1:]:
        return [curve]
    return [f"{f}_{rest}" for f in FINGERS[1:] if f"{f}_{rest}" in CURVES]


def _marks(
    results: Sequence[TaskResult], t: np.ndarray, values: np.ndarray, curve: str
) -> np.ndarray:
    """When each tap that counts closed, or each repetition that counts reached its far end, s."""
    if curve != "aperture":
        return np.asarray(t[repetitions.far_ends(values, LEAST)])
    tapped = next((r.details for r in results if r.measure == "tapping"), None)
    if tapped is not None:
        return tapped.cycles.ends if tapped.cycles else np.empty(0)
    return next((m["closing"] for r in results if "closing" in (m := r.shown.marks)), np.empty(0))


def _figure(
    result: TaskResult, figure: Figure, curve: str, earlier: EarlierFigures
) -> dict[str, Any]:
    key = (result.measure, result.task, figure.name)
    read = reading(figure)
    beside = {
        name: None if key not in values else reading(_with(figure, values[key][0])).value
        for name, values in (("last", earlier.last), ("other", earlier.other))
    }
    return {
        "figure": figure.name,
        "part": figure.part,
        "what": figure.what,
        "end": figure.name.removeprefix(f"{curve}_") if figure.name.startswith(f"{curve}_") else "",
        "unit": read.unit,
        "value": read.value,
        "sd": None if figure.sd is None else reading(_with(figure, figure.sd)).value,
        "grade": figure.grade,
        **beside,
    }


def _with(figure: Figure, value: float) -> Figure:
    return Figure(figure.name, value, figure.unit, "")


def _fingers(results: Sequence[TaskResult], curve: str) -> list[dict[str, Any]]:
    """How far each finger's joint went to its larger side, deg with its sign; empty for a task that is about one joint."""
    values = {f.name: reading(f).value for r in results for f in r.figures if np.isfinite(f.value)}
    furthest = {}
    for what in same_joint(curve):
        ends = [values[name] for end in ("max", "min") if (name := f"{what}_{end}") in values]
        if ends:
            furthest[what] = max(ends, key=abs)
    if len(furthest) < 2:
        return []
    return [
        {"finger": what.split("_")[0], "what": what, "value": value}
        for what, value in furthest.items()
    ]


def localised_review(review: Mapping[str, Any] | None, language: Language) -> dict[str, Any] | None:
    """The review with its figures in the words of a language."""
    if review is None:
        return None
    figures = [_figure_words(f, language) for f in review["figures"]]
    return {**review, "figures": figures}


def _figure_words(f: Mapping[str, Any], language: Language) -> dict[str, Any]:
    figure = Figure(f["figure"], f["value"], f["unit"], "", part=f["part"], what=f["what"])

    places = places_of(f["figure"], f["value"], f["unit"])

    def words(value: float | None) -> str | None:
        if value is None:
            return None
        if f["unit"] == "deg" and (value < 0 or f["end"]):
            return value_words(f["figure"], value, "deg", language)
        return signed(f["figure"], value, places, f["unit"], language)

    sd = f["sd"] and signed(f["figure"], f["sd"], places, f["unit"], language)
    return {
        "label": label(f["figure"], language) if f["end"] else named(figure, language),
        "grade": f["grade"],
        "sd": sd,
        **{name: words(f[name]) for name in ("value", "last", "other")},
    }


class TrialReview:
    """Reviews every trial of a station as it ends, in a thread of its own."""

    def __init__(self, tracking: Tracking, geometry: HandGeometry, earlier: EarlierFigures) -> None:
        self._tracking, self._geometry, self._earlier = tracking, geometry, earlier
        self.number = 0  # of the newest review that is there or could not be made, 0: none
        self._of: tuple[str, float, float] | None = None
        self._payload: dict[str, Any] | None = None
        self._count = 0
        self.rows: Trajectory | None = None  # of the trial under review, for its replay

    def follow(self, wizard: Wizard, curve: str) -> None:
        """Begin the review of a trial that has just ended; drop the one before."""
        protocol = wizard.protocol
        if wizard.state is not State.TASK_REVIEW or protocol is None:
            self._of, self._payload, self.rows, self.number = None, None, None, 0
            return
        trial = (protocol.name, wizard.onset, wizard.end)
        late = self._tracking.newest_sample() < wizard.end + SETTLE
        if trial != self._of and not late:
            self._of, self._payload = trial, None
            self.rows = self._tracking.past(wizard.onset, wizard.end)
            arguments = (trial, protocol, curve, wizard.pauses)
            threading.Thread(target=self._review, args=arguments, daemon=True).start()

    @property
    def taps(self) -> int | None:
        """Taps of the trial under review as its result counts them; None until that is known, and in other tasks."""
        found = self._payload
        return None if found is None else found["taps"]

    def payload(self) -> Mapping[str, Any] | None:
        """The review as soon as it is there."""
        return self._payload

    def _review(
        self,
        trial: tuple[str, float, float],
        protocol: Protocol,
        curve: str,
        pauses: tuple[tuple[float, float], ...],
    ) -> None:
        _, onset, end = trial
        try:
            rows = self._tracking.past(onset - tapping.MARGIN, end + tapping.MARGIN)
            stretch = (onset, end, pauses)
            blocks = self._tracking.samples(onset)
            found = review(rows, blocks, protocol, curve, stretch, self._geometry, self._earlier)
        except Exception:  # the trial can be kept without its review
            log.exception("a trial could not be reviewed")
            found = None
        if self._of == trial:
            self._payload, self._count = found, self._count + 1
            self.number = self._count
