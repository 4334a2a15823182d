"""What the ghost hand shows for a step of the wizard: the initial pose, or the postures of the task or calibration step in turn."""

from collections.abc import Mapping

import numpy as np

from handscope.app.live.wizard.machine import State, Wizard
from handscope.app.protocols import TURN, Protocol
from handscope.app.scene import postures
from handscope.estimators.alignment.initial_pose import DEG
from handscope.estimators.hand.anatomy import ANGLES, JOINT, JOINTS
from handscope.estimators.numerics.typing import Array

SHOWN = (
    State.POSE_READY,
    State.POSE_HOLD,
    State.TASK_READY,
    State.COUNTDOWN,
    State.RESUME_COUNTDOWN,
    State.STEP_READY,
    State.STEP_COUNTDOWN,
    State.FREE_READY,
    State.FREE_COUNTDOWN,
    State.FREE_RUN,
)
TARGET, LEAST_SHOWN = 5 * DEG, 15 * DEG  # half the target's band: what a goniometer is good for
STEP = 0.5  # s of movement to the next posture, of each posture's pace


def angles_of(degrees: Mapping[str, float]) -> Array:
    """Joint angles (joints, 3) of a posture by names of freedoms, in deg; what is not named is 0. The drawn forearm stays, so its turn is the wrist's."""
    angles = np.zeros((len(JOINTS), 3))
    for name, value in degrees.items():
        joint, _, angle = ("wrist_pronation" if name == TURN else name).rpartition("_")
        angles[JOINT[joint], ANGLES.index(angle)] = value * DEG
    return angles


def ghost(wizard: Wizard, pose: Array, t: float) -> Array | None:
    """The ghost's angles (joints, 3) at t s into the state, those of the initial pose being `pose`; None where it is not shown."""
    if wizard.state not in SHOWN:
        return None
    if wizard.state in (State.POSE_READY, State.POSE_HOLD):
        return pose
    protocol = wizard.protocol
    if protocol is None or not protocol.ghost:
        return None
    shown = [angles_of(p) for p in protocol.ghost]
    return postures.along(shown, t, move=STEP * protocol.pace, hold=(1 - STEP) * protocol.pace)


def target(protocol: Protocol, curve: str) -> tuple[float, float] | None:
    """The band (rad) of a task's joint angle that its demonstration ends in; None where the demonstration hardly moves that joint."""
    joint, _, angle = curve.rpartition("_")
    if joint not in JOINT or not protocol.ghost:
        return None
    shown = [float(angles_of(p)[JOINT[joint], ANGLES.index(angle)]) for p in protocol.ghost]
    furthest = max(shown, key=abs)
    if max(shown) - min(shown) < LEAST_SHOWN:
        return None
    return furthest - TARGET, furthest + TARGET
