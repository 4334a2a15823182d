"""Fingertips that touch or hold something: the distance between points on their skin, and its error where the true one is known.

In      a trajectory, the stretch of time of the task, the hand's geometry, which points are meant and how far apart they truly are
Out     of every pair: distance over time; smallest and largest that were held; against a known distance mean error and RMSE
Source  Salchow-Hoemmen 2019, (30), (31), Fig. 10 and Table 5 (P1 to P4); the task's details hold `contacts` ("thumb_bottom-index_bottom ...") and `distances_mm`
Limits  where a finger touches is never known to better than some millimetres; widths of fingertips are an adult's (data/fingertip_contacts.py)
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.fingertip_contacts import FINGERTIPS, contact_points_of
from handscope.estimators.data.held_contact import Contact
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures.figure import Grade
from handscope.estimators.measures.time_window import grade_window
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

SALCHOW = phrase("figure_source.salchow")


@dataclass(frozen=True)
class ContactDistance:
    """One pair over a task; without a geometry the points are the ends of the bones."""

    contact: Contact
    t: Array  # (n,) s
    distance: Array  # (n,) m, NaN where not known
    sd: float | None  # m
    on_skin: bool
    grade: Grade
    reason: str


def contact_distance(
    contact: Contact, part: Trajectory, geometry: HandGeometry | None
) -> ContactDistance:
    """The distance of a pair over the task."""
    fingers = (contact.a[0], contact.b[0])
    segments = [SEGMENT["hand"], *(SEGMENT[s] for f in fingers for s in CHAINS[f])]
    numbers = [FINGERS.index(f) for f in fingers]
    points = [part.tips[:, k] for k in numbers]
    if geometry is not None and len(part):
        points = [
            contact_points_of(part, geometry, f, p, FINGERTIPS[f])
            for f, p in (contact.a, contact.b)
        ]
    offset = points[0] - points[1]
    distance = np.sqrt((offset**2).sum(axis=-1))
    sd = None
    if part.tips_sd is not None and len(part):
        # of each coordinate, both fingers
        both = np.sqrt((part.tips_sd[:, numbers] ** 2).sum(axis=1).mean(axis=-1))
        sd = float(np.nanmean(both)) if np.isfinite(both).any() else None
    if np.isfinite(distance).sum() < 3:
        return ContactDistance(
            contact,
            part.t,
            distance,
            None,
            geometry is not None,
            "poor",
            phrase("measure.points_not_measured", fingers=" or ".join(fingers)),
        )
    return ContactDistance(
        contact, part.t, distance, sd, geometry is not None, *grade_window(part, segments)
    )


def error_statistics(distance: Array, true: float) -> Mapping[str, float]:
    """Mean, standard deviation and root mean square of a distance's errors (n,), m; NaN left out."""
    off = np.asarray(distance, float) - true
    off = off[np.isfinite(off)]
    if not len(off):
        return {"mean": np.nan, "sd": np.nan, "rmse": np.nan}
    return {
        "mean": float(off.mean()),
        "sd": float(off.std(ddof=1)) if len(off) > 1 else 0.0,
        "rmse": float(np.sqrt((off**2).mean())),
    }
