"""Movements of an assessment of the hand, as postures to go between: ranges joint by joint, one finger alone, opposition, reach, turning, tremor.

Angles  deg, on top of the flat hand; what is not named stays flat. Places of the wrist in m.
Source  motions of a range-of-motion sheet: US VA worksheet "Hand, Thumb, Fingers"; opposition: Kapandji 1986, 0-10; one finger alone moves its
        neighbours, too (enslaving: van den Noort 2016)
Limits  extents and paces are ours, within the natural ranges of grasp_postures.py; the shares by which neighbours follow are ours
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.motion import COORDINATES, Motion, interpolate_postures
from handscope.estimators.simulation.movements.powerglove_tasks import Movement

SWING, HELD = 1.6, 2.5  # s that going to an end takes, and s of either way, its stay included
UP, DOWN = -150.0, 0.0  # deg of the forearm, palm up and palm down
TURNING = 1.25  # Hz
FOLLOWS = {
    "thumb": (0.0,),
    "index": (0.08, 0.05),
    "middle": (0.2, 0.15),
    "ring": (0.25, 0.15),
    "little": (0.3, 0.15),
}
SHAKES = 100.0  # Hz, of the samples that a tremor goes through


def _fingers(**angles: float) -> dict[str, float]:
    return {f"{f}_{joint}": a for f in FINGERS[1:] for joint, a in angles.items()}


def _range(
    there: Mapping[str, float], back: Mapping[str, float], phases: tuple[str, str]
) -> Movement:
    """As far as it goes one way, then the other, three times."""
    return Movement(there, back, HELD, SWING, 3, phases)


BEND = ("flexion", "extension")
RANGES: Mapping[str, Movement] = {
    "rom_mcp": _range(_fingers(mcp_flexion=75.0), _fingers(mcp_flexion=-12.0), BEND),
    "rom_pip": _range(_fingers(pip_flexion=90.0, dip_flexion=45.0), {}, BEND),
    "rom_dip": _range(
        _fingers(pip_flexion=15.0, dip_flexion=55.0), _fingers(pip_flexion=15.0), BEND
    ),
    "rom_thumb_mcp": _range({"thumb_mcp_flexion": 50.0}, {"thumb_mcp_flexion": -8.0}, BEND),
    "rom_thumb_ip": _range({"thumb_ip_flexion": 70.0}, {"thumb_ip_flexion": -10.0}, BEND),
    "rom_thumb_radial": _range(
        {"thumb_cmc_deviation": -58.0}, {"thumb_cmc_deviation": -5.0}, ("abduction", "adduction")
    ),
    "rom_thumb_palmar": _range(
        {"thumb_cmc_flexion": 45.0, "thumb_cmc_deviation": -10.0, "thumb_cmc_pronation": 80.0},
        {"thumb_cmc_flexion": 0.0, "thumb_cmc_deviation": -10.0, "thumb_cmc_pronation": 80.0},
        ("abduction", "adduction"),
    ),
    "rom_wrist_flexion": _range({"wrist_flexion": 50.0}, {"wrist_flexion": -45.0}, BEND),
    "rom_wrist_deviation": _range(
        {"wrist_deviation": 25.0}, {"wrist_deviation": -15.0}, ("ulnar", "radial")
    ),
    "rom_forearm": _range(
        {"forearm_pronation": UP}, {"forearm_pronation": DOWN}, ("supination", "pronation")
    ),
    "reach": Movement(
        {
            "wrist_y": 0.28,
            "wrist_z": 0.06,
            **_fingers(mcp_flexion=35.0, pip_flexion=45.0, dip_flexion=20.0),
            "thumb_cmc_flexion": 45.0,
            "thumb_cmc_deviation": -20.0,
            "thumb_cmc_pronation": 75.0,
            "thumb_mcp_flexion": 15.0,
            "thumb_ip_flexion": 20.0,
        },
        {},
        half=3.0,
        move=1.3,
        repetitions=5,
        phases=("reach", "return"),
    ),
}


@dataclass(frozen=True)
class Round:
    """Postures that are gone to one after the other, and back between them."""

    places: Mapping[str, Mapping[str, float]]  # by what the phase is called in the events
    back: Mapping[str, float]
    seconds: float  # of each, going there and back included
    move: float  # s that either way takes
    repetitions: int = 1

    @property
    def duration(self) -> float:
        return len(self.places) * self.seconds * self.repetitions


def _alone(finger: str) -> dict[str, float]:
    """A finger bends as somebody bends it who means this finger only: its neighbours follow a little."""
    if finger == "thumb":
        return {"thumb_mcp_flexion": 40.0, "thumb_ip_flexion": 55.0}
    at = FINGERS.index(finger)
    found: dict[str, float] = {}
    for k, other in enumerate(FINGERS[1:], 1):
        near = FOLLOWS[other]
        share = (
            1.0
            if other == finger
            else near[min(abs(k - at), len(near)) - 1]
            if abs(k - at) <= 2
            else 0.0
        )
        found |= {
            f"{other}_{joint}_flexion": share * a
            for joint, a in (("mcp", 60.0), ("pip", 75.0), ("dip", 40.0))
        }
    return found


def _opposition(
    flexion: float, deviation: float, pronation: float, mcp: float, ip: float, **fingers: float
) -> dict[str, float]:
    thumb = zip(
        ("cmc_flexion", "cmc_deviation", "cmc_pronation", "mcp_flexion", "ip_flexion"),
        (flexion, deviation, pronation, mcp, ip),
    )
    return {**{f"thumb_{name}": a for name, a in thumb}, **fingers}


def _met(finger: str, across: int) -> dict[str, float]:
    """The thumb's pad at a fingertip."""
    bent = {
        f"{finger}_mcp_flexion": 50.0,
        f"{finger}_pip_flexion": 45.0,
        f"{finger}_dip_flexion": 25.0,
    }
    return _opposition(
        35.0 + 5 * across, -20.0 + 5 * across, 75.0 + 5 * across, 15.0 + 5 * across, 20.0, **bent
    )


ROUNDS: Mapping[str, Round] = {
    "finger_independence": Round({f: _alone(f) for f in FINGERS}, {}, 4.0, 1.4, 3),
    "kapandji": Round(
        {
            "position_1": _opposition(10.0, -12.0, 60.0, 5.0, 25.0),
            "position_2": _opposition(15.0, -12.0, 65.0, 5.0, 5.0, index_pip_flexion=20.0),
            **{f"position_{k + 3}": _met(f, k) for k, f in enumerate(FINGERS[1:])},
            "position_7": _opposition(
                52.0, -2.0, 92.0, 35.0, 30.0, little_mcp_flexion=35.0, little_pip_flexion=35.0
            ),
            "position_8": _opposition(
                52.0, 2.0, 95.0, 42.0, 40.0, little_mcp_flexion=25.0, little_pip_flexion=20.0
            ),
            "position_9": _opposition(48.0, 6.0, 98.0, 48.0, 55.0, little_mcp_flexion=10.0),
            "position_10": _opposition(45.0, 10.0, 100.0, 50.0, 60.0),
        },
        {"thumb_cmc_flexion": 30.0, "thumb_cmc_deviation": -30.0, "thumb_cmc_pronation": 65.0},
        3.0,
        1.2,
    ),
}


def trembling(base: Array, duration: float, rate: float, extents: Mapping[str, float]) -> Motion:
    """A posture (54,) in which coordinates tremble by `extents` deg to either side at `rate` Hz, gently at both ends."""
    t = np.linspace(0.0, duration, round(duration * SHAKES) + 1)
    s = np.clip(np.minimum(t, duration - t), 0.0, 1.0)
    x = np.tile(base, (len(t), 1))
    for name, extent in extents.items():
        x[:, COORDINATES[name]] += (
            np.radians(extent) * s**3 * (10 - s * (15 - 6 * s)) * np.sin(2 * np.pi * rate * t)
        )
    return interpolate_postures(t, x)


TREMORS: Mapping[
    str, tuple[float, Mapping[str, float], Mapping[str, float]]
] = {  # Hz, deg that tremble, deg or m of the posture
    "tremor_rest": (
        5.0,
        {"forearm_pronation": 2.0, "index_mcp_flexion": 3.0, "thumb_cmc_flexion": 2.0},
        {"forearm_pronation": -70.0},
    ),
    "tremor_posture": (6.5, {"wrist_flexion": 1.0, "forearm_pronation": 0.7}, {"wrist_z": 0.2}),
}
