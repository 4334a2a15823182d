"""Kapandji score of thumb opposition: which of the ten places its tip or pad reaches, 0 to 10.

In      a trajectory, the stretch of time of the task, the hand's geometry; marks position_1 to position_10 where the places were called
Out     the highest place reached, the smallest distance to each, palmar abduction and pronation of the metacarpal meanwhile
Source  Kapandji 1986 (Ann Chir Main 5:67): 1 side of the index's middle, 2 of its last phalanx, 3 to 6 tips of index to little finger, 7, 8, 9 the little finger's
        DIP, PIP and MCP crease, 10 the distal palmar crease; valid only if the first places are possible. Beside it the angles, because the score levels off
        at about 6 (J Hand Surg Eur 2019, 44:728). Where the creases lie, and the tolerance, are ours
Limits  an estimate that a clinician confirms by eye: the glove's fingertips are off by 5 to 20 mm, neighbouring places are 20 mm apart
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.fingertip_contacts import FINGERTIPS, contact_points, offset
from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand import forward_kinematics, joint_angles
from handscope.estimators.hand.anatomy import (
    CHAINS,
    FINGER_JOINTS,
    FINGERS,
    FLEXION,
    IS_DOF,
    JOINT,
    PRONATION,
    SEGMENT,
    side_sign,
)
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures.figure import Figure, Grade, Kind, kinds
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import (
    grade_window,
    running_median,
    task_samples,
    usable_samples,
    window_length,
)
from handscope.estimators.messages.sentence import join, phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

TITLE = phrase("measure_title.kapandji")
KAPANDJI = "Kapandji 1986 (Ann Chir Main 5:67)"
PLACES = 10
# m, skin below the MCP joint's centre; distal palmar crease nearer to the wrist than that: ours
CREASE = 0.012, 0.010
ESTIMATED = phrase("measure.estimated_from_distances")
CRAWLING = phrase("measure.thumb_crawls")
KINDS = kinds(
    Kind("kapandji_score", "1", phrase("figure_meaning.kapandji_score"), KAPANDJI),
    Kind(
        "kapandji_distance",
        "m",
        phrase("figure_meaning.kapandji_distance"),
        join((KAPANDJI, phrase("figure_source.own_landmarks"))),
    ),
    Kind(
        "opposition_abduction",
        "rad",
        phrase("figure_meaning.opposition_abduction"),
        "J Hand Surg Eur 2019, 44:728",
    ),
    Kind(
        "opposition_pronation",
        "rad",
        phrase("figure_meaning.opposition_pronation"),
        "J Hand Surg Eur 2019, 44:728",
    ),
)


@dataclass(frozen=True, kw_only=True)
class Params:
    """Options of the measure: holding time in s, tolerance in mm."""

    hold: float = option(
        0.2,
        "s",
        "window of the running median: a contact counts when it lasts half of this",
        "ours: as range_of_motion",
    )
    tolerance: float = option(
        0.020,
        "m",
        "nearer than this counts as reached",
        "Salchow-Hoemmen 2019: fingertip distances are off by 5 to 20 mm in a clinic's field",
        most=0.1,
    )


@dataclass(frozen=True)
class Opposition:
    """Places are numbered from 1."""

    score: float  # NaN where it could not be measured
    score_sd: float
    distances: dict[int, float]  # m
    sd: float | None  # m
    abduction: float  # rad
    pronation: float
    angle_sd: float | None
    grade: Grade
    reason: str
    curves: tuple[Curve, ...] = ()


def applies(task_name: str) -> bool:
    """Whether a task's name asks for this measure."""
    return bool(words_of(task_name) & {"kapandji", "opposition"})


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> Opposition:
    """The places reached; each is looked for where it was called, if it was."""
    part = task_samples(trajectory, onset, end)
    if geometry is None or len(part) < 3:
        return _nothing(
            phrase("measure.geometry_unknown") if len(part) else phrase("measure.no_samples")
        )
    window = window_length(part.t, params.hold)
    gaps, needed = (
        distances(part.angles, geometry),
        [SEGMENT["hand"], *(SEGMENT[s] for s in CHAINS["thumb"])],
    )
    usable, found = usable_samples(part, needed), {}
    for k in range(1, PLACES + 1):
        called = [(m.onset, m.end) for m in asked.marks if m.phase == f"position_{k}"]
        inside = (
            np.any([(part.t >= a) & (part.t <= b) for a, b in called], axis=0)
            if called
            else np.ones(len(part), bool)
        )
        kept = running_median(np.where(inside, gaps[:, k - 1], np.nan), usable, window)
        if kept is not None:
            found[k] = float(np.nanmin(kept))
    if not found:
        return _nothing(phrase("measure.thumb_or_fingers_not_measured"))
    grade, reason = grade_window(part, needed)
    score, crawling = score_of(found, params.tolerance)
    bounds = [score_of(found, share * params.tolerance)[0] for share in (0.8, 1.2)]
    reasons = join([reason, ESTIMATED, CRAWLING if crawling else ""])
    cmc = part.angles[:, JOINT["thumb_cmc"]]
    turned = [running_median(cmc[:, a], usable, window) for a in (FLEXION, PRONATION)]
    abduction, pronation = (float(np.nanmax(v)) if v is not None else np.nan for v in turned)
    sd = (
        None
        if part.tips_sd is None
        else float(np.nanmean(part.tips_sd[:, FINGERS.index("thumb")])) * np.sqrt(2.0)
    )
    angle_sd = (
        None
        if part.angles_sd is None
        else float(np.nanmean(part.angles_sd[:, JOINT["thumb_cmc"], FLEXION]))
    )
    curves = tuple(Curve(f"position_{k}_distance", "m", part.t, gaps[:, k - 1]) for k in found)
    fair: Grade = "fair" if grade == "good" else grade
    return Opposition(
        float(score),
        0.5 * abs(bounds[1] - bounds[0]),
        found,
        sd,
        abduction,
        pronation,
        angle_sd,
        fair,
        reasons,
        curves,
    )


def score_of(smallest: dict[int, float], tolerance: float) -> tuple[int, bool]:
    """The highest place within the tolerance, from the smallest distance (m) to each; 0, and why, where only later ones than the third are."""
    reached = [k for k, d in smallest.items() if d <= tolerance]
    if not reached:
        return 0, False
    crawling = not any(k <= 3 for k in reached) and any(k in smallest for k in (1, 2, 3))
    return (0, True) if crawling else (max(reached), False)


def distances(angles: Array, geometry: HandGeometry) -> Array:
    """From the thumb's tip or pad, whichever is nearer, to every place (n, 10), m; NaN where a finger is not measured."""
    thumb = np.stack(
        [
            contact_points(angles, geometry, "thumb", p, FINGERTIPS["thumb"])
            for p in ("distal", "bottom")
        ],
        axis=1,
    )
    places = landmarks(angles, geometry)
    return np.asarray(
        np.sqrt(((thumb[:, :, None] - places[:, None]) ** 2).sum(axis=-1)).min(axis=1)
    )


def landmarks(angles: Array, geometry: HandGeometry) -> Array:
    """Kapandji's ten places (n, 10, 3) on the hand in WCS, m."""
    q_pc = joint_angles.compose(np.where(IS_DOF, angles, 0.0))
    unknown = np.asarray((np.isnan(angles) & IS_DOF).any(axis=-1))
    unknown[:, JOINT["wrist"]] = False
    q_pc = np.where(np.isnan(q_pc), quat.IDENTITY, q_pc)
    ends = forward_kinematics.joint_places(q_pc, geometry)  # (n, finger, segment, 3)
    wrist = q_pc[:, JOINT["wrist"]]
    index, little = FINGERS.index("index"), FINGERS.index("little")
    sign = side_sign(geometry.hand)
    q_middle, q_distal = (_orientation(q_pc, "index", k) for k in (2, 3))
    beside = offset(geometry, "index", "right", FINGERTIPS["index"])
    below = offset(geometry, "little", "bottom", FINGERTIPS["little"])
    mcp = quat.rotate(wrist, np.asarray(geometry.joint_positions["little_mcp"]))
    skin, back = (
        quat.rotate(wrist, sign * np.array(v))
        for v in ((-CREASE[0], 0.0, 0.0), (0.0, -CREASE[1], 0.0))
    )
    places = [
        0.5 * (ends[:, index, 0] + ends[:, index, 1]) + quat.rotate(q_middle, beside),
        0.5 * (ends[:, index, 1] + ends[:, index, 2]) + quat.rotate(q_distal, beside),
        *(contact_points(angles, geometry, f, "distal", FINGERTIPS[f]) for f in FINGERS[1:]),
        ends[:, little, 1] + quat.rotate(_orientation(q_pc, "little", 2), below),
        ends[:, little, 0] + quat.rotate(_orientation(q_pc, "little", 1), below),
        mcp + skin,
        mcp + skin + back,
    ]
    needs = [
        *[("index", 3)] * 2,
        *((f, 3) for f in FINGERS[1:]),
        ("little", 2),
        ("little", 1),
        ("little", 0),
        ("little", 0),
    ]
    lost = np.stack(
        [unknown[:, [JOINT[j] for j in FINGER_JOINTS[f][:k]]].any(axis=1) for f, k in needs], axis=1
    )
    return np.where(lost[:, :, None], np.nan, np.stack(places, axis=1))


def figures(o: Opposition) -> list[Figure]:
    """The flat list of figures; a distance's part is its place."""
    graded = (o.grade, o.reason)
    made = [KINDS["kapandji_score"].of(o.score, o.score_sd, *graded)]
    made += [
        KINDS["kapandji_distance"].of(d, o.sd, *graded, f"position_{k}")
        for k, d in o.distances.items()
    ]
    made.append(KINDS["opposition_abduction"].of(o.abduction, o.angle_sd, *graded))
    return [*made, KINDS["opposition_pronation"].of(o.pronation, o.angle_sd, *graded)]


def shown(o: Opposition) -> PlotData:
    """The distances to all places over time."""
    return PlotData(o.curves)


def _orientation(q_pc: Array, finger: str, joints: int) -> Array:
    """Of the segment behind the first `joints` joints of a finger, in WCS (n, 4)."""
    q = q_pc[:, JOINT["wrist"]]
    for name in FINGER_JOINTS[finger][:joints]:
        q = quat.multiply(q, q_pc[:, JOINT[name]])
    return q


def _nothing(reason: str) -> Opposition:
    return Opposition(np.nan, 0.0, {}, None, np.nan, np.nan, None, "poor", reason)
