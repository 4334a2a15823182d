"""Movements of single fingers as an experimenter asks for them: abduction, flexion, circles, one joint after the other, and moving freely.

Source  Salchow-Hoemmen 2019, 3.1.3 (10-15 repetitions in 30-50 s, below 2 rad/s); Valtin 2017, Fig. 4; Kortier thesis ch. 2 (116 per minute, 80 deg)
Limits  extents of the joints are ours, within the natural ranges of grasp_postures.py; repetitions vary as people's do, by up to a fifth
"""

from collections.abc import Mapping

import numpy as np

from handscope.estimators.data.samples import Event
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.motion import (
    COORDINATES,
    Motion,
    interpolate_postures,
    join_motions,
    make_posture,
    move_through,
)
from handscope.estimators.simulation.movements.grasp_postures import NATURAL
from handscope.estimators.simulation.movements.task_performance import Performance, flat, relaxed
from handscope.estimators.simulation.movements.whole_hand import gently, moving

FASTEST = 1.9  # rad/s, of a joint: the paper stays below 2
PEAK = 1.875  # greatest rate of a minimum-jerk movement against its mean rate
RATE = 50.0  # Hz, of the samples that a spline goes through

ABDUCTION = {
    "thumb": ({"thumb_cmc_deviation": -58.0}, {"thumb_cmc_deviation": -12.0}),
    "index": ({"index_mcp_deviation": -15.0}, {"index_mcp_deviation": 6.0}),
    "middle": ({"middle_mcp_deviation": -12.0}, {"middle_mcp_deviation": 12.0}),
}
OPPOSITION = {
    "thumb_cmc_flexion": 35.0,
    "thumb_cmc_deviation": -10.0,
    "thumb_cmc_pronation": 85.0,
    "thumb_mcp_flexion": 25.0,
    "thumb_ip_flexion": 30.0,
}


def abduction(
    geometry: HandGeometry, rng: np.random.Generator, name: str, finger: str
) -> Performance:
    """Out and in, the finger straight."""
    out, inward = (make_posture(flat(), **x) for x in ABDUCTION[finger])
    return _repeat(name, out, inward, rng)


def flexion(
    geometry: HandGeometry, rng: np.random.Generator, name: str, finger: str
) -> Performance:
    """All joints of the finger bent, then straight."""
    bent = make_posture(
        flat(),
        **{
            f"{finger}_mcp_flexion": 65.0,
            f"{finger}_pip_flexion": 75.0,
            f"{finger}_dip_flexion": 40.0,
        },
    )
    return _repeat(name, bent, flat(), rng)


def circling(
    geometry: HandGeometry, rng: np.random.Generator, name: str, finger: str
) -> Performance:
    """Abduction and flexion in quadrature: the tip goes round; the thumb goes round to opposition and back."""
    n, period = int(rng.integers(10, 16)), rng.uniform(2.8, 3.2)
    t, phase = _phase(n, period)
    # varies slowly, by up to a fifth
    size = 1.0 - 0.1 * (1 - np.cos(phase / (0.5 * n))) * rng.uniform(0.5, 1.0)
    bend, swing = 0.5 * (1 - np.cos(phase)) * size, np.sin(phase) * size
    x = np.tile(flat(), (len(t), 1))
    if finger == "thumb":
        x += bend[:, None] * (make_posture(flat(), **OPPOSITION) - flat())
        x[:, COORDINATES["thumb_cmc_deviation"]] += np.radians(12.0) * swing
    else:
        x[:, COORDINATES[f"{finger}_mcp_flexion"]] += np.radians(50.0) * bend
        x[:, COORDINATES[f"{finger}_pip_flexion"]] += np.radians(20.0) * bend
        x[:, COORDINATES[f"{finger}_dip_flexion"]] += np.radians(10.0) * bend
        x[:, COORDINATES[f"{finger}_mcp_deviation"]] += np.radians(12.0) * swing
    return frame_motion(name, interpolate_postures(t, x))


def brisk_flexion(geometry: HandGeometry, rng: np.random.Generator) -> Performance:
    """The index finger bent as far as it goes and stretched, five times, a second each. Source: Kortier thesis 2.2.5"""
    bent = make_posture(
        flat(), index_mcp_flexion=80.0, index_pip_flexion=95.0, index_dip_flexion=55.0
    )
    points, t = [(0.0, flat())], 0.0
    for _ in range(5):
        reached = flat() + rng.uniform(0.9, 1.0) * (bent - flat())
        for x in (reached, flat()):
            t += 0.5 * rng.uniform(0.9, 1.1)
            points.append((t, x))
    return frame_motion("brisk flexion", move_through(points))


def brisk_circles(geometry: HandGeometry, rng: np.random.Generator) -> Performance:
    """The outstretched index finger goes round five times, a second each, as far aside as it goes. Source: Kortier thesis 2.2.5"""
    t, phase = _phase(5, rng.uniform(0.95, 1.05))
    size = gently(t, 1.0)
    x = np.tile(flat(), (len(t), 1))
    x[:, COORDINATES["index_mcp_flexion"]] += np.radians(20.0) * size * np.sin(phase)
    x[:, COORDINATES["index_mcp_deviation"]] += np.radians(14.0) * size * np.cos(phase)
    return frame_motion("brisk circles", interpolate_postures(t, x))


def mechanical_finger(geometry: HandGeometry, rng: np.random.Generator) -> Performance:
    """DIP, then PIP, then MCP to 90 deg, then back in reverse order: DIP is at 90 deg from 50 to 140 s, as in the figure."""
    points, x = [(0.0, flat())], flat()
    moves = (
        (40.0, "dip", 90.0),
        (65.0, "pip", 90.0),
        (85.0, "mcp", 90.0),
        (100.0, "mcp", 0.0),
        (120.0, "pip", 0.0),
        (140.0, "dip", 0.0),
    )
    for start, joint, angle in moves:
        points.append((start, x))
        x = make_posture(x, **{f"index_{joint}_flexion": angle})
        points.append((start + 10.0, x))
    return frame_motion("mechanical finger", move_through([*points, (190.0, x)]))


def open_close(
    geometry: HandGeometry,
    rng: np.random.Generator,
    per_minute: float = 116.0,
    duration: float = 30.0,
) -> Performance:
    """All fingers bend by 80 deg of PIP flexion and stretch again, by the metronome."""
    flexion = {
        f"{f}_{joint}_flexion": angle
        for f in FINGERS[1:]
        for joint, angle in (("mcp", 30.0), ("pip", 80.0), ("dip", 40.0))
    }
    bent, half = make_posture(flat(), **flexion), 30.0 / per_minute
    turns = range(1, 2 * int(duration * per_minute / 60) + 1)
    return frame_motion(
        "open_close",
        move_through([(0.0, flat()), *((k * half, bent if k % 2 else flat()) for k in turns)]),
    )


def free(geometry: HandGeometry, rng: np.random.Generator, duration: float = 40.0) -> Performance:
    """All joints from one random posture to another while the whole hand moves about."""
    points, t, here = [(0.0, flat())], 0.0, flat()
    while t < duration:
        there = _random_posture(rng)
        t += max(0.8, PEAK * float(np.abs(there - here).max()) / FASTEST) * rng.uniform(1.0, 1.3)
        points.append((t, there))
        here = there
    times = np.arange(0.0, t, 1 / RATE)
    times = np.linspace(0.0, t, len(times) + 1)
    x = move_through(points).at(times)[0]
    return frame_motion("free", interpolate_postures(times, x + moving(times, rng, geometry.hand)))


def frame_motion(name: str, motion: Motion, lead: float = 1.5) -> Performance:
    """From the relaxed posture into the motion and back; the motion is the task."""
    first, last = motion.spline(motion.spline.x[0]), motion.spline(motion.spline.x[-1])
    whole = join_motions(
        move_through([(0.0, relaxed()), (lead, first)]),
        motion,
        move_through([(0.0, last), (lead, relaxed())]),
    )
    return Performance(whole, (Event(lead, motion.duration, "task", {"task_name": name}),))


def _repeat(name: str, there: Array, back: Array, rng: np.random.Generator) -> Performance:
    """10 to 15 times there and back, each a little different, in 30 to 50 s."""
    n = int(rng.integers(10, 16))
    least = PEAK * float(np.abs(there - back).max()) / FASTEST
    half = max(least, rng.uniform(32.0, 40.0) / (2 * n))
    points, t = [(0.0, back)], 0.0
    for _ in range(n):
        reached = back + rng.uniform(0.8, 1.0) * (there - back)
        for x in (reached, back):
            t += half * rng.uniform(1.0, 1.15)
            points.append((t, x))
    return frame_motion(name, move_through(points))


def _phase(turns: int, period: float) -> tuple[Array, Array]:
    """Times and an angle (n,) that goes round `turns` times, starting and ending gently."""
    lead = 1.0
    end = turns * period + lead  # the ramps cost half of each
    t = np.linspace(0.0, end, int(end * RATE) + 1)
    s = np.clip(np.minimum(t, end - t) / lead, 0.0, 1.0)
    # integral of the smooth step 10 s^3 - 15 s^4 + 6 s^5
    ramp = lead * (s**4 * (2.5 - s * (3.0 - s)))
    turned = np.where(
        t <= end / 2,
        ramp + np.maximum(t - lead, 0.0),
        (end - lead) - ramp - np.maximum(end - t - lead, 0.0),
    )
    return t, np.asarray(2 * np.pi * turns * turned / (end - lead))


def _random_posture(rng: np.random.Generator) -> Array:
    """A random posture within the natural ranges; the DIP joint follows the PIP joint, as tendons make it."""
    angles: Mapping[str, float] = {
        f"{joint}_{('flexion', 'deviation', 'pronation')[a]}": float(rng.uniform(low, high))
        for joint, ranges in NATURAL.items()
        for a, (low, high) in enumerate(ranges)
    }
    follows = {f"{f}_dip_flexion": 0.6 * angles[f"{f}_pip_flexion"] for f in FINGERS[1:]}
    return make_posture(flat(), **{**angles, **follows})
