"""Measures of the largest sustained angle: thumb abduction, finger spread, forearm rotation.

In      a trajectory and the stretch of time of the task
Out     the largest of each angle that was held, rad
Source  thumb: of the metacarpal, as the Pollexograph-metacarpal reads it (de Kraker 2009, J Hand Surg
        Am 34:523); methods that read the whole thumb give about 12 deg more. Spread: Chatzioglou 2024
        (Anat Cell Biol 57:172), there from a photograph; here from the deviations of the MCP joints.
        Forearm: neutral is the thumb up, elbow at the side (AAOS, Norkin App. A); the direction of
        the palm is read against gravity: ours
Limits  zero of the thumb is the palm's plane and the direction of the fingers (docs/conventions.md);
        zero of the spread is fingers parallel in the initial pose, so a spread in it is not counted.
        The hand's long axis must not stand upright; rotation of the shoulder is counted as forearm
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import (
    DEVIATION,
    FINGERS,
    FLEXION,
    PRONATION,
    SEGMENT,
    side_sign,
)
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.measures import sustained_angles
from handscope.estimators.measures.figure import Kind, kinds
from handscope.estimators.measures.sustained_angles import Angle, SustainedAngle, joint_angle
from handscope.estimators.measures.task_request import UNKNOWN, TaskRequest, words_of
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array

THUMB_SOURCE = phrase("figure_source.metacarpal")
FOREARM_SOURCE = phrase("figure_source.against_gravity")
THUMB_DOWN = -120.0 * np.pi / 180  # that nobody turns to from above
# rad, of the hand's inclination: the worst of ten real trials (docs/validation/broad.md)
INCLINATION = 1.7 * np.pi / 180


@dataclass(frozen=True)
class SustainedAngleMeasure:
    """One measure; `angles` makes the angles to look at of the task's samples."""

    TITLE: str
    KINDS: Mapping[str, Kind]
    applies: Callable[[str], bool]  # to a task of that name
    angles: Callable[[Trajectory], list[Angle]]
    Params: ClassVar[type[sustained_angles.Params]] = sustained_angles.Params
    figures = staticmethod(sustained_angles.figures)
    shown = staticmethod(sustained_angles.shown)

    def measure(
        self,
        params: sustained_angles.Params,
        trajectory: Trajectory,
        onset: float,
        end: float,
        geometry: HandGeometry | None = None,
        asked: TaskRequest = UNKNOWN,
    ) -> list[SustainedAngle]:
        """The angles that were measured, each with its largest sustained value."""
        return sustained_angles.largest_sustained(params.hold, trajectory, onset, end, self.angles)


def palm_turn(moved: Trajectory) -> Array:
    """Angle by which the palm is turned up about the hand's long axis (n,), rad.

    0 palm down, pi/2 thumb up, up to pi palm up, negative thumb down.
    """
    up = quat.rotate(quat.conjugate(moved.q_GS[:, SEGMENT["hand"]]), np.array([0.0, 0.0, 1.0]))
    turned = np.arctan2(-side_sign(moved.hand) * up[:, 2], side_sign(moved.hand) * up[:, 0])
    return np.where(turned < THUMB_DOWN, turned + 2 * np.pi, turned)


def _is_thumb_task(task_name: str) -> bool:
    words = words_of(task_name)
    return (
        "thumb" in words
        and bool(words & {"rom", "prom", "abduction"})
        and not words & {"mcp", "ip"}
    )


def _thumb_angles(moved: Trajectory) -> list[Angle]:
    """Palmar abduction, radial abduction and pronation of the metacarpal."""
    each = (
        ("palmar_abduction", FLEXION, 1.0),
        ("radial_abduction", DEVIATION, -1.0),
        ("pronation", PRONATION, 1.0),
    )
    return [
        joint_angle(THUMB_ABDUCTION.KINDS[what], "thumb_cmc", moved, [("thumb_cmc", a, weight)])
        for what, a, weight in each
    ]


def _spread_angles(moved: Trajectory) -> list[Angle]:
    """The ulnar finger's deviation less the radial one's."""
    pairs = [*zip(FINGERS[1:-1], FINGERS[2:]), (FINGERS[1], FINGERS[-1])]
    return [
        joint_angle(
            FINGER_SPREAD.KINDS["whole_spread" if (a, b) == pairs[-1] else "spread"],
            f"{a}_{b}",
            moved,
            [(f"{b}_mcp", DEVIATION, 1.0), (f"{a}_mcp", DEVIATION, -1.0)],
        )
        for a, b in pairs
    ]


def _is_forearm_task(task_name: str) -> bool:
    words = words_of(task_name)
    return "forearm" in words and bool(words & {"rom", "prom"})


def _forearm_angles(moved: Trajectory) -> list[Angle]:
    """Both directions from the thumb up."""
    up = palm_turn(moved) - np.pi / 2
    sd = np.full(len(up), INCLINATION)
    return [
        Angle(FOREARM_ROTATION.KINDS["supination"], "", up, sd, [SEGMENT["hand"]]),
        Angle(FOREARM_ROTATION.KINDS["pronation"], "", -up, sd, [SEGMENT["hand"]]),
    ]


THUMB_ABDUCTION = SustainedAngleMeasure(
    phrase("measure_title.thumb_abduction"),
    kinds(
        Kind(
            "palmar_abduction",
            "rad",
            phrase("figure_meaning.palmar_abduction"),
            THUMB_SOURCE,
        ),
        Kind(
            "radial_abduction",
            "rad",
            phrase("figure_meaning.radial_abduction"),
            THUMB_SOURCE,
        ),
        Kind(
            "pronation",
            "rad",
            phrase("figure_meaning.thumb_pronation"),
            phrase("figure_source.cmc_angle"),
        ),
    ),
    _is_thumb_task,
    _thumb_angles,
)
FINGER_SPREAD = SustainedAngleMeasure(
    phrase("measure_title.finger_spread"),
    kinds(
        Kind(
            "spread",
            "rad",
            phrase("figure_meaning.spread"),
            "Chatzioglou 2024 (Anat Cell Biol 57:172)",
        ),
        Kind(
            "whole_spread",
            "rad",
            phrase("figure_meaning.whole_spread"),
            phrase("figure_source.spreads_at_once"),
        ),
    ),
    lambda task_name: "spread" in words_of(task_name),
    _spread_angles,
)
FOREARM_ROTATION = SustainedAngleMeasure(
    phrase("measure_title.forearm_rotation"),
    kinds(
        Kind(
            "supination",
            "rad",
            phrase("figure_meaning.supination"),
            FOREARM_SOURCE,
        ),
        Kind(
            "pronation",
            "rad",
            phrase("figure_meaning.forearm_pronation"),
            FOREARM_SOURCE,
        ),
    ),
    _is_forearm_task,
    _forearm_angles,
)
