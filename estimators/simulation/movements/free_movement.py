"""A hand that moves freely: carried about and turned, every finger bent and stretched in a rhythm of its own; sensors on all segments.

Out     a recording with the truth beside it, a `free_movement` event over all of it
Source  Kortier, thesis 4.5.2, for one finger: at rest, then moved in arbitrary directions, then at rest. How far and how fast is ours
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, Block, Event, Stream
from handscope.estimators.hand.anatomy import ANGLES, FLEXION, JOINTS, SEGMENTS, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation import kinematics, sensors
from handscope.estimators.simulation.motion import COORDINATES, SIZE, Motion, interpolate_postures
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors

RESTING = 1.5  # s on the table at either end
STEP = 0.12  # s between the knots of the movement
PULLS = 0.8  # Hz, at which fingers bend and stretch on average
# share of what a joint permits, deg at most: flexion from straight, other angles to both sides
BENT, ASIDE = (0.7, 70.0), (0.6, 10.0)
CARRIED = {
    "wrist_x": 0.10,
    "wrist_y": 0.10,
    "wrist_z": 0.10,
    "forearm_flexion": 40.0,
    "forearm_deviation": 40.0,
    "forearm_pronation": 45.0,
}


def record_trial(
    rng: np.random.Generator,
    errors: SensorErrors,
    hand: Hand,
    geometry: HandGeometry,
    known: HandGeometry,
    segments: Sequence[str] = SEGMENTS[1:],
    duration: float = 40.0,
    rate: float = 100.0,
) -> Simulated:
    """One trial, s and Hz; a method is given the hand as `known`."""
    worn = sensors.mount_sensors(segments, geometry, errors, rng)
    t = np.arange(round(duration * rate)) / rate
    k = kinematics.compute_kinematics(random_motion(rng, duration), geometry, t)
    stream = Stream(
        "imu",
        tuple(segments),
        (GYR, ACC),
        rate,
        "imu",
        {GYR: float(np.radians(errors.gyr_range)), ACC: errors.acc_range * GRAVITY},
    )
    samples = {"imu": Block(stream, t, sensors.simulate_inertial(worn, k, rate, rng))}
    event = (Event(0.0, duration, "free_movement"),)
    return replace(
        Simulated(hand, known, samples, event, kinematics.true_trajectory(k, hand), worn),
        mounting=dict(zip(segments, worn.nominal)),
    )


def random_motion(rng: np.random.Generator, duration: float) -> Motion:
    """Lifted, carried about and turned while all joints move, laid down again."""
    t = np.arange(0.0, duration + 1e-9, STEP)
    moving = np.clip(np.minimum(t - RESTING, duration - RESTING - t) / 1.0, 0.0, 1.0)
    x = np.zeros((len(t), SIZE))
    for name, reach in CARRIED.items():
        x[:, COORDINATES[name]] = (
            moving
            * (reach if name.startswith("wrist") else np.radians(reach))
            * _smooth_random_course(rng, t, 1.2)
        )
    for joint in JOINTS:
        for dof in joint.dofs:
            part, most = BENT if dof == FLEXION else ASIDE
            reach = min(part * joint.limits[dof][1], most)
            middle, reach = (reach / 2, reach / 2) if dof == FLEXION else (0.0, reach)
            pulled = np.cumsum(
                STEP * 2 * np.pi * PULLS * (1.0 + 0.25 * _smooth_random_course(rng, t, 2.0))
            ) + rng.uniform(0, 2 * np.pi)
            share = (0.3 if joint.name == "wrist" else 1.0) * (
                0.8 + 0.2 * _smooth_random_course(rng, t, 3.0)
            )
            x[:, COORDINATES[f"{joint.name}_{ANGLES[dof]}"]] = moving * np.radians(
                middle + reach * share * np.sin(pulled)
            )
    return interpolate_postures(t, x)


def _smooth_random_course(rng: np.random.Generator, t: Array, slowest: float) -> Array:
    """A smooth random course within about -1 to 1 (n,): sines with periods from `slowest` to three times as long, s."""
    periods, phases = rng.uniform(slowest, 3 * slowest, 5), rng.uniform(0, 2 * np.pi, 5)
    return np.asarray(np.sin(2 * np.pi * t[:, None] / periods + phases).sum(axis=1) / np.sqrt(5))
