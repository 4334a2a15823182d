"""The steps of a functional calibration as somebody does them who is not quite careful.

Out     performances from and to the relaxed posture; the event of each is the step itself, by the step's name
Source  Kortier, thesis 3.2.2: flat hand, thumb flat, thumb IP three times, MCP of all fingers three times, all joints three times, hands together in a
        figure of eight for 5 s
Limits  how carelessly somebody does it is ours; in `flexion_all` the thumb bends its two hinges while its metacarpal rests
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.data.samples import Event
from handscope.estimators.hand.anatomy import FINGERS, IS_DOF
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.motion import COORDINATES, interpolate_postures, make_posture
from handscope.estimators.simulation.movements.guided_movements import RATE, frame_motion
from handscope.estimators.simulation.movements.task_performance import POSE_THUMB, Performance, flat
from handscope.estimators.simulation.movements.whole_hand import gently, smooth, swaying

HALF = 1.4  # s from straight to bent: joint rates below 2 rad/s
LEAD = 1.5  # s from the relaxed posture into the step
THUMB_FLAT = make_posture(None, thumb_cmc_deviation=-45.0)  # nail and back of the thumb upwards
BENT: Mapping[str, Mapping[str, float]] = {
    "flexion_thumb_ip": {"thumb_ip_flexion": 60.0},
    "flexion_mcp": {f"{f}_mcp_flexion": 75.0 for f in FINGERS[1:]},
    "flexion_all": {
        **{
            f"{f}_{joint}_flexion": a
            for f in FINGERS[1:]
            for joint, a in (("mcp", 65.0), ("pip", 80.0), ("dip", 45.0))
        },
        "thumb_mcp_flexion": 40.0,
        "thumb_ip_flexion": 55.0,
    },
}  # deg


@dataclass(frozen=True, kw_only=True)
class Carelessness:
    """How far what is done is from what was asked for: largest differences, evenly drawn."""

    pose: float = option(
        2.5,
        "deg",
        "every freedom of every joint in a still posture",
        "asked for by our targets for the initial pose",
    )
    divergence: float = option(
        3.0,
        "deg",
        "ab- and adduction of a finger that comes and goes with its flexion",
        "fingers converge in a fist; size ours",
    )
    joints: float = option(3.0, "deg", "swaying of joints that should rest", "ours")
    hand: float = option(4.0, "deg", "swaying of the hand that should rest", "ours")


def flat_hand(geometry: HandGeometry, rng: np.random.Generator, care: Carelessness) -> Performance:
    """Palm and fingers on a level table, still for 4 s."""
    known = dict(
        zip(
            ("thumb_cmc_flexion_deg", "thumb_cmc_deviation_deg", "thumb_cmc_pronation_deg"),
            POSE_THUMB,
        )
    )
    return _still("flat_hand", miss_posture(flat(), care.pose, rng), known)


def thumb_flat(geometry: HandGeometry, rng: np.random.Generator, care: Carelessness) -> Performance:
    """The thumb straight on the table, its nail level."""
    return _still("thumb_flat", miss_posture(THUMB_FLAT, care.pose, rng), {})


def flexion_thumb_ip(
    geometry: HandGeometry, rng: np.random.Generator, care: Carelessness
) -> Performance:
    """The thumb's last joint bends three times."""
    return _bending("flexion_thumb_ip", rng, care)


def flexion_mcp(
    geometry: HandGeometry, rng: np.random.Generator, care: Carelessness
) -> Performance:
    """The straight fingers bend at their MCP joints three times."""
    return _bending("flexion_mcp", rng, care)


def flexion_all(
    geometry: HandGeometry, rng: np.random.Generator, care: Carelessness
) -> Performance:
    """All joints of the fingers and the thumb's two hinges bend three times."""
    return _bending("flexion_all", rng, care)


def figure_eight(
    geometry: HandGeometry, rng: np.random.Generator, care: Carelessness, duration: float = 5.0
) -> Performance:
    """Both hands together, fingers straight: three figures of eight."""
    t = _times(duration)
    phase = 6 * np.pi * smooth((t - t[0]) / duration * 0.999)
    x = np.tile(miss_posture(flat(), care.pose, rng), (len(t), 1))
    for name, extent, turn in (
        ("forearm_deviation", 22.0, np.sin(phase)),
        ("forearm_flexion", 14.0, np.sin(2 * phase)),
        ("forearm_pronation", 22.0, 1 - np.cos(phase)),
    ):
        x[:, COORDINATES[name]] += np.radians(extent) * turn
    for name, extent, turn in (
        ("wrist_x", 0.12, np.sin(phase)),
        ("wrist_z", 0.06, np.sin(2 * phase)),
    ):
        x[:, COORDINATES[name]] += extent * turn
    # pressed against the other hand they sway less
    x[:, 6:] += np.radians(0.5 * care.joints) * _swaying_joints(t, rng)
    return _step("figure_eight", t, x, {})


STEPS: Mapping[str, Callable[[HandGeometry, np.random.Generator, Carelessness], Performance]] = {
    "flat_hand": flat_hand,
    "thumb_flat": thumb_flat,
    "flexion_thumb_ip": flexion_thumb_ip,
    "flexion_mcp": flexion_mcp,
    "flexion_all": flexion_all,
    "figure_eight": figure_eight,
}


def all_steps(
    geometry: HandGeometry, rng: np.random.Generator, care: Carelessness | None = None
) -> tuple[Performance, ...]:
    """The whole calibration, step after step."""
    return tuple(step(geometry, rng, care or Carelessness()) for step in STEPS.values())


def miss_posture(posture: Array, largest_deg: float, rng: np.random.Generator) -> Array:
    """A posture with every freedom of every joint off by up to `largest_deg`, evenly spread."""
    off = np.radians(largest_deg) * rng.uniform(-1, 1, IS_DOF.shape) * IS_DOF
    return np.concatenate([posture[:6], posture[6:] + off.ravel()])


def _still(name: str, held: Array, details: Mapping[str, float]) -> Performance:
    t = _times(4.0)
    return _step(name, t, np.tile(held, (len(t), 1)), details)


def _bending(name: str, rng: np.random.Generator, care: Carelessness) -> Performance:
    """Three times there and back, each a little different, everything else swaying."""
    t = _times(6 * HALF + 0.6)
    bend = sum(
        rng.uniform(0.85, 1.0) * (smooth((t - s) / HALF) - smooth((t - s - HALF) / HALF))
        for s in 0.3 + 2 * HALF * np.arange(3)
    )
    x = np.tile(
        miss_posture(THUMB_FLAT if name == "flexion_thumb_ip" else flat(), care.pose, rng),
        (len(t), 1),
    )
    x += np.asarray(bend)[:, None] * make_posture(None, **BENT[name])
    for coordinate in BENT[name]:
        if coordinate.endswith("mcp_flexion") and not coordinate.startswith("thumb"):
            side = COORDINATES[coordinate.replace("flexion", "deviation")]
            x[:, side] += np.radians(care.divergence) * rng.uniform(-1, 1) * np.asarray(bend)
    resting = np.ones(48)
    resting[[COORDINATES[c] - 6 for c in BENT[name]]] = 0.0
    x[:, 6:] += np.radians(care.joints) * resting * _swaying_joints(t, rng)
    for coordinate in ("forearm_flexion", "forearm_deviation", "forearm_pronation"):
        x[:, COORDINATES[coordinate]] += np.radians(care.hand) * gently(t, 1.0) * swaying(t, rng)
    return _step(name, t, x, {})


def _swaying_joints(t: Array, rng: np.random.Generator) -> Array:
    """Between -1 and 1 for every freedom of a joint (n, 48), at rest at both ends."""
    courses = np.stack([swaying(t, rng) for _ in range(IS_DOF.size)], axis=1)
    return np.asarray(gently(t, 1.0)[:, None] * courses * IS_DOF.ravel())


def _times(duration: float) -> Array:
    return np.linspace(0.0, duration, round(duration * RATE) + 1)


def _step(name: str, t: Array, x: Array, details: Mapping[str, float]) -> Performance:
    """Framed by the relaxed posture; the event is the step."""
    done = frame_motion(name, interpolate_postures(t, x), LEAD)
    return Performance(done.motion, (Event(LEAD, float(t[-1]), name, details),))
