"""Pinching: how near two fingertips come and how far they open.

In      a trajectory, the stretch of time of the task, the hand's geometry, the task's `contacts`; without them thumb and index finger, tip to tip
Out     smallest and largest distance between the points of contact that was held, how often they closed
Source  pinch distance: Kortier, thesis 2.3.2 (thumb and index in contact: 6.5 +- 2.1 mm RMS); points of contact: Salchow-Hoemmen 2019, Fig. 10; "held" as range_of_motion.py
Limits  contacts.py; a distance of zero is contact, what is left of it then is the glove's error
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import cycles
from handscope.estimators.measures.contacts import Contact, Touched, contacts_of, touched
from handscope.estimators.measures.figure import Figure, Kind, kinds
from handscope.estimators.measures.plot_data import Curve, Shown
from handscope.estimators.measures.signals import even
from handscope.estimators.measures.task_request import UNKNOWN, Asked, words_of
from handscope.estimators.measures.time_window import held, usable_in, window_of, within

TITLE = "Pinch"
KORTIER = "Kortier, thesis 2.3.2"
TIP_TO_TIP = Contact(("thumb", "distal"), ("index", "distal"))
KINDS = kinds(
    Kind(
        "pinch_distance_min",
        "m",
        "smallest distance between the points of contact that was held",
        KORTIER,
    ),
    Kind(
        "pinch_distance_closed",
        "m",
        "mean over the pinches of the smallest distance in each",
        KORTIER,
    ),
    Kind(
        "pinch_aperture_max",
        "m",
        "largest distance between the points of contact that was held",
        "ours: the largest of the running median",
    ),
    Kind(
        "pinch_count",
        "1",
        "pinches: minima of at least a quarter of the 5-95 % range",
        "ours: as finger tapping",
    ),
)


@dataclass(frozen=True, kw_only=True)
class Params:
    hold: float = option(
        0.2,
        "s",
        "window of the running median: a distance counts when it lasts half of this",
        "ours: as range_of_motion",
    )


@dataclass(frozen=True)
class Pinched:
    """One pair of fingertips."""

    touched: Touched
    smallest: float  # m
    largest: float
    closed: float  # m, mean of the pinches
    closings: np.ndarray  # s


def applies(task_name: str) -> bool:
    return bool(words_of(task_name) & {"pinch", "pinches"})


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: Asked = UNKNOWN,
) -> list[Pinched]:
    """Of every pair that the task names."""
    part = within(trajectory, onset, end)
    return (
        [
            _pinched(params, part, touched(c, part, geometry))
            for c in contacts_of(asked) or [TIP_TO_TIP]
        ]
        if len(part) >= 3
        else []
    )


def figures(found: list[Pinched]) -> list[Figure]:
    """The flat list of figures."""
    made = []
    for p in found:
        told = (p.touched.grade, p.touched.reason)
        part, sd, count = p.touched.contact.part, p.touched.sd, len(p.closings)
        rows = {
            "pinch_distance_min": p.smallest,
            "pinch_distance_closed": p.closed,
            "pinch_aperture_max": p.largest,
        }
        made += [KINDS[what].of(value, sd, *told, part) for what, value in rows.items()]
        made.append(
            KINDS["pinch_count"].of(
                float(count) if np.isfinite(p.smallest) else np.nan, 0.0, *told, part
            )
        )
    return made


def shown(found: list[Pinched]) -> Shown:
    """The distances over time with the pinches."""
    curves = tuple(
        Curve(f"{p.touched.contact.part}_distance", "m", p.touched.t, p.touched.distance)
        for p in found
    )
    return Shown(curves, {"closing": np.concatenate([p.closings for p in found])} if found else {})


def _pinched(params: Params, part: Trajectory, pair: Touched) -> Pinched:
    segments = [
        SEGMENT["hand"],
        *(SEGMENT[s] for f in (pair.contact.a[0], pair.contact.b[0]) for s in CHAINS[f]),
    ]
    kept = held(pair.distance, usable_in(part, segments), window_of(part.t, params.hold))
    if kept is None:
        return Pinched(pair, np.nan, np.nan, np.nan, np.empty(0))
    looked = cycles.Params()
    signal = even(part.t, pair.distance, looked.max_gap, looked.lowpass)
    at = cycles.closings(looked, signal, looked.smallest)
    closed = float(signal.values[at].mean()) if len(at) else float("nan")
    return Pinched(pair, float(np.nanmin(kept)), float(np.nanmax(kept)), closed, signal.t[at])
