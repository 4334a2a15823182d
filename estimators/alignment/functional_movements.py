"""The steps of a functional calibration, each measured for itself: axes of flexion, gravity, common
rotation, and how well it was done.

In      samples of one step, gyroscope biases
Out     Piece: measurements of the step, its quality, and a sentence for each thing that is
        wrong
Source  Kortier, thesis ch. 2 (2.34) and 3.2.2: flat hand, thumb flat, thumb IP, MCP and all joints
        three times, figure of eight with the hands together
Limits  the mounting follows from all movements together: functional_calibration.py
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from handscope.estimators.alignment import initial_pose
from handscope.estimators.alignment.initial_pose import PoseParams
from handscope.estimators.alignment.mounting_fit import Movement
from handscope.estimators.data.options import option
from handscope.estimators.data.samples import GYR, Block
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, SEGMENTS
from handscope.estimators.messages.sentence import phrase
from handscope.estimators.numerics.axis_estimation import (
    Bending,
    CommonRotation,
    fit_bending,
    fit_common_rotation,
)
from handscope.estimators.numerics.typing import Array
from handscope.estimators.sensors.missing_samples import is_complete

DEG = np.pi / 180
RATE = 100.0  # Hz, common time base of a movement
PRESENT = 0.9  # share of a step's samples that a sensor must have
STEPS: Mapping[str, str] = {
    "flat_hand": phrase("step.flat_hand"),
    "thumb_flat": phrase("step.thumb_flat"),
    "flexion_thumb_ip": phrase("step.flexion_thumb_ip"),
    "flexion_mcp": phrase("step.flexion_mcp"),
    "flexion_all": phrase("step.flexion_all"),
    "figure_eight": phrase("step.figure_eight"),
}
BENT: Mapping[str, tuple[str, ...]] = {
    "flexion_thumb_ip": ("thumb_distal",),
    "flexion_mcp": tuple(
        s for f in FINGERS[1:] for s in CHAINS[f]
    ),  # straight fingers: all three segments turn equally
    "flexion_all": (*(s for f in FINGERS[1:] for s in CHAINS[f]), "thumb_proximal", "thumb_distal"),
}
REST = {
    "flexion_thumb_ip": phrase("functional.rest_thumb"),
    "flexion_mcp": phrase("functional.rest_joints"),
    "flexion_all": phrase("functional.rest_fingers"),
}


@dataclass(frozen=True, kw_only=True)
class FunctionalParams(PoseParams):
    """Options of the functional calibration; angles in deg."""

    functional: bool = option(
        True,
        "",
        "use the steps of a functional calibration where the recording has them",
        "Kortier, thesis ch. 2 and 3",
    )
    step_planarity: float = option(
        0.9,
        "1",
        "least share of a flexion that is about its principal axis",
        "ours: careless flexions in simulation have 0.97",
    )
    step_repeatability: float = option(
        10.0,
        "deg",
        "largest angle between the axis of a single repetition and that of all",
        "ours: the misalignment that is to be removed",
    )
    step_extent: float = option(
        25.0, "deg", "least flexion of a step", "ours: a third of what is asked for"
    )
    step_hand: float = option(
        0.3, "1", "largest rate of the hand against the fingers' in a flexion", "ours"
    )
    step_spread: float = option(
        0.2,
        "1",
        "least turning about a second axis in the figure of eight, against the first",
        "ours",
    )
    step_residual: float = option(
        0.3,
        "1",
        "largest rate of the fingers on the hand against the hand's in the figure of eight",
        "ours",
    )
    soft_tissue: float = option(
        1.5,
        "deg",
        "axis of a sensor's turn against that of its segment",
        "ours: skin turns a sensor by about 2 deg in 90 deg of flexion",
        least=0.1,
    )
    posture_sd: float = option(
        1.5,
        "deg",
        "flexion of each joint that is held straight",
        "ours: even spread within the 2.5 deg by which a pose is missed",
        least=0.1,
    )

    @property
    def uses_movements(self) -> bool:
        """Whether the movements of a functional calibration correct the mounting."""
        return self.functional and self.alignment != "heading"


@dataclass(frozen=True)
class CalibrationMovement:
    """One step as it was done."""

    step: str
    onset: float  # s
    end: float
    up: Mapping[str, Array] = field(default_factory=dict)  # (3,) unit, sensor frames: still steps
    movement: Movement | None = None  # the others
    bent: Mapping[str, Bending] = field(default_factory=dict)  # flexions
    # q_HS of the sensors in the figure of eight
    together: Mapping[str, CommonRotation] = field(default_factory=dict)
    # what the step is judged by, angles in rad
    quality: Mapping[str, float] = field(default_factory=dict)
    problems: tuple[str, ...] = ()  # sentences: why it should be done again


def measure(
    params: FunctionalParams,
    step: str,
    blocks: Sequence[Block],
    onset: float,
    end: float,
    bias: Mapping[str, Array],
) -> CalibrationMovement:
    """What one step gives; `bias`: of the gyroscopes (3,) by segment, from a pose or a still
    step."""
    window = [b.between(onset, end) for b in blocks if b.stream.inertial]
    piece = CalibrationMovement(step, onset, end)
    if step not in BENT and step != "figure_eight":
        return _measure_posture(params, piece, window)
    movement = _common_rates(window, onset, end, bias)
    piece = replace(piece, movement=movement)
    if len(movement.rate) < 2:
        return replace(
            piece,
            problems=(phrase("functional.no_two_sensors", step=STEPS[step], time=onset),),
        )
    return (
        _measure_turning(params, piece, movement)
        if step == "figure_eight"
        else _measure_bending(params, piece, movement)
    )


def _measure_posture(
    params: FunctionalParams, piece: CalibrationMovement, window: list[Block]
) -> CalibrationMovement:
    """Gravity in each sensor; how still it was, by the limits of the initial pose."""
    found = {name: s for b in window for name, s in initial_pose.held_still(b).items()}
    if "hand" not in found:
        return replace(
            piece,
            problems=(
                phrase("functional.no_hand_samples", step=STEPS[piece.step], time=piece.onset),
            ),
        )
    counted = [n for n in found if n.startswith("thumb") or piece.step == "flat_hand"] or list(
        found
    )
    seen = {n: initial_pose.stillness(found[n]) for n in counted}
    up = {n: found[n].mean[3:] / np.linalg.norm(found[n].mean[3:]) for n in counted}
    restless, tilted = (
        max(seen, key=lambda n: seen[n].rate_wander),
        max(seen, key=lambda n: seen[n].tilt_change),
    )
    quality = {"rate_wander": seen[restless].rate_wander, "tilt_change": seen[tilted].tilt_change}
    problems = []
    if quality["rate_wander"] > params.pose_rate * DEG:
        problems.append(
            phrase("functional.turned", what=restless, rate=quality["rate_wander"] / DEG)
        )
    if quality["tilt_change"] > params.pose_tilt * DEG:
        problems.append(
            phrase("functional.tilted", what=tilted, angle=quality["tilt_change"] / DEG)
        )
    descriptions = tuple(
        phrase("functional.not_still", step=STEPS[piece.step], time=piece.onset, what=p)
        for p in problems
    )
    return replace(piece, up=up, quality=quality, problems=descriptions)


def _measure_bending(
    params: FunctionalParams, piece: CalibrationMovement, movement: Movement
) -> CalibrationMovement:
    """Axes of the segments that bend; the worst of them judges the step."""
    bent = {
        s: fit_bending(movement.rate[s], movement.dt)
        for s in BENT[piece.step]
        if s in movement.rate
    }
    if piece.step == "flexion_all":  # the thumb may take part
        bent = {
            s: b
            for s, b in bent.items()
            if not s.startswith("thumb") or b.extent >= params.step_extent * DEG
        }
    step, time = STEPS[piece.step], piece.onset
    if not bent:
        return replace(
            piece, problems=(phrase("functional.no_bending_samples", step=step, time=time),)
        )
    flat, irregular = (
        min(bent, key=lambda s: bent[s].planarity),
        max(bent, key=lambda s: bent[s].repeatability),
    )
    little, few = (
        min(bent, key=lambda s: bent[s].extent),
        min(bent, key=lambda s: bent[s].repetitions),
    )
    size = max(float(np.sqrt((movement.rate[s] ** 2).sum(axis=1).mean())) for s in bent)
    hand_share = (
        float(np.sqrt((movement.rate["hand"] ** 2).sum(axis=1).mean())) / size
        if "hand" in movement.rate
        else 0.0
    )
    quality = {
        "planarity": bent[flat].planarity,
        "repeatability": bent[irregular].repeatability,
        "extent": bent[little].extent,
        "repetitions": float(bent[few].repetitions),
        "hand_moved": hand_share,
    }
    problems, again = [], REST[piece.step]
    if quality["extent"] < params.step_extent * DEG:
        problems.append(
            phrase(
                "functional.small",
                step=step,
                time=time,
                finger=little,
                extent=quality["extent"] / DEG,
            )
        )
    elif quality["repetitions"] < 2:
        problems.append(phrase("functional.done_once", step=step, time=time, finger=few))
    if hand_share > params.step_hand:
        problems.append(
            phrase("functional.hand_moved", step=step, time=time, share=100 * hand_share)
        )
    elif quality["planarity"] < params.step_planarity:
        problems.append(
            phrase(
                "functional.not_planar",
                step=step,
                time=time,
                finger=flat,
                share=100 * quality["planarity"],
                again=again,
            )
        )
    elif quality["repeatability"] > params.step_repeatability * DEG:
        problems.append(
            phrase(
                "functional.irregular",
                step=step,
                time=time,
                finger=irregular,
                distance=quality["repeatability"] / DEG,
                again=again,
            )
        )
    return replace(piece, bent=bent, quality=quality, problems=tuple(problems))


def _measure_turning(
    params: FunctionalParams, piece: CalibrationMovement, movement: Movement
) -> CalibrationMovement:
    """How every sensor is turned against the hand's while all move as one body."""
    time = piece.onset
    if "hand" not in movement.rate:
        missing = phrase("functional.no_hand_samples", step=STEPS["figure_eight"], time=time)
        return replace(piece, problems=(missing,))
    together = {
        s: fit_common_rotation(movement.rate["hand"], rate) for s, rate in movement.rate.items()
    }
    fingers = [s for s in together if s != "forearm"]
    loose = max(fingers, key=lambda s: together[s].residual)
    quality = {"spread": together["hand"].spread, "residual": together[loose].residual}
    problems = []
    if quality["spread"] < params.step_spread:
        problems.append(phrase("functional.one_axis", time=time, share=100 * quality["spread"]))
    if quality["residual"] > params.step_residual:
        problems.append(
            phrase(
                "functional.finger_moved",
                finger=loose,
                time=time,
                share=100 * quality["residual"],
            )
        )
    rigid = {s: c for s, c in together.items() if c.residual <= params.step_residual}
    return replace(piece, together=rigid, quality=quality, problems=tuple(problems))


def _common_rates(
    window: Sequence[Block], onset: float, end: float, bias: Mapping[str, Array]
) -> Movement:
    """Rates of the sensors that hardly miss a sample, on one time base."""
    t, rates = np.arange(onset, end, 1.0 / RATE), {}
    for block in (b for b in window if len(b.t)):
        whole, gyr = is_complete(block), block.of(GYR)
        for k, name in enumerate(block.stream.sensors):
            if name in SEGMENTS and whole[:, k].sum() > max(
                PRESENT * (end - onset) * block.stream.rate, 10
            ):
                seen = block.t[whole[:, k]]
                rates[name] = np.stack(
                    [np.interp(t, seen, gyr[whole[:, k], k, a]) for a in range(3)], axis=1
                ) - bias.get(name, np.zeros(3))
    return Movement(1.0 / RATE, rates)
