"""How accurate the glove is on this hand: distances between fingertips that hold a spacer, a block or each other, against what they truly are.

In      a trajectory, the stretch of time of the hold, the hand's geometry, the task's `contacts` and `distances_mm`
Out     of every pair the mean error, its standard deviation and the RMSE
Source  Salchow-Hoemmen 2019, (30), (31) and Table 5: P1, P2 a spacer of 3 cm, P3 a pinch, P4 a block of 5.3, 4.6 and 2.5 cm
Limits  contacts.py
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.held_contact import Contact, parse_contacts
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures.contacts import (
    SALCHOW,
    ContactDistance,
    contact_distance,
    error_statistics,
)
from handscope.estimators.measures.figure import Figure, Kind, kinds
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import task_samples
from handscope.estimators.messages.sentence import join, phrase

TITLE = phrase("measure_title.self_check")
UNDECLARED = phrase("measure.distance_undeclared")
REACTION = (1.0, 0.5)  # s after a word to close, and before the next, that are not judged: ours
HELD = {  # Table 5; the bottoms of the block are ours (estimators/simulation/movements/static_hold.py)
    "p1": (Contact(("thumb", "bottom"), ("index", "bottom"), 0.030),),
    "p2": (Contact(("index", "left"), ("middle", "right"), 0.030),),
    "p3": (Contact(("thumb", "distal"), ("index", "distal"), 0.0),),
    "p4": (
        Contact(("thumb", "bottom"), ("index", "bottom"), 0.053),
        Contact(("thumb", "bottom"), ("middle", "bottom"), 0.046),
        Contact(("index", "bottom"), ("middle", "bottom"), 0.025),
    ),
}
KINDS = kinds(
    Kind(
        "contact_error_mean",
        "m",
        phrase("figure_meaning.contact_error_mean"),
        SALCHOW,
    ),
    Kind("contact_error_sd", "m", phrase("figure_meaning.contact_error_sd"), SALCHOW),
    Kind("contact_error_rmse", "m", phrase("figure_meaning.contact_error_rmse"), SALCHOW),
)


@dataclass(frozen=True, kw_only=True)
class Params:
    """None: the true distances stand in the task."""


def applies(task_name: str) -> bool:
    """Whether a task's name asks for this measure."""
    words = words_of(task_name)
    return "selfcheck" in words or "check" in words or task_name.lower() in HELD


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> list[ContactDistance]:
    """Every pair whose true distance is known: from the task's details, else from its name (P1 to P4); only while `closed`, where that is marked."""
    part = task_samples(trajectory, onset, end)
    shut = [
        (m.onset + REACTION[0], m.end - REACTION[1]) for m in asked.marks if m.phase == "closed"
    ]
    if shut:
        part = part.without(
            [
                (a, b)
                for a, b in zip([-np.inf, *(b for _, b in shut)], [*(a for a, _ in shut), np.inf])
            ]
        )
    named = next((pairs for name, pairs in HELD.items() if name in words_of(asked.task)), ())
    pairs = [c for c in parse_contacts(asked.details) if c.distance is not None] or list(named)
    return [contact_distance(c, part, geometry) for c in pairs]


def figures(found: list[ContactDistance]) -> list[Figure]:
    """The flat list of figures; the standard deviation of a distance's error is what the glove itself expects to be off."""
    made = [] if found else [k.of(np.nan, None, "poor", UNDECLARED) for k in KINDS.values()]
    for r in found:
        assert r.contact.distance is not None
        off = error_statistics(r.distance, r.contact.distance)
        graded = (
            r.grade,
            r.reason if r.on_skin else join([r.reason, phrase("measure.between_bone_ends")]),
        )
        for what in ("mean", "sd", "rmse"):
            made.append(KINDS[f"contact_error_{what}"].of(off[what], r.sd, *graded, r.contact.part))
    return made


def shown(found: list[ContactDistance]) -> PlotData:
    """The distances over time."""
    return PlotData(
        tuple(
            Curve(f"{r.contact.part}_distance", "m", r.t, r.distance)
            for r in found
            if np.isfinite(r.distance).any()
        )
    )
