"""Total active motion of a finger: how far all its joints bend together in a fist, less what each stays behind straight when all are stretched.

In      a trajectory and the stretch of time in which fist and stretch were made, at least once, all fingers together
Out     per finger TAF, TAM, its share of the norm with the word of a grading scheme, extension deficit and hyperextension of every joint
Source  ASSH: sum of active flexion of MCP, PIP and DIP in a fist less the sum of extension deficits with all stretched (HandLab Clinical Pearl 18, 2012);
        TAF the first sum alone; thumb: MCP and IP (eatonhand.com clf217). The instants are ours: where the sum's running median is largest, and where
        it is smallest after the first fist (asked_extension.py)
Limits  a fist does not ask for full flexion of the thumb: it has no word of a grading there, only where the task names it;
        hyperextension counts as zero and has a figure of its own; joints moved one by one give no TAM: AMA Guides Newsletter 7(3):8 has 16 % against 61 % for one hand
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import (
    CHAINS,
    FINGER_JOINTS,
    FINGERS,
    FLEXION,
    JOINT,
    SEGMENT,
)
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures.asked_extension import asks_fist_and_stretch, first_fist_end
from handscope.estimators.measures.figure import Figure, Grade, Kind, kinds
from handscope.estimators.measures.plot_data import NOTHING, PlotData
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest
from handscope.estimators.measures.time_window import (
    grade_window,
    least_from,
    running_median,
    task_samples,
    usable_samples,
    window_length,
)
from handscope.estimators.messages.sentence import join, phrase

TITLE = phrase("measure_title.total_active_motion")
DEG = np.pi / 180
ASSH = phrase("figure_source.assh")
EATONHAND = phrase("figure_source.eatonhand")
STRICKLAND = phrase("figure_source.strickland")
BURN = phrase("figure_source.burn")
# ASSH: 85 + 110 + 65; thumb: the top of eatonhand's degrees
NORM = {"thumb": 140 * DEG} | dict.fromkeys(FINGERS[1:], 260 * DEG)
TAM_JOINTS = {f: tuple(j for j in FINGER_JOINTS[f] if j != "thumb_cmc") for f in FINGERS}
GRADINGS: Mapping[str, str] = {  # scheme and who says so
    "assh": ASSH,
    "eatonhand": EATONHAND,
    "eatonhand_degrees": EATONHAND,
    "strickland": STRICKLAND,
    "burn": BURN,
}
GRADES = ("excellent", "good", "fair", "poor")
KINDS = kinds(
    Kind(
        "taf",
        "rad",
        phrase("figure_meaning.taf"),
        join((phrase("figure_source.assh_taf"), ASSH)),
    ),
    Kind(
        "tam",
        "rad",
        phrase("figure_meaning.tam"),
        ASSH,
    ),
    Kind(
        "tam_share",
        "1",
        phrase("figure_meaning.tam_share"),
        join((ASSH, phrase("figure_source.eatonhand_thumb"))),
    ),
    Kind(
        "composite_flexion",
        "rad",
        phrase("figure_meaning.composite_flexion"),
        ASSH,
        detail=True,
    ),
    Kind(
        "extension_deficit",
        "rad",
        phrase("figure_meaning.extension_deficit"),
        ASSH,
        detail=True,
    ),
    Kind(
        "hyperextension",
        "rad",
        phrase("figure_meaning.hyperextension"),
        phrase("figure_source.tam_zero"),
        detail=True,
    ),
)


@dataclass(frozen=True, kw_only=True)
class Params:
    """Options of the measure, and the grading scheme."""

    hold: float = option(
        0.2,
        "s",
        "window of the running median: a posture counts when it lasts half of this",
        "ours: as range_of_motion",
    )
    grading: str = option(
        "assh",
        "",
        "scheme that gives the words: ASSH in per cent, eatonhand in per cent or degrees, Strickland (zone II flexor repair only), burnt hand",
        "HandLab Clinical Pearl 18; eatonhand clf217; Strickland & Glogovac 1980; Johnson",
        choices=tuple(GRADINGS),
    )


@dataclass(frozen=True)
class FingerMotion:
    """One finger; angles in rad by joint, in the order of TAM_JOINTS."""

    finger: str
    flexions: Mapping[str, float]  # in the fist
    extensions: Mapping[str, float]  # flexion that is left when stretched; negative: hyperextension
    flexion_sd: Mapping[str, float]  # empty where not known
    extension_sd: Mapping[str, float]
    t_fist: float  # s
    t_stretch: float  # s
    grade: Grade
    reason: str
    scheme: str = "assh"
    graded: bool = True  # whether the task asked for all of the finger's flexion

    @property
    def deficits(self) -> dict[str, float]:
        return {j: max(0.0, left) for j, left in self.extensions.items()}

    @property
    def taf(self) -> float:
        return float(sum(self.flexions.values()))

    @property
    def tam(self) -> float:
        return self.taf - float(sum(self.deficits.values()))

    @property
    def sd(self) -> float | None:
        """Of TAM: the errors of all angles count as independent; a deficit's counts where it may be one."""
        counted = [
            self.extension_sd[j]
            for j, left in self.extensions.items()
            if j in self.extension_sd and left > -2 * self.extension_sd[j]
        ]
        return (
            float(np.sqrt(sum(s**2 for s in [*self.flexion_sd.values(), *counted])))
            if self.flexion_sd
            else None
        )

    @property
    def taf_sd(self) -> float | None:
        return (
            float(np.sqrt(sum(s**2 for s in self.flexion_sd.values()))) if self.flexion_sd else None
        )


def applies(task_name: str) -> bool:
    """Fists and stretches of all fingers together."""
    return asks_fist_and_stretch(task_name)


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> list[FingerMotion]:
    """Every finger whose joints were all measured."""
    part = task_samples(trajectory, onset, end)
    if len(part) < 3:
        return []
    window, found = window_length(part.t, params.hold), []
    begin = first_fist_end(part, window)
    for finger in FINGERS:
        joints = [JOINT[j] for j in TAM_JOINTS[finger]]
        segments = [
            SEGMENT[s] for s in (CHAINS[finger] if finger == "thumb" else ("hand", *CHAINS[finger]))
        ]
        angles = part.angles[:, joints, FLEXION]
        total = running_median(angles.sum(axis=1), usable_samples(part, segments), window)
        if total is None:
            continue
        fist, stretch = int(np.nanargmax(total)), least_from(begin, total)
        kept = [running_median(a, usable_samples(part, segments), window) for a in angles.T]
        bent, straight = (
            {j: float(k[i]) for j, k in zip(TAM_JOINTS[finger], kept) if k is not None}
            for i in (fist, stretch)
        )
        sds = _sds(part, finger, fist), _sds(part, finger, stretch)
        when = float(part.t[fist]), float(part.t[stretch])
        found.append(
            FingerMotion(
                finger,
                bent,
                straight,
                *sds,
                *when,
                *grade_window(part, segments),
                params.grading,
                finger != "thumb" or finger in asked.fingers(),
            )
        )
    return found


def figures(motions: list[FingerMotion]) -> list[Figure]:
    """The flat list of figures."""
    made = []
    for m in motions:
        norm, sd, graded = NORM[m.finger], m.sd, (m.grade, m.reason)
        made.append(KINDS["taf"].of(m.taf, m.taf_sd, *graded, m.finger))
        made.append(KINDS["tam"].of(m.tam, sd, *graded, m.finger))
        share_sd = None if sd is None else sd / norm
        made.append(
            KINDS["tam_share"].of(
                m.tam / norm,
                share_sd,
                *graded,
                m.finger,
                grade_with_scheme(m.scheme, m) if m.graded else "",
            )
        )
        for joint in m.flexions:
            made.append(
                KINDS["composite_flexion"].of(
                    m.flexions[joint], m.flexion_sd.get(joint), *graded, joint
                )
            )
        for joint, left in m.extensions.items():
            sd_left = m.extension_sd.get(joint)
            made.append(KINDS["extension_deficit"].of(max(0.0, left), sd_left, *graded, joint))
            made.append(KINDS["hyperextension"].of(max(0.0, -left), sd_left, *graded, joint))
    return made


def shown(motions: list[FingerMotion]) -> PlotData:
    """Nothing: a page has the angles themselves."""
    return NOTHING


def grade_with_scheme(scheme: str, m: FingerMotion, other_hand: float | None = None) -> str:
    """What a scheme calls a finger's motion; `other_hand` is the TAM of the uninjured one, rad. "" where the scheme does not cover the finger."""
    degrees, share = round(m.tam / DEG), round(100 * m.tam / (other_hand or NORM[m.finger]))
    match scheme:
        case "assh":  # > 50 fair, < 50 poor: 50 itself stands in neither
            return GRADES[0 if share >= 100 else 1 if share > 75 else 2 if share > 50 else 3]
        case "eatonhand":
            return _grade_by_bands(share, (85, 70, 50))
        case "eatonhand_degrees":
            return _grade_by_bands(
                degrees, (119, 98, 70) if m.finger == "thumb" else (220, 180, 130)
            )
        case "strickland":
            return (
                ""
                if m.finger == "thumb"
                else _grade_by_bands(round(100 * strickland(m)), (85, 70, 50))
            )
        case "burn":
            return (
                ""
                if m.finger == "thumb"
                else "normal"
                if degrees >= 260
                else _grade_by_bands(degrees, (220, 180, 180))
            )
    raise InputError("measure.unknown_grading", name=scheme, gradings=", ".join(GRADINGS))


def regrade(
    figures: Sequence[Figure], scheme: str, other_hand: Mapping[str, float] | None = None
) -> tuple[Figure, ...]:
    """Kept figures of a task with the words of a scheme, its source, and shares of the uninjured hand's TAM (rad, by finger) where that is given."""
    if scheme not in GRADINGS:
        raise InputError("measure.unknown_grading", name=scheme, gradings=", ".join(GRADINGS))
    angles = {(f.what, f.part): f.value for f in figures}
    return tuple(
        _regrade_share(f, scheme, angles, (other_hand or {}).get(f.part))
        if f.what == "tam_share"
        else f
        for f in figures
    )


def _regrade_share(
    share: Figure, scheme: str, angles: Mapping[tuple[str, str], float], other_hand: float | None
) -> Figure:
    joints = [j for j in TAM_JOINTS[share.part] if ("composite_flexion", j) in angles]
    extensions = {j: angles["extension_deficit", j] - angles["hyperextension", j] for j in joints}
    bent = {j: angles["composite_flexion", j] for j in joints}
    m = FingerMotion(
        share.part, bent, extensions, {}, {}, 0.0, 0.0, share.grade, share.reason, scheme
    )
    is_ungraded = share.part == "thumb" and not share.category  # where a kept result has no word
    scale = NORM[share.part] / (other_hand or NORM[share.part])
    sd = None if share.sd is None else share.sd * scale
    return replace(
        share,
        value=share.value * scale,
        sd=sd,
        category="" if is_ungraded else grade_with_scheme(scheme, m, other_hand),
        source=GRADINGS[scheme],
    )


def strickland(m: FingerMotion) -> float:
    """PIP and DIP flexion less their deficits, as a share of 175 deg."""
    ends = [j for j in m.flexions if j.endswith(("_pip", "_dip"))]
    return float(sum(m.flexions[j] - m.deficits[j] for j in ends) / (175 * DEG))


def _grade_by_bands(value: float, bands: tuple[float, float, float]) -> str:
    return next((grade for grade, least in zip(GRADES, bands) if value >= least), "poor")


def _sds(part: Trajectory, finger: str, at: int) -> dict[str, float]:
    if part.angles_sd is None:
        return {}
    return {j: float(part.angles_sd[at, JOINT[j], FLEXION]) for j in TAM_JOINTS[finger]}
