"""How far the thumb leaves the palm: palmar abduction out of its plane, radial abduction within it, pronation about its own axis.

In      a trajectory and the stretch of time of the task
Out     the largest of each that was held, rad
Source  of the metacarpal, as the Pollexograph-metacarpal reads it (de Kraker 2009, J Hand Surg Am 34:523); methods that read the whole thumb give about 12 deg more
Limits  zero is the palm's plane and the direction of the fingers (docs/conventions.md)
"""

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import DEVIATION, FLEXION, PRONATION
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import sustained_angles
from handscope.estimators.measures.figure import Kind, kinds
from handscope.estimators.measures.sustained_angles import (
    Angle,
    Params,
    SustainedAngle,
    figures,
    joint_angle,
    shown,
)
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of

TITLE = "Thumb abduction"
SOURCE = "of the metacarpal, as the Pollexograph-metacarpal (de Kraker 2009, J Hand Surg Am 34:523)"
KINDS = kinds(
    Kind(
        "palmar_abduction",
        "rad",
        "largest angle of the thumb's metacarpal out of the palm's plane",
        SOURCE,
    ),
    Kind(
        "radial_abduction",
        "rad",
        "largest angle of the thumb's metacarpal away from the fingers, within the palm's plane",
        SOURCE,
    ),
    Kind(
        "pronation",
        "rad",
        "largest turn of the thumb's metacarpal about its own axis, its pad towards the fingers",
        "ours: CMC angle z-x'-y''",
    ),
)

__all__ = ["Params", "applies", "figures", "measure", "shown"]


def applies(task_name: str) -> bool:
    words = words_of(task_name)
    return (
        "thumb" in words
        and bool(words & {"rom", "prom", "abduction"})
        and not words & {"mcp", "ip"}
    )


def angles(moved: Trajectory) -> list[Angle]:
    """The three of them."""
    each = (
        ("palmar_abduction", FLEXION, 1.0),
        ("radial_abduction", DEVIATION, -1.0),
        ("pronation", PRONATION, 1.0),
    )
    return [
        joint_angle(KINDS[what], "thumb_cmc", moved, [("thumb_cmc", a, weight)])
        for what, a, weight in each
    ]


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> list[SustainedAngle]:
    """Of the thumb, where it was measured."""
    return sustained_angles.largest_sustained(params.hold, trajectory, onset, end, angles)
