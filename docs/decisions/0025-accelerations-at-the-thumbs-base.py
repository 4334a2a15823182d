"""What accelerations of hand and thumb at their joint tell of the heading between them, minute by minute, with the true heading as start.

Run     python docs/decisions/0025-accelerations-at-the-thumbs-base.py [SEEDS], from the repository; a minute of one core a seed
Out     errors of the heading (deg) that each minute tells by itself, in our simulator and in the other one, with scale errors of the accelerometers among the unknowns and
        without; root mean square and mean of minutes 2 to 10
"""

import sys
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from handscope.estimators.data.samples import Block
from handscope.estimators.finger_ekf.joint_acceleration import block_sums, heading_update
from handscope.estimators.finger_ekf.joint_acceleration.block_sums import HEADING, Readings
from handscope.estimators.hand.anatomy import FINGERS
from handscope.estimators.methods import ekf
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.orientation import fusion
from handscope.estimators.pipeline.recording_calibration import calibrate
from handscope.estimators.simulation import sensors
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.sessions.formats import recordings as formats_recordings
from handscope.validation.independent.simulator import free_movement
from handscope.validation.independent.simulator.free_movement import Setup

drift = import_module("0015-drift-of-the-thumbs-base")
BOTH, MINUTES, BLOCKS = ("hand", "thumb_metacarpal"), 10, 6
PRIORS = {"with scales": np.ones(30), "without": np.repeat([1.0, 1e-6], [12, 18])}


class Worn(NamedTuple):
    """Two sensors as read, and their true orientations."""

    readings: Readings
    q_true: Array  # (n, 2, 4)


def read(recording: Simulated, block: Block, q_true: Array) -> Worn:
    """Readings behind the pose, with orientations by each sensor's own fusion."""
    params, stream = ekf.Params(), block.stream
    calibration = calibrate(params, recording)[0][0]
    known = block.t > calibration.t
    block, q_true = Block(stream, block.t[known], block.values[known]), q_true[known]
    state = fusion.start(stream, calibration.q_GS, calibration.gyr_bias, calibration.end)
    _, fused = fusion.step(params, state, block)
    columns, n = [stream.sensors.index(s) for s in BOTH], len(fused.t)
    bias = np.array([calibration.gyr_bias[s] for s in BOTH])
    dt = np.full((n, 2), 1 / stream.rate)
    turn = (block.values[:n, columns, :3] - bias) / stream.rate
    force, q = block.values[:n, columns, 3:], fused.q_GS[:, columns]
    return Worn(Readings(fused.t, turn, dt, force, q), q_true[:n])


def ours(seed: int) -> Worn:
    """Movement and people as in `handscope reproduce drift`."""
    motions: list[Array] = []
    of_all = sensors.simulate_inertial

    def with_truth(worn, k, rate, rng):  # type: ignore[no-untyped-def]
        rows = [worn.segments.index(s) for s in BOTH]
        motions.append(sensors.sensor_poses(worn, k)[0][:, rows])
        return of_all(worn, k, rate, rng)

    sensors.simulate_inertial = with_truth
    recording = drift.recorded(seed, SensorErrors())
    sensors.simulate_inertial = of_all
    return read(recording, recording.samples["imu"], np.concatenate(motions))


def other(seed: int) -> Worn:
    """The simulator that shares no line with ours; up to 0.6 Hz."""
    setup = Setup(seed, fingers=FINGERS, forearm=True, duration=60.0 * MINUTES, pace=0.6, missed=0)
    with TemporaryDirectory() as folder:
        true = free_movement.written(setup, Path(folder) / "recording")
        recording = formats_recordings.load(Path(folder) / "recording")
    block, movement = recording.samples["imu"], free_movement._movement(setup)
    q = np.empty((len(block.t), 2, 4))
    for first in range(0, len(q), 5000):
        rows = slice(first, first + 5000)
        posture = free_movement._posture(setup, true.body, movement, block.t[rows])
        for k, s in enumerate(BOTH):
            R, _ = free_movement._worn(setup, true.body, movement, s, posture)
            q[rows, k] = quat.from_matrix(R)
    return read(recording, block, q)


def headings(worn: Worn, prior: Array) -> tuple[Array, float]:
    """By how much the heading of each minute is missed, rad, and the hand's acceleration, m/s^2, root mean square of a horizontal axis."""
    readings, noise, state = worn.readings, heading_update.Noise(0.05, 1.0), None
    q_pc = quat.relative(worn.q_true[:, 0], worn.q_true[:, 1])
    n, found = round(heading_update.EVERY / (readings.t[1] - readings.t[0])), []
    heading_update.PRIOR = np.repeat([0.06, 0.1, 0.005], [6, 6, 18]) ** 2 * prior
    for first in range(0, len(q_pc) - n, n):
        state = heading_update.begin(readings.t[first], q_pc[first], readings.q_EB[first], state)
        rows = slice(first + 1, first + n + 1)
        part = Readings(*(np.ascontiguousarray(x[rows]) for x in readings))
        block_sums.accumulate(part, state.unknowns, state.sums)
        normal = heading_update.detrended(state.sums)
        energy = normal[HEADING, HEADING]
        share = normal[HEADING, :HEADING] / energy
        seen = normal[HEADING, HEADING + 1] / energy - share @ state.unknowns
        end = heading_update.heading_between(q_pc[first + n], readings.q_EB[first + n])
        moved = heading_update.wrapped(end - state.heading)
        found.append((energy, seen - 0.5 * moved))
        density = heading_update.noise_density(noise, heading_update.residual(state, normal, seen))
        box = density / block_sums.INDEPENDENT
        unknowns, P = heading_update._learnt(state, normal, share, box, readings.t[first + n])
        state = state.__class__(
            state.begun, state.heading, state.sums, unknowns, P, state.noise_stats
        )
    per_minute = np.array(found)[: len(found) // BLOCKS * BLOCKS].reshape(-1, BLOCKS, 2)
    weight = per_minute[..., 0]
    boxes = heading_update.EVERY / block_sums.BOX
    size = float(np.sqrt(weight.mean() / boxes / 2))
    return (weight * per_minute[..., 1]).sum(axis=1) / weight.sum(axis=1), size


def main() -> None:
    for seed in [int(x) for x in sys.argv[1:]] or [1, 2, 3, 4]:
        for world in (ours, other):
            worn = world(seed)
            for name, prior in PRIORS.items():
                missed, size = headings(worn, prior)
                off = np.degrees(missed)
                print(  # noqa: T201
                    f"{world.__name__} {seed}, {size:.2f} m/s^2, {name}: {off.round(1)}, rms {np.sqrt((off[1:] ** 2).mean()):.1f}, mean {off[1:].mean():.1f}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
