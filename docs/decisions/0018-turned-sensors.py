"""How often `ekf` notices a sensor that turns on its segment, how soon, and what standard deviations are worth afterwards.

Run     python docs/decisions/0018-turned-sensors.py, from the repository; some twenty minutes
Out     by size of the turn and movement: share noticed within 10 s, share of those with the right sensor, seconds until then; NEES of angles (all
        of the second half) with and without noticing; share of recordings in which something is told of sensors that stay
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from handscope.estimators.hand.anatomy import IS_DOF
from handscope.estimators.methods import ekf
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation import experiments, sensors
from handscope.estimators.simulation.experiments import PersonErrors
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.reproduce.accuracy import angle_difference

PEOPLE = range(20, 28)
MOVEMENTS, SIZES = ("tapping", "AF-F2", "free"), (0.0, 3.0, 6.0, 10.0, 17.0)
WITHIN = 10.0  # s


@dataclass(frozen=True)
class Found:
    told: bool
    rightly: bool
    after: float  # s
    nees: tuple[float, float]  # without and with noticing


def made(seed: int, slip: float, movement: str) -> tuple[Simulated, str]:
    """The recording, and which of its sensors turns."""
    worn: list[sensors.SensorSet] = []
    mount = sensors.mount_sensors

    def mounted(*given, **named):  # type: ignore[no-untyped-def]
        worn.append(mount(*given, **named))
        return worn[-1]

    sensors.mount_sensors = mounted
    recording = experiments.record_experiment(
        experiments.EXPERIMENTS[movement],
        np.random.default_rng([seed, 3]),
        SensorErrors(slip=slip, slipping=1),
        None,
        "left",
        person=PersonErrors(pose_deg=2.0, distribution="normal"),
    )
    sensors.mount_sensors = mount
    if worn[0].slips is None:
        return recording, ""
    return recording, worn[0].segments[int(np.argmax(np.linalg.norm(worn[0].slips, axis=1)))]


def judge(seed: int, slip: float, movement: str) -> Found:
    recording, sensor = made(seed, slip, movement)
    middle, nees = 0.5 * float(recording.truth.t[-1]), []
    for noticing in (False, True):
        done = process(ekf, ekf.Params(mounting_changes=noticing), recording)
        nees.append(_nees(done.trajectory, recording, middle))
    told = [s for s in done.suspicions if s.message.code.endswith("turned")]
    after = told[0].spans[0][1] - middle if told else np.nan
    return Found(
        bool(told) and after < WITHIN,
        bool(told) and sensor in told[0].sensors,
        after,
        (nees[0], nees[1]),
    )


def _nees(moved, recording: Simulated, since: float) -> float:  # type: ignore[no-untyped-def]
    rows = np.flatnonzero((moved.t > since) & (moved.t < recording.truth.t[-1]))
    at = np.searchsorted(recording.truth.t, moved.t[rows] - 1e-6)
    error = angle_difference(moved.angles[rows], recording.truth.angles[at])
    return float(np.nanmean((error / moved.angles_sd[rows])[:, IS_DOF] ** 2))


def lines() -> Iterator[str]:
    for slip, movement in product(SIZES, MOVEMENTS):
        found = [judge(seed, slip, movement) for seed in PEOPLE]
        told = [f for f in found if f.told]
        rightly = sum(f.rightly for f in told)
        after = np.median([f.after for f in told]) if told and slip else np.nan
        nees = np.mean([f.nees for f in found], axis=0)
        largest = np.max([f.nees for f in found], axis=0)
        yield (
            f"{slip:4g} deg {movement:8s} told {len(told)} of {len(found)}, rightly {rightly}, after {after:.1f} s, "
            f"NEES {nees[0]:.2f} (largest {largest[0]:.2f}) -> {nees[1]:.2f} ({largest[1]:.2f})"
        )


if __name__ == "__main__":
    for line in lines():
        print(line, flush=True)  # noqa: T201
