"""Finger independence: how far one finger bends without its neighbours.

In      a trajectory, the stretch of time of the task, which finger was asked for and when: marks named after fingers, or the task's name or details
Out     per finger asked for: individuation index, enslaving of every neighbour, range of independent movement
Source  summed range, enslaving, its onset (5 deg) and the range until then: van den Noort 2016 (PLoS ONE 0168636); individuation index: Schieber 1991
        (J Neurophysiol 65:1381), 1 - (sum of the slopes' sizes - 1) / (n - 1) over n fingers, slopes by least squares on the finger asked for
Limits  of the flexions of MCP, PIP and DIP (thumb: MCP and IP) added up; a finger that was not measured is left out
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, FLEXION, JOINT, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures.figure import Figure, Grade, Kind, grade_of, kinds
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import task_samples
from handscope.estimators.measures.total_active_motion import TAM_JOINTS
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

TITLE = phrase("measure_title.finger_independence")
DEG = np.pi / 180
NOORT = "van den Noort 2016 (PLoS ONE 0168636)"
KINDS = kinds(
    Kind("sum_range", "rad", phrase("figure_meaning.sum_range"), NOORT),
    Kind(
        "individuation_index",
        "1",
        phrase("figure_meaning.individuation_index"),
        "Schieber 1991 (J Neurophysiol 65:1381)",
    ),
    Kind(
        "enslaving_share",
        "1",
        phrase("figure_meaning.enslaving_share"),
        NOORT,
    ),
    Kind(
        "independent_share",
        "1",
        phrase("figure_meaning.independent_share"),
        NOORT,
    ),
)


@dataclass(frozen=True, kw_only=True)
class Params:
    """Options of the measure; angles in deg."""

    onset: float = option(
        5 * DEG, "rad", "a finger that moved further than this is enslaved", NOORT
    )
    smallest: float = option(
        20 * DEG,
        "rad",
        "a finger asked for that bent less has no index",
        "ours: four times the onset",
    )


@dataclass(frozen=True)
class FingerIndependence:
    """One finger asked for."""

    finger: str
    others: tuple[str, ...]  # the others measured
    sum_range: float  # rad
    index: float
    index_sd: float | None
    enslaving: dict[str, float]  # of its neighbours
    independent: float
    sd: float | None  # rad, of a summed flexion
    grade: Grade
    reason: str
    curves: tuple[Curve, ...] = ()


def applies(task_name: str) -> bool:
    """Whether a task's name asks for this measure."""
    return bool(words_of(task_name) & {"independence", "individuation"})


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> list[FingerIndependence]:
    """Every finger asked for; its rounds together. Without a word of which, the finger that bent furthest."""
    part = task_samples(trajectory, onset, end)
    joints = {f: [JOINT[j] for j in TAM_JOINTS[f]] for f in FINGERS}
    sums = {f: part.angles[:, joints[f], FLEXION].sum(axis=1) for f in FINGERS} if len(part) else {}
    sums = {f: s for f, s in sums.items() if np.isfinite(s).sum() >= 3}
    if len(sums) < 2:
        return []
    rounds = {
        f: [(m.onset, m.end) for m in asked.marks if m.phase == f]
        for f in FINGERS
        if any(m.phase == f for m in asked.marks)
    }
    if not rounds:
        named = [f for f in asked.fingers() if f in sums] or [
            max(sums, key=lambda f: float(np.ptp(sums[f][np.isfinite(sums[f])])))
        ]
        rounds = {f: [(onset, end)] for f in named}
    found = []
    for finger, spans in rounds.items():
        inside = np.any([(part.t >= a) & (part.t <= b) for a, b in spans], axis=0)
        if finger not in sums or inside.sum() < 3:
            continue
        segments = [SEGMENT["hand"], *(SEGMENT[s] for f in sums for s in CHAINS[f])]
        graded = grade_of(part.flags[inside][:, segments])
        sd = None
        if part.angles_sd is not None:
            sd = float(
                np.sqrt((part.angles_sd[:, joints[finger], FLEXION] ** 2).mean(axis=0).sum())
            )
        found.append(
            of_sums(
                finger, {f: s[inside] for f, s in sums.items()}, params, sd, part.t[inside], graded
            )
        )
    return found


def of_sums(
    finger: str,
    sums: dict[str, Array],
    params: Params | None = None,
    sd: float | None = None,
    t: Array | None = None,
    graded: tuple[Grade, str] = ("good", ""),
) -> FingerIndependence:
    """A finger asked for, from the summed flexions (n,) in rad of all fingers, by finger."""
    params = params or Params()
    if finger not in sums or len({len(s) for s in sums.values()}) != 1 or len(sums) < 2:
        raise InputError("measure.sums_shape", sums=str(sorted(sums)), finger=finger)
    known = np.all([np.isfinite(s) for s in sums.values()], axis=0)
    kept = {f: np.asarray(s, float)[known] for f, s in sums.items()}
    others = tuple(f for f in FINGERS if f in kept and f != finger)
    curves = () if t is None else tuple(Curve(f"{f}_sum", "rad", t, s) for f, s in sums.items())
    own = kept[finger] - kept[finger].min() if known.any() else np.zeros(0)
    extent = float(np.ptp(own)) if len(own) else 0.0
    if extent < params.smallest:
        return FingerIndependence(
            finger,
            others,
            extent,
            np.nan,
            None,
            {},
            np.nan,
            sd,
            "poor",
            phrase("measure.bent_too_little", size=params.smallest / DEG),
            curves,
        )
    slopes, errors = np.array([_slope(own, kept[f]) for f in others]).T
    index = 1.0 - float(np.abs(slopes).sum()) / len(others)  # the finger's own slope is 1
    index_sd = float(np.sqrt((errors**2).sum())) / len(others)
    if sd is not None:  # an error of both ranges' ends, independent
        index_sd = float(
            np.hypot(
                index_sd,
                np.sqrt(2.0 * (len(others) + (slopes**2).sum())) * sd / extent / len(others),
            )
        )
    here = FINGERS.index(finger)
    neighbours = [f for f in others if abs(FINGERS.index(f) - here) == 1]
    enslaving = {f: float(np.ptp(kept[f])) / extent for f in neighbours}
    return FingerIndependence(
        finger,
        others,
        extent,
        index,
        index_sd,
        enslaving,
        _independent(params, own, [kept[f] for f in others]),
        sd,
        *graded,
        curves,
    )


def figures(found: list[FingerIndependence]) -> list[Figure]:
    """The flat list of figures; an enslaving is named after both fingers, the one asked for first."""
    made = []
    for a in found:
        graded = (a.grade, a.reason)
        range_sd = None if a.sd is None else float(np.sqrt(2.0) * a.sd)
        share_sd = None if range_sd is None or not a.sum_range else range_sd / a.sum_range
        made.append(KINDS["sum_range"].of(a.sum_range, range_sd, *graded, a.finger))
        made.append(KINDS["individuation_index"].of(a.index, a.index_sd, *graded, a.finger))
        made.append(KINDS["independent_share"].of(a.independent, share_sd, *graded, a.finger))
        for other, share in a.enslaving.items():
            sd = None if share_sd is None else float(share_sd * np.hypot(1.0, share))
            made.append(KINDS["enslaving_share"].of(share, sd, *graded, f"{a.finger}_{other}"))
    return made


def shown(found: list[FingerIndependence]) -> PlotData:
    """The summed flexions of all fingers, round by round."""
    return PlotData(
        tuple(
            c
            for a in found
            for c in a.curves
            if c.name in {f"{f}_sum" for f in (a.finger, *a.others)}
        )
    )


def _slope(own: Array, other: Array) -> tuple[float, float]:
    """Least squares of another finger on the one asked for, and its standard error."""
    x, y = own - own.mean(), other - other.mean()
    slope = float(x @ y / (x @ x))
    left = y - slope * x
    return slope, float(np.sqrt(left @ left / max(len(x) - 2, 1) / (x @ x)))


def _independent(params: Params, own: Array, others: Sequence[Array]) -> float:
    """How far the finger had bent, of its range, until the first sample at which another had moved by more than `onset`; 1 where none did."""
    moved = np.max([np.abs(o - o[0]) for o in others], axis=0) > params.onset
    until = own[: int(np.argmax(moved)) + 1] if moved.any() else own
    return float(until.max() / own.max())
