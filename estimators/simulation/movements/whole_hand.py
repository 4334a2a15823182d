"""The whole hand moved about in space: translation and rotation in all directions, the wrist included.

Source  Salchow-Hoemmen 2019, 3.2.1: moved via translation and rotation into all directions; extents and rates are ours, below 2 rad/s
"""

import numpy as np

from handscope.estimators.hand.anatomy import Hand, side_sign
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.motion import COORDINATES, SIZE

EXTENT = {  # m or deg
    "wrist_x": 0.12,
    "wrist_y": 0.12,
    "wrist_z": 0.10,
    "forearm_flexion": 35.0,
    "forearm_deviation": 30.0,
    "forearm_pronation": 60.0,
    "wrist_flexion": 20.0,
    "wrist_deviation": 10.0,
}
LIFTED = 0.20  # m: so far above where it rests on the desk does the hand move about, fingers hanging down stay above the desk
SLOWEST, QUICKEST = 0.08, 0.35  # Hz


def moving(t: Array, rng: np.random.Generator, hand: Hand) -> Array:
    """What the movement adds to the coordinates (n, 54); at rest in the neutral place at both ends; mirrored for the other hand."""
    x = np.zeros((len(t), SIZE))
    for name, extent in EXTENT.items():
        size = extent if name in ("wrist_x", "wrist_y", "wrist_z") else np.radians(extent)
        x[:, COORDINATES[name]] = size * gently(t) * swaying(t, rng)
    x[:, COORDINATES["wrist_z"]] += LIFTED * gently(t)
    # to the left with the left hand is to the right with the right one
    x[:, COORDINATES["wrist_x"]] *= side_sign(hand)
    return x


def swaying(t: Array, rng: np.random.Generator) -> Array:
    """A random course (n,) between -1 and 1: three sines, together no faster than one at the quickest rate."""
    rates, phases = rng.uniform(SLOWEST, QUICKEST, 3), rng.uniform(0, 2 * np.pi, 3)
    return np.asarray(np.sin(2 * np.pi * t[:, None] * rates + phases).mean(axis=1))


def gently(t: Array, ramp: float = 2.0) -> Array:
    """From 0 to 1 within the first `ramp` seconds, back within the last (n,)."""
    return smooth(np.minimum(t - t[0], t[-1] - t) / ramp)


def smooth(s: Array) -> Array:
    """The minimum-jerk step from 0 to 1 as s goes from 0 to 1; constant outside."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(s**3 * (10 - s * (15 - 6 * s)))
