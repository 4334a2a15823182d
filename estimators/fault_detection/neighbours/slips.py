"""A sensor that was turned on its segment during the recording: its joints lie elsewhere in its frame afterwards.

In      pairs of sensors (sensor_pairs.py)
Out     which sensor, by what turn, from when on
Source  ours: a test for a break (Chow 1960, Econometrica 28:591) at several instants; a rigid turn moves all joints of a sensor together, skin slides them along the segment
Limits  a turn about the line from the sensor to its only joint is not seen; gentle movement does not tell places well enough
"""

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
    best: tuple[float, str, Array, float] | None = None
    for share in SPLITS:
        at = begin + share * (end - begin)
        halves = {
            j: (pairs.joint_within(*j, (begin, at)), pairs.joint_within(*j, (at, end)))
            for j in pairs.joints
        }
        for sensor in pairs.series.sensors:
            turn, gain = _turned(
                [(b, a, 0 if j[0] == sensor else 3) for j, (b, a) in halves.items() if sensor in j]
            )
            if best is None or gain > best[0]:
                best = gain, sensor, turn, at
    if best is None or not LEAST < np.linalg.norm(best[2]) < MOST:
        return None
    gain, sensor, turn, at = best
    p = float(chi2_sf(gain, 3)) * len(SPLITS) * len(pairs.series.sensors)
    return Slip(sensor, turn, at, min(1.0, p))


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


def _turned(changes: list[tuple[Joint, Joint, int]]) -> tuple[Array, float]:
    """The turn (3,) rad of a sensor that explains best how its joints moved in its frame, and by how much (sum of squares) it does."""
    normal, right = np.eye(3) / TURN_SD**2, np.zeros(3)
    for before, after, at in changes:
        own = slice(at, at + 3)
        covariance = (before.covariance + after.covariance)[own, own] + (
            before.systematic + after.systematic
        )[own, own]
        information = np.linalg.inv(covariance + TOLERATED**2 * np.eye(3))
        lever = quat.skew(
            before.place[own]
        )  # a frame turned by a small rotation v sees the place r moved by r x v
        normal, right = (
            normal + lever.T @ information @ lever,
            right + lever.T @ information @ (after.place - before.place)[own],
        )
    turn = np.linalg.solve(normal, right)
    return np.asarray(turn), float(right @ turn)
