"""How far the palm turns up and down.

In      a trajectory and the stretch of time of the task
Out     supination and pronation from the thumb pointing up, and from one end to the other, rad, each held
Source  neutral is the thumb up, elbow at the side (AAOS, Norkin App. A); which way the palm faces is read against gravity: ours
Limits  the hand's long axis must not stand upright; what the shoulder adds is not told apart
"""

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import SEGMENT, side_sign
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import sustained_angles
from handscope.estimators.measures.figure import Kind, kinds
from handscope.estimators.measures.sustained_angles import (
    Angle,
    Params,
    SustainedAngle,
    figures,
    shown,
)
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

TITLE = "Turning the forearm"
SOURCE = "AAOS (Norkin App. A) for zero and directions; read against gravity: ours"
KINDS = kinds(
    Kind(
        "supination", "rad", "largest turn of the palm upwards from the thumb pointing up", SOURCE
    ),
    Kind(
        "pronation", "rad", "largest turn of the palm downwards from the thumb pointing up", SOURCE
    ),
)
THUMB_DOWN = -120.0 * np.pi / 180  # that nobody turns to from above
INCLINATION = (
    1.7 * np.pi / 180
)  # rad, of the hand's inclination: the worst of ten real trials (docs/reproduction.md, BROAD)

__all__ = ["Params", "applies", "figures", "measure", "shown"]


def applies(task_name: str) -> bool:
    words = words_of(task_name)
    return "forearm" in words and bool(words & {"rom", "prom"})


def palm_turn(moved: Trajectory) -> Array:
    """How far the palm is turned up about the hand's long axis (n,), rad: 0 palm down, pi/2 thumb up, up to pi palm up, negative thumb down."""
    up = quat.rotate(quat.conjugate(moved.q_GS[:, SEGMENT["hand"]]), np.array([0.0, 0.0, 1.0]))
    turned = np.arctan2(-side_sign(moved.hand) * up[:, 2], side_sign(moved.hand) * up[:, 0])
    return np.where(turned < THUMB_DOWN, turned + 2 * np.pi, turned)


def angles(moved: Trajectory) -> list[Angle]:
    """Both ways from the thumb up."""
    up = palm_turn(moved) - np.pi / 2
    sd = np.full(len(up), INCLINATION)
    return [
        Angle(KINDS["supination"], "", up, sd, [SEGMENT["hand"]]),
        Angle(KINDS["pronation"], "", -up, sd, [SEGMENT["hand"]]),
    ]


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> list[SustainedAngle]:
    """Of the hand, where it was measured."""
    return sustained_angles.largest_sustained(params.hold, trajectory, onset, end, angles)
