"""Holding a spacer, a pinch or a block while the hand moves: closed chains whose contact points keep their distance.

Source  Salchow-Hoemmen 2019, 3.2 and Table 5: spacers of 3 cm, a pinch closed twice, a block; every trial 15 to 35 s
Limits  which points of the fingertips touch the block is not given in the paper: the bottoms here; fingers sway by a few degrees as the hold permits
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.motion import COORDINATES, interpolate_postures, make_posture
from handscope.estimators.simulation.movements.grasp_postures import Hold as Hold
from handscope.estimators.simulation.movements.grasp_postures import (
    close_holds,
    fingers_of,
    freedoms,
)
from handscope.estimators.simulation.movements.guided_movements import RATE, frame_motion
from handscope.estimators.simulation.movements.task_performance import Performance, relaxed
from handscope.estimators.simulation.movements.whole_hand import gently, moving, smooth, swaying

SPACER_THUMB_INDEX = Hold(("thumb", "bottom"), ("index", "bottom"), 0.030)
SPACER_INDEX_MIDDLE = Hold(("index", "left"), ("middle", "right"), 0.030)
PINCH = Hold(("thumb", "distal"), ("index", "distal"), 0.0)
BLOCK: Mapping[str, Hold] = {
    "F1-F2": Hold(("thumb", "bottom"), ("index", "bottom"), 0.053),
    "F1-F3": Hold(("thumb", "bottom"), ("middle", "bottom"), 0.046),
    "F2-F3": Hold(("index", "bottom"), ("middle", "bottom"), 0.025),
}
SWAY = np.radians(3.0)  # of each joint before the hold corrects it; ours
TRIAL = (20.0, 32.0)  # s
MARGIN = 0.1  # s, at both ends of a closed pinch that are not judged

# postures near the holds, within 5 deg of what an average hand needs
THUMB = {
    "thumb_cmc_flexion": 30.0,
    "thumb_cmc_deviation": -28.0,
    "thumb_cmc_pronation": 75.0,
    "thumb_mcp_flexion": 14.0,
    "thumb_ip_flexion": 14.0,
}
SPACED = make_posture(
    relaxed(), **THUMB, index_mcp_flexion=48.0, index_pip_flexion=38.0, index_dip_flexion=20.0
)
PINCHED = make_posture(
    SPACED,
    thumb_cmc_flexion=40.0,
    thumb_cmc_deviation=-18.0,
    index_mcp_flexion=55.0,
    index_pip_flexion=47.0,
    index_dip_flexion=25.0,
)
OPEN_DISTANCE = make_posture(relaxed(), index_mcp_deviation=-7.0, middle_mcp_deviation=7.0)
GRASPED = make_posture(
    SPACED,
    thumb_cmc_flexion=40.0,
    thumb_cmc_deviation=-32.0,
    index_mcp_flexion=38.0,
    index_mcp_deviation=7.0,
    index_pip_flexion=31.0,
    index_dip_flexion=17.0,
    middle_mcp_flexion=50.0,
    middle_mcp_deviation=-6.5,
    middle_pip_flexion=40.0,
    middle_dip_flexion=21.0,
)


def spacer_thumb_index(
    geometry: HandGeometry, rng: np.random.Generator, sway: float = SWAY
) -> Performance:
    """P1: a spacer between the bottoms of thumb and index."""
    return _hold_while_moving("P1", [SPACER_THUMB_INDEX], SPACED, geometry, rng, sway)


def spacer_index_middle(
    geometry: HandGeometry, rng: np.random.Generator, sway: float = SWAY
) -> Performance:
    """P2: a spacer between the sides of index and middle finger that face each other."""
    return _hold_while_moving("P2", [SPACER_INDEX_MIDDLE], OPEN_DISTANCE, geometry, rng, sway)


def block(geometry: HandGeometry, rng: np.random.Generator, sway: float = SWAY) -> Performance:
    """P4: a block held with thumb, index and middle finger."""
    return _hold_while_moving("P4", list(BLOCK.values()), GRASPED, geometry, rng, sway)


def pinch_twice(
    geometry: HandGeometry, rng: np.random.Generator, sway: float = SWAY, shut: float | None = None
) -> Performance:
    """P3: distal tips of thumb and index in contact, closed (for `shut` s) and opened twice; the closed stretches are the task."""
    return _perform_pinches(
        "P3", 2, rng.uniform(8.0, 12.0) if shut is None else shut, 3.0, 1.2, geometry, rng, sway
    )


def pinches(geometry: HandGeometry, rng: np.random.Generator, sway: float = SWAY) -> Performance:
    """Ten pinches of thumb and index, each closed for about a second, the hand turning meanwhile. Source: Kortier thesis 2.2.5"""
    return _perform_pinches("pinch", 10, rng.uniform(1.0, 1.3), 1.6, 0.6, geometry, rng, sway)


def _perform_pinches(
    name: str,
    times: int,
    shut: float,
    pause: float,
    gentle: float,
    geometry: HandGeometry,
    rng: np.random.Generator,
    sway: float,
) -> Performance:
    """Closed for `shut` s and open for `pause` s, opening and closing within `gentle` s each."""
    t = _times(times * (shut + pause) - gentle)
    x = _hold_postures([PINCH], PINCHED, geometry, t, rng, sway)
    opening = sum(_bump(t, k * shut + (k - 1) * pause, pause, gentle) for k in range(1, times + 1))
    opening_change = make_posture(
        None, index_mcp_flexion=-30.0, index_pip_flexion=-15.0, thumb_cmc_deviation=-15.0
    )
    whole = frame_motion(
        name, interpolate_postures(t, x + np.asarray(opening)[:, None] * opening_change)
    )
    (task,) = whole.events
    margin = min(MARGIN, 0.2 * shut)
    closed_at = (task.onset + k * (shut + pause) for k in range(times))
    return replace(
        whole,
        events=tuple(
            replace(task, onset=onset + margin, duration=shut - 2 * margin) for onset in closed_at
        ),
    )


def _hold_while_moving(
    name: str,
    holds: Sequence[Hold],
    guess: Array,
    geometry: HandGeometry,
    rng: np.random.Generator,
    sway: float,
) -> Performance:
    t = _times(rng.uniform(*TRIAL))
    return frame_motion(
        name, interpolate_postures(t, _hold_postures(holds, guess, geometry, t, rng, sway))
    )


def _hold_postures(
    holds: Sequence[Hold],
    guess: Array,
    geometry: HandGeometry,
    t: Array,
    rng: np.random.Generator,
    sway: float,
) -> Array:
    """Postures (n, 54): the hold closed throughout, the fingers swaying in it (rad), the whole hand moving."""
    x = close_holds(guess[None], holds, geometry) + moving(t, rng, geometry.hand)
    if not sway:  # closed as it is, and a hundred times quicker made
        return np.asarray(x)
    for name in (name for finger in fingers_of(holds) for name, _, _ in freedoms(finger)):
        x[:, COORDINATES[name]] += sway * gently(t) * swaying(t, rng)
    return close_holds(x, holds, geometry)


def _times(duration: float) -> Array:
    return np.linspace(0.0, duration, round(duration * RATE) + 1)


def _bump(t: Array, start: float, duration: float, gentle: float) -> Array:
    """From 0 to 1 and back (n,), within `duration` from `start`."""
    return smooth((t - start) / gentle) * smooth((start + duration - t) / gentle)
