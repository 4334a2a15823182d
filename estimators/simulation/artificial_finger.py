"""The artificial finger of Kortier's thesis, chapter 4: a printed board and three phalanges on hinges, moved about by hand while a thread bends it.

Out     a recording of four inertial sensors (board, three phalanges) with the truth beside it
Source  thesis 4.5.2: hinges 30 mm apart, sensors 75, 18, 19 and 24 mm from the hinge before them (the board's from its own hinge), turned by about
        90 deg, about 40 s: at rest, then moved in arbitrary directions while the thread is pulled again and again, then at rest.
        How far and how fast is not printed: sizes ours
"""

from dataclasses import replace

import numpy as np

from handscope.estimators.data.samples import ACC, GYR, Block, Stream
from handscope.estimators.hand.anatomy import Hand, side_sign
from handscope.estimators.hand.geometry import HandGeometry, HandMeasures, sized
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.constants import GRAVITY
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation import kinematics, sensors
from handscope.estimators.simulation.motion import COORDINATES, SIZE, Motion, interpolate_postures
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors, SensorSet

SEGMENTS = ("hand", "index_proximal", "index_middle", "index_distal")
HINGES = 0.030  # m apart
DISTANCES = (0.075, 0.018, 0.019, 0.024)  # m, sensor to hinge
HEIGHT = (0.020, 0.008, 0.008, 0.008)  # m above the line through the hinges; ours
# deg, where each hinge stops; ours
STOPS = {"index_mcp_flexion": 75.0, "index_pip_flexion": 90.0, "index_dip_flexion": 70.0}
RESTING = 2.5  # s on the table at either end
STEP = 0.12  # s between the knots of the movement


def record_trial(
    rng: np.random.Generator,
    errors: SensorErrors,
    hand: Hand = "left",
    duration: float = 40.0,
    rate: float = 100.0,
    turned: float = 90.0,
    motion: Motion | None = None,
) -> Simulated:
    """One trial, s and Hz; the sensors lie flat, turned by so many deg about their normals, and their nominal mounting says so."""
    geometry = printed_geometry(hand)
    done = random_motion(rng, duration) if motion is None else motion
    worn = mount_sensors(geometry, errors, rng, turned)
    t = np.arange(round(duration * rate)) / rate
    k = kinematics.compute_kinematics(done, geometry, t)
    stream = Stream(
        "imu",
        SEGMENTS,
        (GYR, ACC),
        rate,
        "imu",
        {GYR: float(np.radians(errors.gyr_range)), ACC: errors.acc_range * GRAVITY},
    )
    block = Block(stream, t, sensors.simulate_inertial(worn, k, rate, rng))
    mounting = dict(zip(SEGMENTS, worn.nominal))
    return Simulated(
        hand, sized(hand), {"imu": block}, (), kinematics.true_trajectory(k, hand), worn, mounting
    )


def printed_geometry(hand: Hand) -> HandGeometry:
    """The finger's true lengths; its board ends at the hinge of the index finger."""
    return sized(hand, HandMeasures(segment_length=dict.fromkeys(SEGMENTS[1:], HINGES)))


def mount_sensors(
    geometry: HandGeometry, errors: SensorErrors, rng: np.random.Generator, turned: float
) -> SensorSet:
    """The sensors on the finger with errors drawn."""
    nominal = np.tile(quat.about(0, np.radians(turned)), (len(SEGMENTS), 1))
    return replace(
        sensors.mount_sensors(SEGMENTS, geometry, errors, rng, nominal), p_BS=places(geometry)
    )


def places(geometry: HandGeometry) -> Array:
    """Where the sensors are (4, 3) m from their segments' origins (distal hinges, the board's MCP 3), in the segments' frames."""
    along = np.sqrt(np.square(DISTANCES) - np.square(HEIGHT))
    dorsal_distal = np.stack([HEIGHT, [-along[0], *(along[1:] - HINGES)], np.zeros(4)], axis=1)
    p_BS = side_sign(geometry.hand) * dorsal_distal
    p_BS[0] += np.array(geometry.joint_positions["index_mcp"]) - np.array(
        geometry.joint_positions["middle_mcp"]
    )
    return np.asarray(p_BS)


def random_motion(rng: np.random.Generator, duration: float) -> Motion:
    """Lifted from the table, carried about and turned, the thread pulled about once a second, laid down again."""
    t = np.arange(0.0, duration + 1e-9, STEP)
    moving = np.clip(np.minimum(t - RESTING, duration - RESTING - t) / 1.0, 0.0, 1.0)
    x = np.zeros((len(t), SIZE))
    for name, reach, slowest in (
        *((f"wrist_{axis}", 0.10, 0.9) for axis in "xyz"),
        *(
            (f"forearm_{angle}", np.radians(40.0), 1.6)
            for angle in ("flexion", "deviation", "pronation")
        ),
    ):
        x[:, COORDINATES[name]] = moving * reach * smooth_random_course(rng, t, slowest)
    x[:, COORDINATES["wrist_z"]] += 0.15 * moving
    # the phase of pulling
    pulled = np.cumsum(STEP * 2 * np.pi * (1.0 + 0.25 * smooth_random_course(rng, t, 2.0)))
    for k, (name, stop) in enumerate(STOPS.items()):
        x[:, COORDINATES[name]] = (
            moving
            * np.radians(stop)
            * (0.5 - 0.5 * np.cos(pulled - 0.5 * k))
            * (0.85 + 0.15 * smooth_random_course(rng, t, 3.0))
        )
    return interpolate_postures(t, x)


def smooth_random_course(rng: np.random.Generator, t: Array, slowest: float) -> Array:
    """A smooth random course within about -1 to 1 (n,): sines with periods from `slowest` to three times as long, s."""
    periods, phases = rng.uniform(slowest, 3 * slowest, 5), rng.uniform(0, 2 * np.pi, 5)
    return np.asarray(np.sin(2 * np.pi * t[:, None] / periods + phases).sum(axis=1) / np.sqrt(5))
