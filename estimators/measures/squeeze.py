"""Squeezing a compliant object: force, number and regularity of squeezes, stiffness and damping of the object.

In      a trajectory with fingertip forces of the thumb and another finger, the stretch of time of the task
Out     squeezes with their forces and depths, shares of the fingers, work, stiffness and damping with their standard deviations
Source  Kortier, thesis ch. 6: (6.6), (6.8), (6.16), (1.15); 6.2.3: a spring compressed eight times
Limits  the stiffness is as accurate as the change of the fingertips' distance: 5 % from person to person in simulation (docs/validation); compliant
        fingertips make the object seem softer
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import find_peaks

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.force import (
    frequency_response,
    grasp_phases,
    load_exchange,
)
from handscope.estimators.force.frequency_response import Conditions, Response
from handscope.estimators.force.grasp_phases import UNREAD, GraspPhase
from handscope.estimators.force.identification import Fit, RunningEstimate
from handscope.estimators.hand.anatomy import FINGER_JOINTS, JOINT, LIMITS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures.figure import Figure, Grade, Kind, kinds, worse
from handscope.estimators.measures.lift import KORTIER, NONE, running_curves, twist_curves
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.measures.signals import resample_even
from handscope.estimators.measures.spring_identification import (
    correlated_share,
    identify_spring,
    running_stiffness,
    stiffness_change,
)
from handscope.estimators.measures.squeeze_options import Params as Params
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import task_samples
from handscope.estimators.messages.sentence import join, phrase
from handscope.estimators.numerics.typing import Array

TITLE = phrase("measure_title.squeeze")
BAND = 1.96  # standard deviations to either side: 95 %
HOLDS, FAILS, OPEN, UNKNOWN_WORD = (
    phrase("squeeze.condition_holds"),
    phrase("squeeze.condition_fails"),
    phrase("squeeze.condition_open"),
    phrase("squeeze.condition_unknown"),
)  # of the conditions of 6.5.1
AT_LIMIT = 1e-3  # rad from an end of its range within which the model holds a joint
FURTHER = phrase("squeeze.joint_at_limit")
TOO_SHORT = phrase("squeeze.too_short")
BENT = phrase("squeeze.not_linear")
KINDS = kinds(
    Kind("squeeze_count", "1", phrase("figure_meaning.squeeze_count"), phrase("figure_source.force_peaks")),
    Kind("squeeze_force", "N", phrase("figure_meaning.squeeze_force"), KORTIER),
    Kind("squeeze_force_cv", "1", phrase("figure_meaning.squeeze_force_cv"), phrase("figure_source.ours")),
    Kind("squeeze_rate", "Hz", phrase("figure_meaning.squeeze_rate"), phrase("figure_source.ours")),
    Kind("squeeze_depth", "m", phrase("figure_meaning.squeeze_depth"), KORTIER),
    Kind("squeeze_stiffness", "N/m", phrase("figure_meaning.squeeze_stiffness"), phrase("figure_source.thesis_6_6_whole")),
    Kind("squeeze_damping", "N s/m", phrase("figure_meaning.squeeze_damping"), phrase("figure_source.thesis_6_6")),
    Kind("squeeze_work", "J", phrase("figure_meaning.squeeze_work"), phrase("figure_source.thesis_1_15")),
    Kind("squeeze_coherence", "1", phrase("figure_meaning.squeeze_coherence"), phrase("figure_source.thesis_6_5_1")),
    Kind("squeeze_force_bandwidth", "Hz", phrase("figure_meaning.squeeze_force_bandwidth"), phrase("figure_source.thesis_6_5_1")),
    Kind("squeeze_object_bandwidth", "Hz", phrase("figure_meaning.squeeze_object_bandwidth"), phrase("figure_source.thesis_6_5_1")),
    Kind("squeeze_lag", "s", phrase("figure_meaning.squeeze_lag"), phrase("figure_source.thesis_6_5_1")),
    Kind("squeeze_share", "1", phrase("figure_meaning.squeeze_share"), KORTIER),
)  # fmt: skip


@dataclass(frozen=True)
class SqueezeGrasp:
    """One grasp with squeezes, on an even time base."""

    held: GraspPhase
    t: Array  # (n,) s
    force: Array  # (n,) N
    distance: Array  # (n,) m
    peaks: Array  # (k,) s
    tops: Array  # (k,) N
    depths: Array  # (k,) m
    work: Array  # (k,) J
    fit: Fit | None  # of K N/m, K p0 N and D N s/m; None where it is not observable
    conditions: Conditions | None
    reason: str
    running: RunningEstimate | None = None  # the stiffness as it stood after each sample
    # share of the grip force that remains along the grip axis: a finger without a sensor may take it
    unobserved: float = 0.0
    bent: float = 0.0  # share by which the stiffness changes over the range of the distance
    answer: Response | None = None  # of the closing, m/N, where the force changes


@dataclass(frozen=True)
class Squeeze:
    """Squeezes with their grasps, graded."""

    params: Params
    measured: bool
    grasps: tuple[SqueezeGrasp, ...]
    grade: Grade
    reason: str


def applies(task_name: str) -> bool:
    """Whether a task's name asks for this measure."""
    return bool({"squeeze", "squeezing"} & words_of(task_name))


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> Squeeze:
    """Every grasp of the stretch in which something was squeezed."""
    part = task_samples(trajectory, onset, end)
    fingers = grasp_phases.measured_fingers(part)
    if not fingers:
        return Squeeze(params, False, (), "poor", NONE)
    if "thumb" not in fingers or len(fingers) < 2:
        return Squeeze(
            params,
            False,
            (),
            "poor",
            phrase("squeeze.sensors_missing"),
        )
    held = grasp_phases.find_grasp_phases(params, part, geometry)
    params = with_calibrated_scale(params, held[0]) if held else params
    further = any(_is_at_joint_limit(part, h) for h in held)
    params = replace(params, gain_sd=max(params.gain_sd, params.further)) if further else params
    found = [made for h in held if (made := _measure_grasp(params, h)) is not None]
    if not found:
        return Squeeze(params, True, (), "poor", phrase("squeeze.nothing_squeezed"))
    grades = [
        ("good" if not one.reason else "fair" if one.fit else "poor", one.reason) for one in found
    ]
    grades += [("fair", FURTHER)] if further else []
    return Squeeze(params, True, tuple(found), *worse(*grades))  # type: ignore[arg-type]


def with_calibrated_scale(params: Params, h: GraspPhase) -> Params:
    """With the forces' scale as well known as the sensors' calibrations say, where they say it."""
    return params if h.squeeze_scale_sd is None else replace(params, scale_sd=h.squeeze_scale_sd)


def _is_at_joint_limit(part: Trajectory, h: GraspPhase) -> bool:
    """Whether a joint of the fingers that hold it stays at an end of its range for a while."""
    rows = [JOINT[name] for finger in h.fingers for name in FINGER_JOINTS[finger]]
    angles, limits = part.between(h.t[0], h.t[-1]).angles[:, rows], LIMITS[rows]
    with np.errstate(invalid="ignore"):
        ends = (np.abs(angles[..., None] - limits) < AT_LIMIT).any(axis=-1) & np.isfinite(angles)
    return bool((ends.mean(axis=0) > 0.1).any())


def _measure_grasp(params: Params, h: GraspPhase) -> SqueezeGrasp | None:
    """The squeezes of one grasp; None where its force does not change."""
    inside = (h.t > h.t[0] + params.margin) & (h.t < h.t[-1] - params.margin)
    known = inside & np.isfinite(h.squeeze) & np.isfinite(h.distance)
    if known.sum() < 32:
        return None
    force, distance = (
        resample_even(h.t[known], v[known], lowpass=params.lowpass) for v in (h.squeeze, h.distance)
    )
    extent = float(np.ptp(force.values))
    if extent < params.least_force:
        return None
    top, _ = find_peaks(force.values, prominence=params.prominence * extent)
    if not len(top):
        return None
    t, x, p = force.t, force.values, distance.values
    valleys = [int(a) + int(np.argmin(x[a:b])) for a, b in zip(top, top[1:])]
    edges = [0, *valleys, len(t) - 1]
    depths = np.array([max(p[edges[k]], p[edges[k + 1]]) - p[a] for k, a in enumerate(top)])
    watts = load_exchange.exchange_power(x[:, None, None], -np.gradient(p, t)[:, None, None])
    total = load_exchange.integrate_power(t, watts)
    half = 0.5 * float(np.median(np.diff(t[top]))) if len(top) > 1 else 1.0
    observed = (t >= t[top[0]] - half) & (t <= t[top[-1]] + half)  # where the force changes
    bends = stiffness_change(t[observed], x[observed], p[observed])
    # the push moves the pads towards each other
    answer = frequency_response.estimate_response(t[observed], x[observed], -p[observed])
    fit, conditions, reasons = identify_spring(
        params, h, inside, answer, t[observed], x[observed], p[observed]
    )
    reasons += [BENT] if fit and bends > params.bent else []
    unobserved = grasp_phases.unobserved_share(h, known)
    estimates = (
        running_stiffness(params, t[observed], x[observed], p[observed], unobserved, bends)
        if fit
        else None
    )
    works = total[top] - total[np.array(edges[:-1])]
    return SqueezeGrasp(
        h,
        t,
        x,
        p,
        t[top],
        x[top],
        depths,
        works,
        fit,
        conditions,
        join(reasons),
        estimates,
        unobserved,
        bends,
        answer,
    )


def figures(r: Squeeze) -> list[Figure]:
    """Over all squeezes of the task."""
    graded = (r.grade, r.reason)
    if not r.grasps:
        return [
            kind.of(0.0 if r.measured and what == "squeeze_count" else np.nan, 0.0, *graded)
            for what, kind in KINDS.items()
            if what
            not in (
                "squeeze_share",
                "squeeze_force_bandwidth",
                "squeeze_object_bandwidth",
                "squeeze_lag",
            )
        ]
    tops, depths, works = (
        np.concatenate([getattr(one, name) for one in r.grasps])
        for name in ("tops", "depths", "work")
    )
    spans = [float(one.peaks[-1] - one.peaks[0]) for one in r.grasps]
    gaps = sum(len(one.peaks) - 1 for one in r.grasps)
    sd = float(
        np.mean([0.5 * np.sqrt((one.held.sd**2).mean(axis=0).sum() / 3) for one in r.grasps])
    )
    spread = float(tops.std(ddof=1)) if len(tops) > 1 else 0.0
    root = np.sqrt(len(tops))
    # the tops of the force are not known
    unread = any((one.held.flags & UNREAD).any() for one in r.grasps)
    if unread:
        tops, spread = np.full(len(tops), np.nan), np.nan
    if unread or _returns_energy(r):
        works = np.full(len(tops), np.nan)
    # relative error of the grip force where one of its sides is not measured completely
    gain, unmeasured = r.params.gain_sd, max(one.unobserved for one in r.grasps) / 2
    answers = [one.conditions for one in r.grasps if one.conditions]
    made = [
        KINDS["squeeze_count"].of(float(len(tops)), 0.0, *graded),
        KINDS["squeeze_force"].of(float(tops.mean()), float(np.linalg.norm([spread / root, sd, unmeasured * tops.mean()])), *graded),
        KINDS["squeeze_force_cv"].of(spread / float(tops.mean()) if len(tops) > 1 else np.nan, 1 / np.sqrt(2 * max(len(tops) - 1, 1)) * spread / float(tops.mean()), *graded),
        KINDS["squeeze_rate"].of(gaps / sum(spans) if gaps else np.nan, 0.1 / max(sum(spans), 0.1) * (gaps / max(sum(spans), 0.1)), *graded),
        KINDS["squeeze_depth"].of(float(depths.mean()), float(np.hypot(depths.std() / root, gain * depths.mean())), *graded),
        *_parameters(r),
        KINDS["squeeze_work"].of(float(works.mean()), float(np.hypot(works.std() / root, np.linalg.norm([gain, r.params.scale_sd, unmeasured]) * works.mean())), *graded),
        *_condition_figures(answers, graded),
    ]  # fmt: skip
    for k, finger in enumerate(r.grasps[0].held.fingers):
        share = np.nan if unread else np.mean([one.held.shares[:, k].mean() for one in r.grasps])
        made.append(KINDS["squeeze_share"].of(float(share), 0.03, *graded, finger))
    return made


def _returns_energy(r: Squeeze) -> bool:
    """Whether energy seems to come out of the object; then neither damping nor work is observable."""
    return any(one.conditions is not None and one.conditions.passive is False for one in r.grasps)


def _condition_figures(answers: Sequence[Conditions], graded: tuple[Grade, str]) -> list[Figure]:
    """The conditions of 6.5.1: what decides each, and as its category whether it holds. Bandwidths of force and response are given
    where they were found: a response that is as wide as the force is no fault."""
    short = (graded[0], TOO_SHORT) if any(np.isnan(c.coherence) for c in answers) else graded
    coherence, lag, lag_sd, force, load = (
        _mean_seen([getattr(c, name) for c in answers])
        for name in ("coherence", "lag", "lag_sd", "force_bandwidth", "load_bandwidth")
    )
    independent, wide, passive = (
        _all(getattr(c, name) for c in answers) for name in ("independent", "wide", "passive")
    )
    bandwidths = [
        KINDS["squeeze_force_bandwidth"].of(
            force, None, *graded, category=_condition_word(wide, HOLDS)
        ),
        KINDS["squeeze_object_bandwidth"].of(load, None, *graded),
    ]
    return [
        KINDS["squeeze_coherence"].of(
            coherence, None, *short, category=_condition_word(independent, OPEN)
        ),
        *(f for f in bandwidths if np.isfinite(f.value)),
        KINDS["squeeze_lag"].of(
            lag,
            lag_sd,
            *short,
            category=_condition_word(passive, HOLDS if lag > 2 * lag_sd else OPEN),
        ),
    ]


def _all(each: Iterable[bool | None]) -> bool | None:
    """Whether it holds of all grasps; None where that is not known."""
    found = set(each)
    return False if False in found else True if found == {True} else None


def _condition_word(holds: bool | None, word: str) -> str:
    """`word` where a condition holds."""
    return UNKNOWN_WORD if holds is None else word if holds else FAILS


def _mean_seen(each: Sequence[float]) -> float:
    """The mean of what was seen in all grasps; NaN where it was not."""
    return float(np.mean(each)) if each and np.isfinite(each).all() else float("nan")


def _parameters(r: Squeeze) -> list[Figure]:
    """Stiffness and damping: the mean over grasps in which they are observable, weighted by the inverse variance."""
    K = KINDS["squeeze_stiffness"], KINDS["squeeze_damping"]
    fits = [one.fit for one in r.grasps if one.fit]
    if not fits:
        return [kind.of(np.nan, None, "poor", r.reason) for kind in K]
    weights = np.array([1 / f.sd[[0, 2]] ** 2 for f in fits])
    values = (weights * np.array([f.theta[[0, 2]] for f in fits])).sum(axis=0) / weights.sum(axis=0)
    scatter = 1 / np.sqrt(weights.sum(axis=0))
    common_share = max(
        correlated_share(r.params, one.unobserved, one.bent) for one in r.grasps if one.fit
    )
    sd = np.hypot(
        scatter,
        [common_share * values[0], np.hypot(common_share * values[1], r.params.timing * values[0])],
    )
    if _returns_energy(r):
        values[1] = np.nan
    return [kind.of(float(v), float(s), r.grade, r.reason) for kind, v, s in zip(K, values, sd)]


def shown(r: Squeeze) -> PlotData:
    """Force and distance over time with the squeezes, and the object's frequency response."""
    if not r.grasps:
        return PlotData()
    one = max(r.grasps, key=lambda g: len(g.t))
    curves = [
        Curve("squeeze_force", "N", one.t, one.force),
        Curve("squeeze_distance", "m", one.t, one.distance),
    ]
    curves += [
        *_force_over_distance(one),
        *twist_curves([one.held]),
        *running_curves("stiffness", "N/m", [one.running]),
    ]
    if one.conditions is not None and one.answer is not None:
        curves += _response_curves(one.answer, correlated_share(r.params, one.unobserved, one.bent))
    return PlotData(tuple(curves), {"squeeze": np.concatenate([g.peaks for g in r.grasps])})


def _response_curves(answer: Response, common_share: float) -> list[Curve]:
    """Size, phase and coherence at the frequencies at which the force changes; the first two with their 95 % band, errors of scale and timing included."""
    seen = answer.excited
    f, size, phase = answer.frequency[seen], np.abs(answer.P[seen]), answer.phase[seen]
    size_sd, phase_sd = np.hypot(answer.sd[seen], common_share * size), answer.phase_sd[seen]
    return [
        Curve("squeeze_response", "m/N", f, size, "Hz"),
        Curve("squeeze_response_low", "m/N", f, np.maximum(size - BAND * size_sd, 0.0), "Hz"),
        Curve("squeeze_response_high", "m/N", f, size + BAND * size_sd, "Hz"),
        Curve("squeeze_phase", "rad", f, phase, "Hz"),
        Curve("squeeze_phase_low", "rad", f, phase - BAND * phase_sd, "Hz"),
        Curve("squeeze_phase_high", "rad", f, phase + BAND * phase_sd, "Hz"),
        Curve("squeeze_coherence", "1", f, answer.coherence[seen], "Hz"),
    ]


def _force_over_distance(one: SqueezeGrasp) -> list[Curve]:
    """The force over the distance, in the order of the distance, and the spring that was fitted to it."""
    order = np.argsort(one.distance)
    x, force = one.distance[order], one.force[order]
    measured = Curve("force_over_distance", "N", x, force, "m")
    if one.fit is None:
        return [measured]
    return [measured, Curve("fitted_spring", "N", x, one.fit.theta[1] - one.fit.theta[0] * x, "m")]
