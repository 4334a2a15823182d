"""Thumb tip on each fingertip, one after the other, each held still: contacts for calibration.

Source  thumb opposition as in Kapandji 1986, positions 3 to 6; how long each is held: ours
Limits  the hand rests; where on the pads a person touches is drawn evenly about every axis
"""

import numpy as np

from handscope.estimators.data.events import Event
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.simulation.motion import move_through
from handscope.estimators.simulation.movements.grasp_postures import (
    Hold,
    close_holds,
    touching_posture,
)
from handscope.estimators.simulation.movements.task_performance import Performance, relaxed

HELD, BETWEEN = 2.0, 1.2  # s
SETTLED = 0.2  # s at both ends of a hold that its event leaves out
PLACE_SD = 0.004  # m, each axis, of where on the pads a person touches


def touch_fingertips(
    geometry: HandGeometry,
    rng: np.random.Generator,
    place_sd: float = PLACE_SD,
    fingers: tuple[str, ...] = FINGERS[1:],
    missed: float = 0.0,
    held: float = HELD,
    between: float = BETWEEN,
) -> Performance:
    """The thumb's pad on that of each finger; with `missed` (m) it stays so far from it all the same."""
    points, events, t = [(0.0, relaxed())], [], 0.0
    for finger in fingers:
        hold = Hold(("thumb", "bottom"), (finger, "bottom"), missed)
        posture = close_holds(
            touching_posture(finger, relaxed())[None],
            [hold],
            geometry,
            places=None if missed else place_sd * rng.normal(size=3),
        )[0]
        begin = t + between
        points += [
            (begin, posture),
            (begin + held, posture),
            (begin + held + between, relaxed()),
        ]
        details = {"contacts": f"thumb_bottom-{finger}_bottom"}
        events.append(Event(begin + SETTLED, held - 2 * SETTLED, "contact", details))
        t = begin + held + between
    return Performance(move_through(points), tuple(events))
