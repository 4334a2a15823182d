"""Lifting an object: grip force, load force, each finger's share, timing, estimated mass.

In      a trajectory with fingertip forces, the stretch of time of the task
Out     means over the lifts: grip force, load force, their ratio, shares, times of the phases, height, work, mass with its standard deviation
Source  forces and mass: Kortier, thesis ch. 6, (6.5), (6.8), (1.15); phases: grasp at a threshold of force, the object rises (Lang & Schieber, PMC3305822, Fig. 1)
Limits  a mass is estimated only of an object that the measured fingers lift by themselves; in the thesis it was wrong by 20 to 30 %. Another support of the object is reported
        apart by accelerations alone: of lifts by 0.2 to 0.5 m in a second 1 N nearly always, 0.5 N half of the time, 0.3 N one time in five
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.force import grasp_phases, identification, load_exchange
from handscope.estimators.force.contact import ContactParams
from handscope.estimators.force.grasp_phases import UNREAD, UNSURE, GraspPhase
from handscope.estimators.force.identification import RunningEstimate
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures.figure import Figure, Grade, Kind, kinds, worse
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import task_samples
from handscope.estimators.messages.sentence import join, phrase
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array, Bools

TITLE = phrase("measure_title.lift")
KORTIER = phrase("figure_source.thesis_6")
PHASES = phrase("figure_source.grasp_phases")
WORK = join((KORTIER, phrase("figure_source.power")))
# m/s^2: of an acceleration error of 5 mm/s^2 that changes within the grasp a tenth; ours
HEIGHT_ERROR = 5e-4
WEIGHS = 2.0  # standard deviations above nothing that are asked of a mass: what is held off the table has one
QUIET = 1e-3  # N: less than any sensor's noise, so that the residuals determine the noise
NONE = phrase("lift.no_force")
KINDS = kinds(
    Kind("lift_count", "1", phrase("figure_meaning.lift_count"), phrase("figure_source.ours")),
    Kind("lift_mass", "kg", phrase("figure_meaning.lift_mass"), phrase("figure_source.thesis_6_5")),
    Kind("lift_grip_hold", "N", phrase("figure_meaning.lift_grip_hold"), KORTIER),
    Kind("lift_grip_max", "N", phrase("figure_meaning.lift_grip_max"), KORTIER),
    Kind("lift_load_hold", "N", phrase("figure_meaning.lift_load_hold"), KORTIER),
    Kind("lift_grip_over_load", "1", phrase("figure_meaning.lift_grip_over_load"), "Hiramatsu et al. 2015, PLoS ONE"),
    Kind("force_share", "1", phrase("figure_meaning.force_share"), KORTIER),
    Kind("lift_time_to_lift", "s", phrase("figure_meaning.lift_time_to_lift"), PHASES),
    Kind("lift_time_held", "s", phrase("figure_meaning.lift_time_held"), PHASES),
    Kind("lift_time_to_release", "s", phrase("figure_meaning.lift_time_to_release"), PHASES),
    Kind("lift_grip_rate", "N/s", phrase("figure_meaning.lift_grip_rate"), phrase("figure_source.interpolated_force")),
    Kind("lift_height", "m", phrase("figure_meaning.lift_height"), phrase("figure_source.integrated_twice")),
    Kind("lift_work", "J", phrase("figure_meaning.lift_work"), WORK),
    Kind("lift_work_turning", "J", phrase("figure_meaning.lift_work_turning"), WORK),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Params(ContactParams):
    """Options of the measure."""

    lifted: float = option(
        0.03,
        "m",
        "height from which an object counts as lifted",
        "ours: the height's own error; 3 mm in PMC3305822",
        least=0.005,
    )
    moving: float = option(
        0.04,
        "m/s",
        "vertical speed at which it leaves the table, and is back",
        "ours: what the accelerometers leave in 5 s",
        least=0.005,
    )
    margin: float = option(
        0.15,
        "s",
        "at both ends of the time off the table that tell no mass",
        "ours: two force samples at 12 Hz",
        least=0.0,
    )
    shortest: float = option(
        0.3, "s", "a shorter touch is none", "ours: four samples at 12 Hz", least=0.0
    )
    constant: float = option(
        4.0,
        "1",
        "standard deviations of a support that does not change with the acceleration, or of a mass that does meanwhile, beyond which the mass is not told",
        "ours",
        least=1.0,
    )
    perhaps: float = option(
        2.0,
        "1",
        "and beyond which it is said, and the mass is as unsure as support or change are large",
        "ours: as `shared`",
        least=1.0,
    )
    memory: float = option(
        1.0,
        "s",
        "time after which a sample counts for 1/e in the running estimate",
        "ours: twelve force samples",
        least=0.1,
    )
    slip: float = option(0.25, "1", "share of the load by which it leaves the mean within the hold, beyond which the object slipped", "ours", least=0.05)  # fmt: skip


@dataclass(frozen=True)
class LiftedObject:
    """One lift."""

    held: GraspPhase
    off: Bools  # (n,) instants at which the object is off the table
    mass: float  # kg; NaN where it is not observable
    mass_sd: float
    slips: Array  # s
    reason: str
    running: RunningEstimate | None = None  # the mass as it stood while the object was held up


@dataclass(frozen=True)
class Lift:
    """Lifts with their grasps, graded."""

    measured: bool
    lifts: tuple[LiftedObject, ...]
    grasps: int
    grade: Grade
    reason: str


def applies(task_name: str) -> bool:
    """Whether a task's name asks for this measure."""
    return bool({"lift", "lifting"} & words_of(task_name))


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> Lift:
    """Every lift of the stretch."""
    part = task_samples(trajectory, onset, end)
    if not grasp_phases.measured_fingers(part):
        return Lift(False, (), 0, "poor", NONE)
    found = grasp_phases.find_grasp_phases(params, part)
    lifts = [made for h in found if (made := _measure_lift(params, h)) is not None]
    if not lifts:
        return Lift(
            True,
            (),
            len(found),
            "poor",
            phrase("lift.nothing_lifted") if found else phrase("lift.nothing_held"),
        )
    grades = [
        ("good" if not one.reason else "fair" if np.isfinite(one.mass) else "poor", one.reason)
        for one in lifts
    ]
    return Lift(True, tuple(lifts), len(found), *worse(*grades))  # type: ignore[arg-type]


def _measure_lift(params: Params, h: GraspPhase) -> LiftedObject | None:
    """The lifts of one grasp; None where nothing leaves the table."""
    if len(h.t) < 8 or not np.isfinite(h.height).all() or h.height.max() < params.lifted:
        return None
    moving = np.flatnonzero(np.abs(h.speed) > params.moving)
    first, last = (h.t[moving[0]], h.t[moving[-1]]) if len(moving) else (np.inf, -np.inf)
    off, sure = (
        (h.t >= first) & (h.t <= last),
        (h.t >= first + params.margin) & (h.t <= last - params.margin),
    )
    if sure.sum() < 8 or not np.isfinite(h.forces[sure]).all():
        return LiftedObject(
            h,
            off,
            np.nan,
            np.nan,
            np.empty(0),
            h.flagged(off) or phrase("lift.force_unknown"),
        )
    weighed = estimate_mass(params, h, sure)
    slips = _find_slips(params, h, sure, weighed.weight)
    reasons = [h.flagged(sure)] + ([phrase("force_flag.slip")] if len(slips) else [])
    doubtful = bool(
        h.flags[sure].any() and (np.bitwise_or.reduce(h.flags[sure], axis=None) & UNSURE)
    )
    if weighed.supported > params.constant:
        reasons.append(phrase("lift.carried"))
        doubtful = True
    elif weighed.supported > params.perhaps:
        reasons.append(phrase("lift.maybe_carried"))
    if weighed.changed > params.constant:
        reasons.append(phrase("lift.load_changed"))
        doubtful = True
    elif weighed.changed > params.perhaps:
        reasons.append(phrase("lift.load_maybe_changed"))
    if weighed.mass < WEIGHS * weighed.sd:
        reasons.append(phrase("lift.weightless"))
        doubtful = True
    mass, running = (np.nan, None) if doubtful else (weighed.mass, weighed.running)
    return LiftedObject(h, off, mass, weighed.sd, slips, join(reasons), running)


@dataclass(frozen=True)
class MassEstimate:
    """Mass lifted with its standard deviation, kg."""

    mass: float  # kg
    sd: float
    supported: float  # by how many of its standard deviations a constant support differs from zero
    changed: float  # and what the mass gains or loses meanwhile
    weight: Array  # (used,) N
    running: RunningEstimate


def estimate_mass(params: Params, h: GraspPhase, used: Bools) -> MassEstimate:
    """The mass from all samples at once and as it stood after each of them. (6.5), (6.8)

    With a support that carries part of the object the load is m g - support at rest and m (g + a) - support in movement: over the specific force the
    load is a line whose slope is the mass and whose intercept is the support. A support that changes meanwhile lets the estimated mass drift.
    """
    net, s, up = h.net[used], h.lifting[used], h.up[used]
    unknown = np.full(int(used.sum()), QUIET)
    fit = identification.fit_least_squares(net, s[..., None], unknown)
    # N^2: inclination, zero and scale are the same in all samples
    of_axes = (h.common_sd[used] ** 2).mean(axis=0).sum(axis=0)
    across = net - (net * up).sum(axis=1, keepdims=True) * up
    # N^2: it may be missing along, too
    unexplained = max(0.0, float((across.mean(axis=0) ** 2).sum() - of_axes[:2].sum()))
    along = (s * up).sum(axis=1)
    since = (h.t[used] - h.t[used].mean()) / np.ptp(h.t[used])
    both, growing = (
        identification.fit_least_squares(
            h.load[used][:, None], np.stack([along, other], axis=-1)[:, None], unknown
        )
        for other in (np.ones(len(s)), along * since)
    )
    changed = abs(growing.theta[1]) / float(np.hypot(growing.sd[1], np.sqrt(of_axes[2]) / GRAVITY))
    gained = growing.theta[1] if changed > params.perhaps else 0.0
    supported = abs(both.theta[1]) / float(np.hypot(both.sd[1], np.sqrt(of_axes[2])))
    carried = both.theta[1] if supported > params.perhaps else 0.0
    unobserved = grasp_phases.unobserved_share(h, used) * fit.theta[0]
    common = float(
        np.sqrt(
            (of_axes[2] + unexplained + carried**2) / GRAVITY**2 + unobserved**2 + gained**2 / 12
        )
    )  # any of those it had
    each = float(np.sqrt((fit.residuals**2).mean() * len(s) / fit.independent))
    running = identification.track_first_parameter(
        h.t[used],
        net,
        s[..., None],
        each,
        np.ones(1),
        params.memory,
        lambda mass: np.full(len(mass), common),
    )
    weight = (fit.theta[0] + gained * since) * np.linalg.norm(s, axis=1)
    return MassEstimate(
        float(fit.theta[0]), float(np.hypot(fit.sd[0], common)), supported, changed, weight, running
    )


def _find_slips(params: Params, h: GraspPhase, used: Bools, weight: Array) -> Array:
    """When (s) the load leaves what the mass explains, N (used,), for a short while."""
    off = np.abs(h.load[used] - weight) > max(params.slip * float(np.median(weight)), 0.3)
    starts = np.flatnonzero(np.diff(np.concatenate([[False], off]).astype(int)) == 1)
    return np.asarray(h.t[used][starts])


def figures(r: Lift) -> list[Figure]:
    """Means over the lifts with the standard error of their scatter and the instrument's."""
    if not r.measured:
        return [
            kind.of(np.nan, None, "poor", r.reason)
            for what, kind in KINDS.items()
            if what not in ("force_share", "lift_work_turning")
        ]
    graded = (r.grade, r.reason)
    made = [KINDS["lift_count"].of(float(len(r.lifts)), 0.0, *graded)]
    each = [_values(one) for one in r.lifts]
    turning = any(one.held.turning is not None for one in r.lifts)
    for what, kind in KINDS.items():
        if what not in ("lift_count", "force_share") and (turning or what != "lift_work_turning"):
            made.append(_mean(kind, [e[what] for e in each], graded))
    for k, finger in enumerate(r.lifts[0].held.fingers if r.lifts else ()):
        shares = [
            (
                np.nan if _has_missing_forces(one) else float(one.held.shares[one.off, k].mean()),
                0.03,
            )
            for one in r.lifts
        ]
        made.append(_mean(KINDS["force_share"], shares, graded, finger))
    return made


def _mean(
    kind: Kind, each: list[tuple[float, float]], graded: tuple[Grade, str], part: str = ""
) -> Figure:
    known = np.array([e for e in each if np.isfinite(e[0])]).reshape(-1, 2)
    if not len(known):
        return kind.of(np.nan, None, *graded, part)
    scatter = float(known[:, 0].std(ddof=1) / np.sqrt(len(known))) if len(known) > 1 else 0.0
    return kind.of(
        float(known[:, 0].mean()), float(np.hypot(scatter, known[:, 1].mean())), *graded, part
    )


def _values(one: LiftedObject) -> dict[str, tuple[float, float]]:
    """The figures of one lift, each with the standard deviation that the instrument leaves."""
    h, off = one.held, one.off
    sd = np.sqrt((h.common_sd[off] ** 2).mean(axis=0))  # (S, 3)
    grip, load, t = float(h.grip[off].mean()), float(h.load[off].mean()), h.t
    # of the push, and perhaps of the load: one side of the grip lacks it
    unobserved = grasp_phases.unobserved_share(h, off)
    grip_sd = float(np.hypot(0.5 * np.sqrt((sd**2).sum() / 3), 0.5 * unobserved * grip))
    load_sd = float(np.hypot(np.sqrt((sd[:, 2] ** 2).sum()), unobserved * load))
    first, last = t[off][0], t[off][-1]
    rise = np.gradient(h.grip, t)
    up = off & (np.arange(len(t)) <= int(np.argmax(h.height)))
    work = lifting_work(h, up)
    turned, turned_sd = (
        float(load_exchange.integrate_power(t[up], v[up])[-1]) if v is not None else np.nan
        for v in (h.turning, h.turning_sd)
    )  # a zero errs all the way
    height, height_sd = float(h.height.max()), HEIGHT_ERROR * (t[-1] - t[0]) ** 2
    if np.isnan(one.mass):  # the sum of the forces is not known: nor is what it did
        load = work = np.nan
    if _has_missing_forces(one):
        grip, rise = np.nan, np.full(1, np.nan)
    top = grip if np.isnan(grip) else float(h.grip.max())
    return {
        "lift_mass": (one.mass, one.mass_sd),
        "lift_grip_hold": (grip, grip_sd),
        "lift_grip_max": (top, grip_sd),
        "lift_load_hold": (load, load_sd),
        "lift_grip_over_load": (
            grip / load,
            grip / load * float(np.hypot(grip_sd / grip, load_sd / load)),
        ),
        "lift_time_to_lift": (float(first - t[0]), 0.1),
        "lift_time_held": (float(last - first), 0.1),
        "lift_time_to_release": (float(t[-1] - last), 0.1),
        "lift_grip_rate": (float(rise.max()), 0.1 * float(rise.max())),
        "lift_height": (height, height_sd),
        "lift_work": (work, abs(work) * float(np.hypot(load_sd / load, height_sd / height))),
        "lift_work_turning": (turned, turned_sd),
    }


def _has_missing_forces(one: LiftedObject) -> bool:
    """Whether forces are missing while the object is off the table."""
    return bool((one.held.flags[one.off] & UNREAD).any())


def lifting_work(h: GraspPhase, up: Bools) -> float:
    """J that the forces do on the object at the instants `up`: the integral of F'v, F the sum of the fingertips' forces and v the object's velocity."""
    if h.velocity is None or not up.any():
        return float("nan")
    return float(
        load_exchange.integrate_power(
            h.t[up], load_exchange.exchange_power(h.net[up][:, None], h.velocity[up][:, None])
        )[-1]
    )


def shown(r: Lift) -> PlotData:
    """Grip and load of the lifts, with when the object left the table, was back, and slipped."""
    if not r.lifts:
        return PlotData()
    t, grip, load = (
        np.concatenate([np.append(v, np.nan) for v in vs])
        for vs in zip(*((o.held.t, o.held.grip, o.held.load) for o in r.lifts))
    )
    t = np.where(np.isfinite(t), t, np.concatenate([[0.0], t[:-1]]))
    marks = {
        "lift_off": np.array([o.held.t[o.off][0] for o in r.lifts]),
        "put_down": np.array([o.held.t[o.off][-1] for o in r.lifts]),
        "slip": np.concatenate([o.slips for o in r.lifts]),
    }
    curves = Curve("grip_force", "N", t, grip), Curve("load_force", "N", t, load)
    return PlotData(
        (
            *curves,
            *twist_curves([o.held for o in r.lifts]),
            *running_curves("mass", "kg", [o.running for o in r.lifts]),
        ),
        marks,
    )


def twist_curves(each: Sequence[GraspPhase]) -> tuple[Curve, ...]:
    """Torque about the normal of each fingertip with its standard deviation to either side, one grasp behind the other; of sensors with six axes."""
    with_twist = [h for h in each if h.twist is not None and h.twist_sd is not None]
    curves: list[Curve] = []
    for k, finger in enumerate(with_twist[0].fingers if with_twist else ()):
        running = [
            RunningEstimate(h.t, h.twist[:, k], h.twist_sd[:, k])
            for h in with_twist
            if h.twist is not None and h.twist_sd is not None
        ]
        if any(np.isfinite(one.value).any() for one in running):
            curves += running_curves(f"torque_{finger}", "Nm", running)
    return tuple(curves)


def running_curves(
    name: str, unit: str, each: Sequence[RunningEstimate | None]
) -> tuple[Curve, ...]:
    """A running estimate and its standard deviation to either side, one stretch behind the other; none where there is none."""
    known = [one for one in each if one is not None]
    if not known:
        return ()
    t = np.concatenate([np.append(one.t, one.t[-1]) for one in known])
    value, sd = (
        np.concatenate([np.append(getattr(one, what), np.nan) for one in known])
        for what in ("value", "sd")
    )
    return tuple(
        Curve(f"{name}{which}", unit, t, value + sign * sd)
        for which, sign in (("", 0.0), ("_low", -1.0), ("_high", 1.0))
    )
