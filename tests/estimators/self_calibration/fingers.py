"""Artificial fingers for the tests, and what is known of them."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from handscope.estimators.data.samples import Block
from handscope.estimators.hand.anatomy import FLEXION, JOINT, SEGMENT
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration import initialisation as self_calibration_initialisation
from handscope.estimators.self_calibration import observability, sample_preparation
from handscope.estimators.self_calibration.observability import (
    AccumulatedInformation,
    JointObservability,
    Limb,
)
from handscope.estimators.self_calibration.problem import (
    Chain,
    Noise,
    Problem,
    Readings,
    Unknowns,
    Z,
    axis_in_sensors,
    build_chain,
    build_problem,
)
from handscope.estimators.self_calibration.result import Requirements
from handscope.estimators.simulation import artificial_finger
from handscope.estimators.simulation.artificial_finger import SEGMENTS
from handscope.estimators.simulation.motion import COORDINATES
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import IDEAL

WHITE = replace(
    IDEAL, gyr_noise=0.01, acc_noise=300e-6, gyr_bias=0.5, acc_bias=0.05
)  # MPU-9250: noise and constant biases only
DURATION = 16.0  # s
SKIN = replace(WHITE, skin_angle=2.0, skin_shift=1.0)
HINGED: Chain = build_chain(SEGMENTS, hinges=("index_mcp", "index_pip", "index_dip"))


@cache
def recorded(seed: int, duration: float, skin: bool = False) -> Simulated:
    return artificial_finger.record_trial(
        np.random.default_rng(seed), SKIN if skin else WHITE, duration=duration
    )


def stiffened(seed: int, duration: float, held: Mapping[str, float]) -> Simulated:
    """A finger of which some coordinates stay, deg or m."""
    motion = artificial_finger.random_motion(np.random.default_rng(seed), duration)
    courses = motion.spline.c.copy()
    for name, value in held.items():
        courses[:, :, COORDINATES[name]] = 0.0
        courses[-1, :, COORDINATES[name]] = value if name.startswith("wrist") else np.radians(value)
    still = replace(motion, spline=type(motion.spline)(courses, motion.spline.x))
    return artificial_finger.record_trial(
        np.random.default_rng(seed), SKIN, duration=duration, motion=still
    )


def slipped(recording: Simulated, row: int, by: float) -> Simulated:
    """The recording with one sensor turned by so many deg about a slanted axis for the second half."""
    block = recording.samples["imu"]
    half, values = len(block.t) // 2, block.values.copy()
    turn = quat.exp(np.radians(by) * np.array([0.6, 0.0, 0.8]))
    values[half:, row] = quat.rotate(turn, values[half:, row].reshape(-1, 2, 3)).reshape(-1, 6)
    return replace(recording, samples={"imu": Block(block.stream, block.t, values)})


def readings(recording: Simulated) -> Readings:
    block = recording.samples["imu"]
    sure = np.ones(block.values.shape[:2])
    return Readings(1 / block.stream.rate, block.of("gyr"), block.of("acc"), sure, sure)


def cold(
    recording: Simulated, noise: Noise | None = None, read: Readings | None = None
) -> tuple[Problem, Unknowns]:
    """The problem and where the solver begins from nothing; `read`: other readings of the same finger."""
    noise, read = noise or Noise(), read or readings(recording)
    guess = self_calibration_initialisation.initial_unknowns(
        HINGED, noise, read, axis_in_sensors(HINGED, recording.mounting, Z)
    )
    return build_problem(
        HINGED, noise, read, guess.q_GS[0], recording.hand, recording.mounting
    ), guess


def lengths(at: Unknowns) -> Array:
    """Of the proximal and the middle phalanx, m."""
    return np.asarray(np.linalg.norm(at.far[1:] - at.near[:-1], axis=1))


def distances(at: Unknowns) -> Array:
    """Sensors to hinges: board, proximal, middle, distal, m."""
    return np.linalg.norm(np.concatenate([at.far[:1], at.near]), axis=1)


def looked(
    recording: Simulated,
    start: float,
    stop: float,
    finger: str = "index",
    every: float = 1.0,
    noise: Noise | None = None,
) -> tuple[Limb, list[AccumulatedInformation]]:
    """What a live meter takes in of a finger, stretch by stretch; its tracker is off by 8 deg, each sensor about another axis."""
    blocks = list(recording.blocks())
    limb = observability.build_limb(
        finger,
        [s for b in blocks for s in b.stream.sensors],
        recording.geometry,
        recording.mounting,
    )
    off = quat.exp(np.radians(8.0) * np.eye(3)[np.arange(len(limb.links.sensors)) % 3])
    rows, nominal = (
        [SEGMENT[s] for s in limb.links.sensors],
        [recording.mounting.get(s, quat.IDENTITY) for s in limb.links.sensors],
    )
    told, so_far = [], observability.no_information(limb)
    for begun in np.arange(start, stop - 0.5 * every, every):
        t, read = sample_preparation.prepare_readings(
            blocks, limb.links.sensors, begun, begun + every
        )
        q_GB = recording.truth.q_GS[np.searchsorted(recording.truth.t, t[0]), rows]
        told.append(
            observability.accumulate(
                limb,
                read,
                quat.multiply(quat.multiply(q_GB, np.array(nominal)), off),
                noise or so_far.noise,
            )
        )
        so_far = observability.add_information(so_far, told[-1])
    return limb, told


def watched(
    recording: Simulated, finger: str = "index", start: float = 0.0, stop: float | None = None
) -> list[JointObservability]:
    """What the live meter says at the end of a recording."""
    limb, stretches = looked(
        recording, start, float(recording.truth.t[-1]) if stop is None else stop, finger
    )
    so_far = observability.no_information(limb)
    for told in stretches:
        so_far = observability.add_information(so_far, told)
    bent = {joint: recording.truth.angles[:, JOINT[joint], FLEXION] for joint in limb.links.joints}
    return observability.assess_joints(Requirements(), limb, so_far, bent)
