"""What `map` gains where the MCP joints' axes tell how the hand's sensor sits, with the pose and without it, in the other simulator.

python docs/decisions/0027-axes-of-the-mcp-joints.py FIRST_SEED LAST_SEED TILT

TILT: deg, standard deviation of each of three turns of every finger's own axis. Prints the hand's sensor (deg about its axes), angles and tips.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand import joint_angles
from handscope.estimators.hand.anatomy import FINGERS, JOINT, PRONATION
from handscope.estimators.methods import map as self_calibration
from handscope.estimators.methods import map_contacts, map_pose
from handscope.estimators.methods.map_options import Params
from handscope.estimators.methods.map_unobserved import COUNT, STEP
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import process
from handscope.estimators.self_calibration.result import Finger
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.self_calibration import (
    CONDITIONS,
    MOVED,
    _trajectory_errors,
)
from handscope.validation.independent.simulator import contacts
from handscope.validation.independent.simulator.free_movement import DEG, Movement, Setup

AXIS_SD = map_pose.NO_FREEDOM_SD  # rad, as `ekf` believes
ROW_SD = 1.0 * DEG  # of a second's pronation
Known = tuple[Array, Array]  # errors that no movement tells, their covariance


def nothing(params: Params, fingers: list[Finger], seen: object, before: Array) -> Known:
    """As without a pose."""
    return np.zeros(COUNT), before


pose = map_pose.condition


@dataclass(frozen=True)
class Axes:
    """After another step, the axes of the four fingers' MCP joints over the movement."""

    first: Callable[..., Known]
    movement: Trajectory
    calibration: Calibration

    def __call__(self, params: Params, fingers: list[Finger], seen: object, before: Array) -> Known:
        x, P = self.first(params, fingers, seen, before)
        rows = self.movement.between(*self.calibration.span)
        q_GS = rows.q_GS[:: max(1, round(1.0 / np.median(np.diff(rows.t))))]
        joints = {JOINT[f"{f}_mcp"] for f in FINGERS[1:]} & set(map_pose._known_joints(fingers))
        for joint in sorted(joints):
            at, *moved = (_pronation(q_GS, joint, e) for e in STEP * np.eye(4, COUNT, -1))
            H = np.zeros((len(at), COUNT))
            H[:, :3] = (np.array(moved).T - at[:, None]) / STEP
            own = AXIS_SD**2 * (H[:, :2] @ H[:, :2].T + 1.0)  # its axis, and how the next one lies
            gain = np.linalg.solve(H @ P @ H.T + own + ROW_SD**2 * np.eye(len(at)), H @ P).T
            x, P = x - gain @ (at + H @ x), P - gain @ H @ P
        return x, P


def _pronation(q_GS: Array, joint: int, errors: Array) -> Array:
    turned = [joint_angles.of_segments(map_pose._corrected(q, errors)) for q in q_GS]
    return np.array(turned)[:, joint, PRONATION]


def _tilted(movement: Movement, seed: int, tilt: float) -> Movement:
    """Every finger flexes about an axis of its own, off by `tilt` deg."""
    rng = np.random.default_rng([seed, 99])

    def course(angles: Callable[[Array], Array], off: Array) -> Callable[[Array], Array]:
        def turned(t: Array) -> Array:
            found = angles(t).copy()
            flexion = found[:, 0, 0]
            found[:, 0, 2] += off @ [np.sin(flexion), np.cos(flexion), np.ones(len(t))]
            return found

        return turned

    offs = {f: tilt * DEG * rng.normal(size=3) * (f != "thumb") for f in movement.angles}
    return replace(
        movement, angles={f: course(angles, offs[f]) for f, angles in movement.angles.items()}
    )


def _judge(seed: int, tilt: float) -> Mapping[str, Array]:
    """By case: errors of the hand's sensor (3,), their NEES, of angles and tips RMS and NEES."""
    setup = Setup(seed, **{**CONDITIONS["slow left hand"], "duration": MOVED})
    movement, held, since = contacts.with_contacts(setup, (), 0.0)
    setup = replace(setup, duration=since + MOVED)
    recording, true = write_and_load(setup, _tilted(movement, seed, tilt), held)
    seen: list[tuple[Trajectory, Calibration]] = []
    apply, condition = map_contacts.apply, map_contacts.condition

    def watched(params: Params, moved: Trajectory, c: Calibration, *rest: object) -> object:
        seen.append((moved, c))
        return apply(params, moved, c, *rest)

    found = {}
    for name in ("pose", "pose and axes", "nothing", "axes"):
        first = pose if name.startswith("pose") else nothing

        def step(*a: object, name: str = name, first: Callable[..., Known] = first) -> Known:
            return Axes(first, *seen[-1])(*a) if name.endswith("axes") else first(*a)

        map_contacts.apply, map_contacts.condition = watched, step
        try:
            done = process(self_calibration, Params(), recording)
        finally:
            map_contacts.apply, map_contacts.condition = apply, condition
        calibration = done.calibrations[0]
        q_BS = Rotation.from_quat(calibration.q_BS["hand"], scalar_first=True)
        off = (q_BS * true.body.mountings["hand"].inv()).as_rotvec()
        row = [*(off / DEG), float(np.mean((off / calibration.q_BS_sd["hand"]) ** 2))]
        for what, unit in (("angles", DEG), ("tips", 1e-3)):
            parts = [
                p[1:] for p in _trajectory_errors(done.trajectory, true, since) if p[0] == what
            ]
            error, sd = (np.concatenate([np.ravel(p[k]) for p in parts]) for k in (0, 1))
            row += [np.sqrt(np.mean(error**2)) / unit, np.mean((error / sd) ** 2)]
        found[name] = np.array(row)
    return found


def main(first: int, last: int, tilt: float) -> None:
    """Means over the people; of the hand's sensor root mean squares."""
    people = [_judge(seed, tilt) for seed in range(first, last + 1)]
    for name in people[0]:
        rows = np.array([one[name] for one in people])
        sensor = np.sqrt((rows[:, :3] ** 2).mean(axis=0))
        nees, *rest = rows[:, 3:].mean(axis=0)
        words = " angles {:.2f} deg ({:.1f}), tips {:.2f} mm ({:.1f})".format(*rest)
        sys.stdout.write(f"{name}: hand's sensor {sensor.round(2)} ({nees:.1f}),{words}\n")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))
