"""Pinching: how near two fingertips come and how far they open.

In      a trajectory, the stretch of time of the task, the hand's geometry, the task's `contacts`; without them thumb and index finger, tip to tip
Out     smallest and largest distance between the points of contact that was held, how often they closed
Source  pinch distance: Kortier, thesis 2.3.2 (thumb and index in contact: 6.5 +- 2.1 mm RMS); points of contact: Salchow-Hoemmen 2019, Fig. 10; "held" as range_of_motion.py
Limits  contacts.py; a distance of zero is contact, what is left of it then is the glove's error
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.held_contact import Contact, parse_contacts
from handscope.estimators.data.options import option
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import cycles
from handscope.estimators.measures.contacts import (
    ContactDistance,
    contact_distance,
)
from handscope.estimators.measures.figure import Figure, Kind, kinds
from handscope.estimators.measures.plot_data import Curve, PlotData
from handscope.estimators.measures.signals import resample_even
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.measures.time_window import (
    running_median,
    task_samples,
    usable_samples,
    window_length,
)
from handscope.estimators.messages.sentence import phrase

TITLE = phrase("measure_title.pinch")
KORTIER = phrase("figure_source.thesis_2_3_2")
TIP_TO_TIP = Contact(("thumb", "distal"), ("index", "distal"))
KINDS = kinds(
    Kind(
        "pinch_distance_min",
        "m",
        phrase("figure_meaning.pinch_distance_min"),
        KORTIER,
    ),
    Kind(
        "pinch_distance_closed",
        "m",
        phrase("figure_meaning.pinch_distance_closed"),
        KORTIER,
    ),
    Kind(
        "pinch_aperture_max",
        "m",
        phrase("figure_meaning.pinch_aperture_max"),
        phrase("figure_source.running_median"),
    ),
    Kind(
        "pinch_count",
        "1",
        phrase("figure_meaning.pinch_count"),
        phrase("figure_source.as_tapping"),
    ),
)


@dataclass(frozen=True, kw_only=True)
class Params:
    """Options of the measure."""

    hold: float = option(
        0.2,
        "s",
        "window of the running median: a distance counts when it lasts half of this",
        "ours: as range_of_motion",
    )


@dataclass(frozen=True)
class PinchDistance:
    """One pair of fingertips."""

    touched: ContactDistance
    smallest: float  # m
    largest: float
    closed: float  # m, mean of the pinches
    closings: np.ndarray  # s


def applies(task_name: str) -> bool:
    """Whether a task's name asks for this measure."""
    return bool(words_of(task_name) & {"pinch", "pinches"})


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> list[PinchDistance]:
    """Of every pair that the task names."""
    part = task_samples(trajectory, onset, end)
    return (
        [
            _measure_pinch(params, part, contact_distance(c, part, geometry))
            for c in parse_contacts(asked.details) or [TIP_TO_TIP]
        ]
        if len(part) >= 3
        else []
    )


def figures(found: list[PinchDistance]) -> list[Figure]:
    """The flat list of figures."""
    made = []
    for p in found:
        graded = (p.touched.grade, p.touched.reason)
        part, sd, count = p.touched.contact.part, p.touched.sd, len(p.closings)
        rows = {
            "pinch_distance_min": p.smallest,
            "pinch_distance_closed": p.closed,
            "pinch_aperture_max": p.largest,
        }
        made += [KINDS[what].of(value, sd, *graded, part) for what, value in rows.items()]
        made.append(
            KINDS["pinch_count"].of(
                float(count) if np.isfinite(p.smallest) else np.nan, 0.0, *graded, part
            )
        )
    return made


def shown(found: list[PinchDistance]) -> PlotData:
    """The distances over time with the pinches."""
    curves = tuple(
        Curve(f"{p.touched.contact.part}_distance", "m", p.touched.t, p.touched.distance)
        for p in found
    )
    return PlotData(
        curves, {"closing": np.concatenate([p.closings for p in found])} if found else {}
    )


def _measure_pinch(params: Params, part: Trajectory, pair: ContactDistance) -> PinchDistance:
    segments = [
        SEGMENT["hand"],
        *(SEGMENT[s] for f in (pair.contact.a[0], pair.contact.b[0]) for s in CHAINS[f]),
    ]
    kept = running_median(
        pair.distance, usable_samples(part, segments), window_length(part.t, params.hold)
    )
    if kept is None:
        return PinchDistance(pair, np.nan, np.nan, np.nan, np.empty(0))
    looked = cycles.Params()
    signal = resample_even(part.t, pair.distance, looked.max_gap, looked.lowpass)
    at = cycles.find_closings(looked, signal, looked.smallest)
    closed = float(signal.values[at].mean()) if len(at) else float("nan")
    return PinchDistance(pair, float(np.nanmin(kept)), float(np.nanmax(kept)), closed, signal.t[at])
