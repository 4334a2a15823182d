"""How far neighbouring fingers spread.

In      a trajectory and the stretch of time of the task
Out     the largest angle between neighbours that was held, rad, and from index to little finger
Source  between neighbours: Chatzioglou 2024 (Anat Cell Biol 57:172), there from a photograph; here from the deviations of the MCP joints
Limits  zero is fingers parallel in the initial pose: what a hand has between its fingers then is not counted
"""

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import DEVIATION, FINGERS
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

TITLE = "Finger spread"
SOURCE = "Chatzioglou 2024 (Anat Cell Biol 57:172)"
KINDS = kinds(
    Kind("spread", "rad", "largest angle between the two fingers, sideways", SOURCE),
    Kind(
        "whole_spread",
        "rad",
        "largest angle from the index to the little finger, sideways",
        "ours: the spreads of all neighbours at one instant",
    ),
)

__all__ = ["Params", "applies", "figures", "measure", "shown"]


def applies(task_name: str) -> bool:
    return "spread" in words_of(task_name)


def angles(moved: Trajectory) -> list[Angle]:
    """The ulnar finger's deviation less the radial one's."""
    pairs = [*zip(FINGERS[1:-1], FINGERS[2:]), (FINGERS[1], FINGERS[-1])]
    return [
        joint_angle(
            KINDS["whole_spread" if (a, b) == pairs[-1] else "spread"],
            f"{a}_{b}",
            moved,
            [(f"{b}_mcp", DEVIATION, 1.0), (f"{a}_mcp", DEVIATION, -1.0)],
        )
        for a, b in pairs
    ]


def measure(
    params: Params,
    trajectory: Trajectory,
    onset: float,
    end: float,
    geometry: HandGeometry | None = None,
    asked: TaskRequest = UNKNOWN,
) -> list[SustainedAngle]:
    """Of the fingers that were measured."""
    return sustained_angles.largest_sustained(params.hold, trajectory, onset, end, angles)
