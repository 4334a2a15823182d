"""A sensor that was turned on its segment during the recording: its joints lie elsewhere in its frame afterwards.

In      pairs of sensors (sensor_pairs.py)
Out     which sensor, by what turn, from when on
Source  ours: a test for a break (Chow 1960, Econometrica 28:591) at several instants; a rigid turn moves all joints of a sensor together, skin slides them along the segment
Limits  a turn about the line from the sensor to its only joint is not seen; gentle movement does not tell places well enough
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.fault_detection.neighbours import common_joint, joint_windows
from handscope.estimators.fault_detection.neighbours.common_joint import Joint
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.tail_probabilities import chi2_sf, f_sf
from handscope.estimators.numerics.typing import Array

SPLITS = (0.2, 0.35, 0.5, 0.65, 0.8)  # of the recording
TOLERATED = 1.0e-3  # m, each axis, that skin may shift a joint between two movements; ours
MOST = np.radians(60.0)  # what turned further was not worn any more
TURN_SD = np.radians(30.0)
SUDDEN = 3.0  # times its noise a window leaves where a sensor may have been turned
HELD = 0.002  # weight against a turn about the vertical, which gravity does not show, in shares of that of gravity
LEAST_SURE = 0.01
LEAST_PIECE = 6  # samples of a window, before and after
LEAST = np.radians(6.0)  # smaller turns are those of skin and of mounting


@dataclass(frozen=True)
class Slip:
    """A sensor that was turned."""

    sensor: str
    turn: Array  # (3,) rad, of its frame, in its frame
    start: float  # s, from when on
    p_value: float


def find(pairs: Pairs) -> Slip | None:
    """The most certain slip, with the probability of such a change without any."""
    begin, end = float(pairs.series.t[0]), float(pairs.series.t[-1])
    if not pairs.joints:
        return None
    at = begin + np.array(SPLITS) * (end - begin)
    before = [pairs.joint_within(*j, (begin, t)) for t in at for j in pairs.joints]
    after = [pairs.joint_within(*j, (t, end)) for t in at for j in pairs.joints]
    turns, gains = _turned(pairs, before, after)
    split, sensor = np.unravel_index(int(np.argmax(gains)), gains.shape)
    turn = turns[split, sensor]
    if not LEAST < np.linalg.norm(turn) < MOST:
        return None
    p = float(chi2_sf(float(gains[split, sensor]), 3)) * gains.size
    return Slip(pairs.series.sensors[sensor], turn, float(at[split]), min(1.0, p))


def find_jump(pairs: Pairs) -> Slip | None:
    """A turn that the sensor's own gyroscope did not see, at once: before and after it the same joint needs two rotations between the sensors.

    So it looks where samples of the slip are lost, or where readings before and after were joined.
    """
    tests = 2 * len(pairs.series.t) / joint_windows.RATE * len(pairs.series.sensors)
    found = [
        _jumped(each, sensor, tests)
        for each in (pairs, pairs.later(0.5 * joint_windows.LENGTH))
        for sensor in pairs.series.sensors
    ]
    sure = [
        (slip, count)
        for slip, count in found
        if slip is not None
        and slip.p_value < LEAST_SURE
        and LEAST < np.linalg.norm(slip.turn) < MOST
    ]
    return max(sure, key=lambda s: (s[1], -s[0].p_value), default=(None, 0))[0]


def _jumped(pairs: Pairs, sensor: str, tests: float) -> tuple[Slip | None, int]:
    """The sensor's largest jump that all its joints show, and how many they are."""
    around = [j for j in pairs.joints if sensor in j]
    fits = [(j, pairs.joint(*j, j), pairs.use(*j)) for j in around]
    if not fits:
        return None, 0
    ratio = np.min([np.where(use, f.rest / f.noise, 0.0) for _, f, use in fits], axis=0)
    k = int(np.argmax(ratio))
    if ratio[k] < SUDDEN:
        return None, 0
    jumps = [_jump(pairs, j, f, k) for j, f, _ in fits]
    turn = jumps[0][0] if around[0][1] == sensor else -jumps[0][0]
    return Slip(sensor, turn, jumps[0][1], min(1.0, max(p for _, _, p in jumps) * tests)), len(
        around
    )


def _jump(pairs: Pairs, joint: tuple[str, str], found: Joint, k: int) -> tuple[Array, float, float]:
    """The turn (3,) of the second sensor within window k that explains it best, when (s), and the probability of so much better a fit without one."""
    first, second = (pairs.windows(s) for s in joint)
    a = (first.force + first.arm @ found.place[:3])[k]
    b = (second.force + second.arm @ found.place[3:])[k]
    best = (np.zeros(3), 0.0, np.inf)
    for cut in range(LEAST_PIECE, len(a) - LEAST_PIECE):
        before = common_joint.aligned(a[:cut].T @ b[:cut])
        after = common_joint.aligned(a[cut:].T @ b[cut:] + HELD * np.sum(a[cut:] ** 2) * before)
        left = np.concatenate([a[:cut] - b[:cut] @ before.T, a[cut:] - b[cut:] @ after.T])
        rest = float((left**2).mean())
        if rest < best[2]:
            best = (
                quat.log(quat.from_matrix(before.T @ after)),
                float(first.t[k]) + cut * joint_windows.AVERAGED / joint_windows.RATE,
                rest,
            )
    turn, when, rest = best
    free = (
        len(a) - 2 - LEAST_PIECE
    )  # neighbouring samples err together: one of three axes' worth of freedom is counted
    ratio = (float(found.rest[k]) - rest) / 3 / (max(rest, float(found.noise[k])) / free)
    return turn, when, float(f_sf(ratio, 3, free))


def _turned(pairs: Pairs, before: Sequence[Joint], after: Sequence[Joint]) -> tuple[Array, Array]:
    """The turns (splits, S, 3) rad of each sensor that explain best how its joints moved in its frame, and by how much (splits, S), sum of squares, they do."""
    ends = [s for joint in pairs.joints for s in joint]
    is_of = np.array([[end == s for end in ends] for s in pairs.series.sensors], float)
    place, later = (
        np.array([j.place for j in js]).reshape(-1, len(ends), 3) for js in (before, after)
    )
    covariance = common_joint.place_covariances(before) + common_joint.place_covariances(after)
    own = np.stack([covariance[:, :3, :3], covariance[:, 3:, 3:]], axis=1)
    information = np.linalg.inv(own + TOLERATED**2 * np.eye(3)).reshape(*place.shape, 3)
    # a frame turned by a small rotation v sees the place r moved by r x v
    lever = quat.skew(place)
    by = np.swapaxes(lever, -1, -2) @ information
    normal = (is_of @ (by @ lever).reshape(*place.shape[:2], 9)).reshape(*place.shape[:1], -1, 3, 3)
    right = is_of @ (by @ (later - place)[..., None])[..., 0]
    turn = np.linalg.solve(normal + np.eye(3) / TURN_SD**2, right[..., None])[..., 0]
    return turn, (right * turn).sum(axis=-1)
