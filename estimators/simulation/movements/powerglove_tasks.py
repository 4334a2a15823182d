"""The 15 finger movements of the PowerGlove study and the grips of the repeatability protocol, as postures to go between.

Angles  deg, on top of the flat hand; what is not named stays flat
Source  Kortier thesis, Table 3.1 (pace, repetitions; mean rate of the fast tasks) and ch. 2 (flat hand and mould, 6 s each, 10 times)
Limits  extents are ours, within the natural ranges of grasp_postures.py; the table prints the index finger for tasks 8 and 9, which repeats 2 and 3:
        read as index and middle finger, as task 7
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.motion import COORDINATES, Motion, interpolate_postures

BENT = {"mcp": 65.0, "pip": 75.0, "dip": 40.0}
JOINTS = {"mcp": ("mcp",), "pip_dip": ("pip", "dip"), "all": ("mcp", "pip", "dip")}
INCLINED = {"forearm_flexion": 45.0}  # on the arm-rest: the palm slants by 45 deg
SLOW = 1.0  # s from one end to the other: 0.5 Hz
FAST = 0.5 / 1.3  # s: the fast tasks' mean of 1.3 Hz
SWIFT = 1.2  # s that changing the grip takes, of each 6 s
CIRCLING, RAMP = 1.6, 0.4  # Hz, and s in which circling gets that fast and slow again
RADII = (20.0, 12.0)  # of flexion and deviation


@dataclass(frozen=True)
class Movement:
    """There and back, again and again."""

    there: Mapping[str, float]
    back: Mapping[str, float] = field(default_factory=dict)
    half: float = SLOW  # s for either way, the stay at its end included
    move: float = SLOW  # s of it that are movement
    repetitions: int = 10
    # what each half is called in the events, where they are to be distinguished
    phases: tuple[str, str] | None = None


def bending(fingers: tuple[str, ...], joints: str, **pace: float) -> Movement:
    """Joints of fingers bent and straightened on the arm-rest."""
    there = {f"{f}_{j}_flexion": BENT[j] for f in fingers for j in JOINTS[joints]}
    return Movement({**INCLINED, **there}, INCLINED, **pace)  # type: ignore[arg-type]


def gripping(
    mcp: float, pip: float, dip: float, thumb: Mapping[str, float], phase: str, **place: float
) -> Movement:
    """The whole hand closed for 6 s and flat for 6 s."""
    fingers = {
        f"{f}_{j}_flexion": a
        for f in FINGERS[1:]
        for j, a in (("mcp", mcp), ("pip", pip), ("dip", dip))
    }
    return Movement({**fingers, **thumb, **place}, half=6.0, move=SWIFT, phases=(phase, "flat"))


MOVEMENTS: Mapping[str, Movement] = {
    **{
        f"powerglove_{3 * k + n + 1:02}_{name}_{joints}": bending(fingers, joints)
        for k, (name, fingers) in enumerate(
            (("index", ("index",)), ("middle", ("middle",)), ("both", ("index", "middle")))
        )
        for n, joints in enumerate(JOINTS)
    },
    "powerglove_10_index_fast": bending(("index",), "all", half=FAST, move=FAST, repetitions=39),
    "powerglove_14_index_sideways": Movement(
        {"index_mcp_deviation": -15.0}, {"index_mcp_deviation": 6.0}
    ),
    "repeatability_flat": gripping(
        80.0,
        95.0,
        60.0,
        {
            "thumb_cmc_flexion": 40.0,
            "thumb_cmc_deviation": -10.0,
            "thumb_cmc_pronation": 85.0,
            "thumb_mcp_flexion": 35.0,
            "thumb_ip_flexion": 40.0,
        },
        "fist",
        wrist_z=0.08,
    ),
    "repeatability_mould": gripping(
        50.0,
        60.0,
        30.0,
        {
            "thumb_cmc_flexion": 45.0,
            "thumb_cmc_deviation": -20.0,
            "thumb_cmc_pronation": 75.0,
            "thumb_mcp_flexion": 20.0,
            "thumb_ip_flexion": 25.0,
        },
        "grip",
    ),
}

POINTING = {
    f"{f}_{j}_flexion": a
    for f in FINGERS[2:]
    for j, a in (("mcp", 60.0), ("pip", 75.0), ("dip", 40.0))
} | {
    "index_mcp_flexion": 20.0,
    "thumb_cmc_flexion": 30.0,
    "thumb_cmc_deviation": -15.0,
    "thumb_cmc_pronation": 75.0,
}


def circles(centre: Array, turns: int = 10, rate: float = CIRCLING) -> Motion:
    """The index finger goes round a posture (54,) `turns` times, beginning and ending at rest where it is straightest."""
    duration = turns / rate + RAMP
    t = np.linspace(0.0, duration, round(60 * duration))
    s = np.clip(np.minimum(t, duration - t) / RAMP, 0.0, 1.0)
    gone = np.cumsum(s**3 * (10 - 15 * s + 6 * s**2))
    angle = 2 * np.pi * turns * (gone - gone[0]) / (gone[-1] - gone[0])
    x = np.tile(centre, (len(t), 1))
    x[:, COORDINATES["index_mcp_flexion"]] -= np.radians(RADII[0]) * np.cos(angle)
    x[:, COORDINATES["index_mcp_deviation"]] += np.radians(RADII[1]) * np.sin(angle)
    return interpolate_postures(t, x)
