"""Reaching in metres: where the hand went, seen from the trunk, and what the trunk did meanwhile; only where a magnet gives the hand's position.

In      a trajectory with the hand's place and the trunk's orientation, the stretches in which a reach was called
Out     per reach: straight distance, way, straightness, peak speed, smoothness, lean and turn of the trunk, how far leaning carried it forward; of all:
        farthest place, volume reached
Source  straightness as the way over the straight distance, trunk compensation: Levin et al. 2002, Exp Brain Res 143:171; Subramanian et al. 2010,
        Stroke 41:2303 (there of markers, the trunk by its displacement); SPARC and LDLJ: smoothness.py; volume: convex hull, its standard
        deviation from its corners', taken as independent
Limits  a place is the hand's against the trunk: the forward movement by the trunk is not in it, but a figure of its own (trunk_displacement.py)
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import PLACE_WORDS, PlaceFlag, Trajectory
from handscope.estimators.measures.figure import TRUSTED, USABLE, Figure, Grade, Kind, kinds, worse
from handscope.estimators.measures.signals import resample_even
from handscope.estimators.measures.smoothness import movement_units
from handscope.estimators.measures.trunk_displacement import TrunkParams, displacement
from handscope.estimators.messages.sentence import join, phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

LEVIN = "Levin 2002 (Exp Brain Res 143:171)"
DRINKING = phrase("figure_source.drinking_place")
OF_PLACE = phrase("figure_source.sparc_place")
NO_MAGNET = phrase("measure.place_unknown")
NO_HEIGHT = phrase("measure.trunk_height_range")
UNKNOWN = np.uint8(PlaceFlag.MISSING | PlaceFlag.OUT_OF_REACH | PlaceFlag.DOUBTFUL)
FEWEST = 8  # samples of a way

KINDS = kinds(
    Kind("reach_distance", "m", phrase("figure_meaning.reach_distance"), phrase("figure_source.ours")),
    Kind("reach_way", "m", phrase("figure_meaning.reach_way"), phrase("figure_source.speed_integral")),
    Kind("reach_straightness", "1", phrase("figure_meaning.reach_straightness"), LEVIN),
    Kind("reach_hand_speed", "m/s", phrase("figure_meaning.reach_hand_speed"), phrase("figure_source.ours")),
    Kind("reach_hand_sparc", "1", phrase("figure_meaning.reach_hand_sparc"), OF_PLACE),
    Kind("reach_hand_ldlj", "1", phrase("figure_meaning.reach_hand_ldlj"), OF_PLACE),
    Kind("reach_hand_units", "1", phrase("figure_meaning.reach_hand_units"), DRINKING),
    Kind("reach_trunk_lean", "rad", phrase("figure_meaning.reach_trunk_lean"), LEVIN),
    Kind("reach_trunk_turn", "rad", phrase("figure_meaning.reach_trunk_turn"), LEVIN),
    Kind("reach_trunk_forward", "m", phrase("figure_meaning.reach_trunk_forward"), LEVIN),
    Kind("reach_farthest", "m", phrase("figure_meaning.reach_farthest"), phrase("figure_source.ours")),
    Kind("reach_volume", "m^3", phrase("figure_meaning.reach_volume"), phrase("figure_source.ours")),
    Kind("reach_signal", "dB", phrase("figure_meaning.reach_signal"), phrase("figure_source.thesis_5_23")),
)  # fmt: skip
OF_EACH = (
    "distance",
    "way",
    "straightness",
    "hand_speed",
    "hand_sparc",
    "hand_ldlj",
    "hand_units",
    "trunk_lean",
    "trunk_turn",
    "trunk_forward",
)


@dataclass(frozen=True, kw_only=True)
class PlaceMeasure(TrunkParams):
    """How places are looked at."""

    least_peak_speed: float = option(
        0.05,
        "m/s",
        "a peak speed of the hand against the trunk below this is no reach",
        "ours",
        earlier="smallest_way",
    )
    smoothed: float = option(
        6.0,
        "Hz",
        "what is faster in the hand's place is taken for noise",
        "ours: human reaches end at about 5 Hz",
        least=2.0,
    )

    unit_rise: float = option(
        0.02, "m/s", "growth of the hand's speed that makes a movement unit", DRINKING, least=0.001
    )
    unit_interval: float = option(
        0.15,
        "s",
        "least time between the peaks of two movement units",
        DRINKING,
        earlier="unit_apart",
    )


@dataclass(frozen=True)
class ReachPlace:
    """Places of one reach."""

    onset: float  # s
    end: float  # s
    values: Mapping[str, float]  # by what, without reach_
    own_sd: Mapping[str, float]  # of the instrument


@dataclass(frozen=True)
class ReachPlaces:
    """What the places of a task tell."""

    ways: tuple[ReachPlace, ...]
    # farthest, volume, signal with the instrument's standard deviation
    whole: Mapping[str, tuple[float, float | None]]
    grade: Grade
    reason: str
    t: Array  # (n,) s
    distance: Array  # (n,) m from the trunk
    forward: Array  # (n,) m that leaning has carried the trunk's sensor since the first reach was called; NaN where its orientation is not known
    height: str = ""  # of the trunk's sensor, with which the trunk's displacement was reckoned


# s, s, and time, path, peak_speed, sparc, ldlj, of a speed
Found = tuple[float, float, Mapping[str, float]]
OfSpeed = Callable[[Array, Array, float], Found | None]


def measure_places(
    params: PlaceMeasure,
    part: Trajectory,
    spans: Sequence[tuple[float, float]],
    of_speed: OfSpeed,
    height: float | None = None,
) -> ReachPlaces | None:
    """What the places say of every stretch that was called; None where there is no magnet.

    `of_speed` finds one reach in a speed; `height` of the trunk's sensor above the hips, m, where it was measured, NaN where the declared value is no number.
    """
    if (
        part.place is None
        or part.place_sd is None
        or part.place_flags is None
        or part.q_trunk is None
        or part.q_trunk_sd is None
    ):
        return None
    good = ((part.place_flags & UNKNOWN) == 0) & np.isfinite(part.place).all(axis=1)
    grade, reason = _grade_places(part)
    distance = np.where(good, np.linalg.norm(part.place, axis=1), np.nan)
    forward = _forward_displacement(params, part, spans, height)
    if grade == "poor" or good.sum() < FEWEST:
        return ReachPlaces(
            (),
            {},
            "poor",
            reason or phrase("measure.place_out_of_reach"),
            part.t,
            distance,
            forward,
        )
    measured = [
        w for a, b in spans if (w := _measure_place(params, part, good, a, b, of_speed, height))
    ]
    return ReachPlaces(
        tuple(measured),
        _whole_reach(part, good),
        grade,
        reason,
        part.t,
        distance,
        forward,
        _describe_height(params, height),
    )


def figures(where: ReachPlaces | None) -> list[Figure]:
    """Means over the reaches with the standard error of their scatter and the instrument's; NaN with the reason where not measured."""
    made = []
    for what, kind in ((k.what.removeprefix("reach_"), k) for k in KINDS.values()):
        if where is None:
            made.append(kind.of(np.nan, None, "poor", NO_MAGNET))
        elif what in OF_EACH:
            if (
                what == "trunk_forward"
                and where.ways
                and not np.isfinite([w.values[what] for w in where.ways]).any()
            ):
                made.append(kind.of(np.nan, None, "poor", NO_HEIGHT))
                continue
            each = np.array([w.values[what] for w in where.ways if np.isfinite(w.values[what])])
            own = [w.own_sd[what] for w in where.ways if what in w.own_sd]
            grade, reason = _grade(where, bool(len(each)))
            reason = join([reason, where.height if what == "trunk_forward" and len(each) else ""])
            made.append(
                kind.of(float(each.mean()) if len(each) else np.nan, _sd(each, own), grade, reason)
            )
        else:
            value, sd = where.whole.get(what, (np.nan, None))
            made.append(kind.of(value, sd, *_grade(where, bool(np.isfinite(value)))))
    return made


def _describe_height(params: PlaceMeasure, height: float | None) -> str:
    """With which height the trunk's displacement was reckoned."""
    if height is None:
        return phrase("measure.trunk_height_assumed", height=1e3 * params.trunk_height)
    return phrase("measure.trunk_height_used", height=1e3 * height)


def _grade(where: ReachPlaces, known: bool) -> tuple[Grade, str]:
    return (
        (where.grade, where.reason)
        if known or where.reason
        else ("poor", phrase("measure.place_unchanged"))
    )


def _sd(each: Array, own: Sequence[float]) -> float | None:
    """Scatter of the reaches and what the instrument is off by, which does not average out."""
    scatter = float(each.std(ddof=1) / np.sqrt(len(each))) if len(each) > 1 else None
    instrument = float(np.mean(own)) if own else None
    return (
        None
        if scatter is None and instrument is None
        else float(np.hypot(scatter or 0.0, instrument or 0.0))
    )


def _grade_places(part: Trajectory) -> tuple[Grade, str]:
    """Grade of the places, by the share of samples with each flag."""
    assert part.place_flags is not None
    grades: list[tuple[Grade, str]] = [("good", "")]
    for flag, words in PLACE_WORDS.items():
        share = float(((part.place_flags & flag) != 0).mean())
        if share > 0.005:
            grades.append(
                (
                    "good" if share <= TRUSTED else "fair" if share <= USABLE else "poor",
                    phrase("measure.share_of_samples", what=words, share=100 * share),
                )
            )
    return worse(*grades)


def _measure_place(
    params: PlaceMeasure,
    part: Trajectory,
    good: Array,
    onset: float,
    end: float,
    of_speed: OfSpeed,
    height: float | None,
) -> ReachPlace | None:
    """One reach; None where nothing moved or its place is not known throughout."""
    assert (
        part.place is not None
        and part.place_sd is not None
        and part.q_trunk is not None
        and part.q_trunk_sd is not None
    )
    inside = (part.t >= onset) & (part.t <= end)
    if inside.sum() < FEWEST or not good[inside].all():
        return None
    t = part.t[inside]
    axes = [resample_even(t, v, lowpass=params.smoothed) for v in part.place[inside].T]
    place, grid = np.stack([a.values for a in axes], axis=1), axes[0].t
    speed = np.linalg.norm(np.stack([a.slope() for a in axes], axis=1), axis=1)
    found = of_speed(grid, speed, params.least_peak_speed)
    if found is None:
        return None
    a, b, profile = found
    first, last = np.searchsorted(grid, [a - 1e-9, b - 1e-9])
    k = np.flatnonzero(inside)
    here, there = (
        int(k[np.searchsorted(t, a - 1e-9)]),
        int(k[min(int(np.searchsorted(t, b - 1e-9)), len(t) - 1)]),
    )
    across = place[last] - place[first]
    distance = float(np.linalg.norm(across))
    toward = across / max(distance, 1e-9)
    sd = float(np.sqrt(((toward * part.place_sd[[here, there]]) ** 2).sum()))
    rows = slice(here, there + 1)
    lean, turn, turned = _trunk_change(part, rows)
    carried = displacement(params, part.q_trunk[rows], part.q_trunk_sd[rows], height)
    share = sd / max(distance, 1e-9)
    values = {
        "distance": distance,
        "way": profile["path"],
        "straightness": profile["path"] / max(distance, 1e-9),
        "hand_speed": profile["peak_speed"],
        "hand_sparc": profile["sparc"],
        "hand_ldlj": profile["ldlj"],
        "hand_units": float(
            movement_units(
                speed[first : last + 1],
                1.0 / axes[0].period,
                params.unit_rise,
                params.unit_interval,
            )
        ),
        "trunk_lean": lean,
        "trunk_turn": turn,
        "trunk_forward": float(carried.forward[-1]),
    }
    own = {
        "distance": sd,
        "way": share * profile["path"],
        "hand_speed": share * profile["peak_speed"],
        "trunk_lean": turned,
        "trunk_turn": turned,
        "trunk_forward": float(carried.sd[-1]),
    }
    return ReachPlace(a, b, values, own)


def _forward_displacement(
    params: PlaceMeasure,
    part: Trajectory,
    spans: Sequence[tuple[float, float]],
    height: float | None,
) -> Array:
    """How far leaning has carried the trunk's sensor since the first of the spans begins (n,); NaN before, and where nothing is known."""
    assert part.q_trunk is not None and part.q_trunk_sd is not None
    known = np.flatnonzero(
        np.isfinite(part.q_trunk).all(axis=1)
        & (part.t >= min((a for a, _ in spans), default=np.inf))
    )
    forward = np.full(len(part), np.nan)
    if len(known):
        forward[known] = displacement(
            params, part.q_trunk[known], part.q_trunk_sd[known], height
        ).forward
    return forward


def _trunk_change(part: Trajectory, rows: slice) -> tuple[float, float, float]:
    """Largest change of inclination and of heading from the first of the rows, and the standard deviation of either, rad."""
    assert part.q_trunk is not None and part.q_trunk_sd is not None
    q = part.q_trunk[rows]
    up = quat.rotate(quat.conjugate(q), np.tile([0.0, 0.0, 1.0], (len(q), 1)))
    lean = np.arccos(np.clip(up @ up[0], -1.0, 1.0))
    turn = np.abs(quat.twist(quat.multiply(q, np.tile(quat.conjugate(q[0]), (len(q), 1))), 2))
    sd = float(np.nanmean(part.q_trunk_sd[rows]))
    return float(np.nanmax(lean)), float(np.nanmax(turn)), sd


def _whole_reach(part: Trajectory, good: Array) -> dict[str, tuple[float, float | None]]:
    assert part.place is not None and part.place_sd is not None
    place, sd = part.place[good], part.place_sd[good]
    distance = np.linalg.norm(place, axis=1)
    k = int(distance.argmax())
    changes: dict[str, tuple[float, float | None]] = {
        "farthest": (
            float(distance[k]),
            float(np.sqrt(((place[k] / distance[k] * sd[k]) ** 2).sum())),
        ),
        "volume": hull_volume(place, sd),
    }
    if part.signal is not None and np.isfinite(part.signal).any():
        changes["signal"] = float(np.nanmedian(part.signal)), None
    return changes


def hull_volume(place: Array, sd: Array) -> tuple[float, float | None]:
    """Volume m^3 of the convex hull of places (n, 3) m with standard deviations (n, 3) m, and its own; NaN of what lies in a plane."""
    try:
        hull = ConvexHull(place)
    except QhullError:
        return float("nan"), None
    middle = place[hull.vertices].mean(axis=0)
    slope = np.zeros_like(place)
    for corners, outward in zip(hull.simplices, hull.equations[:, :3]):
        a, b, c = place[corners] - middle
        sign = 1.0 if np.cross(b - a, c - a) @ outward > 0 else -1.0
        for k, (v, w) in zip(corners, ((b, c), (c, a), (a, b))):
            slope[k] += sign * np.cross(v, w) / 6.0
    return float(hull.volume), float(np.sqrt(((slope * sd) ** 2).sum()))
