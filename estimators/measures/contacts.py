"""Fingertips that touch or hold something: the distance between points on their skin, and its error where the true one is known.

In      a trajectory, the stretch of time of the task, the hand's geometry, which points are meant and how far apart they truly are
Out     of every pair: distance over time; smallest and largest that were held; against a known distance mean error and RMSE
Source  Salchow-Hoemmen 2019, (30), (31), Fig. 10 and Table 5 (P1 to P4); the task's details hold `contacts` ("thumb_bottom-index_bottom ...") and `distances_mm`
Limits  where a finger touches is never known to better than some millimetres; widths of fingertips are an adult's (fingertips.py)
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.fingertip_contacts import FINGERTIPS, POINTS, contact_points_of
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures.figure import Grade
from handscope.estimators.measures.task_request import TaskRequest
from handscope.estimators.measures.time_window import grade_window
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.typing import Array

SALCHOW = phrase("figure_source.salchow")


@dataclass(frozen=True)
class Contact:
    """Two points on skin; `distance` in m where it is known."""

    a: tuple[str, str]  # finger, point of fingertips.POINTS
    b: tuple[str, str]
    distance: float | None = None

    @property
    def part(self) -> str:
        return f"{self.a[0]}_{self.b[0]}"


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


def parse_contacts(asked: TaskRequest) -> list[Contact]:
    """What the task's details say; none where they say nothing that can be read."""
    words = str(asked.details.get("contacts") or "").split()
    millimetres = [_parse_number(v) for v in str(asked.details.get("distances_mm") or "").split()]
    found = []
    for k, word in enumerate(words):
        ends = [tuple(end.split("_")) for end in word.split("-")]
        if len(ends) == 2 and all(len(e) == 2 and e[0] in FINGERS and e[1] in POINTS for e in ends):
            (a, p), (b, q) = ends
            known = millimetres[k] if k < len(millimetres) else None
            found.append(Contact((a, p), (b, q), None if known is None else 1e-3 * known))
    return found


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
        both = np.sqrt(
            (part.tips_sd[:, numbers] ** 2).sum(axis=1).mean(axis=-1)
        )  # of each coordinate, both fingers
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


def _parse_number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if np.isfinite(value) and value >= 0 else None
