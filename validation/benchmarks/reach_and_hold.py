"""The magnet's filter, an array alone, and fingertip forces in batch: times real time."""

import statistics
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from handscope.estimators.hand.geometry import sized
from handscope.estimators.magnet.array.localisation import locate
from handscope.estimators.magnet.model import setup as magnet_setup
from handscope.estimators.magnet.tracker import smoother as magnet_smoother
from handscope.estimators.magnet.tracker import tracker as magnet_tracker
from handscope.estimators.magnet.tracker.initialisation import Setup
from handscope.estimators.magnet.tracker.options import MagnetParams
from handscope.estimators.magnet.tracker.tracker import Readings
from handscope.estimators.measures import lift
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation import magnet
from handscope.estimators.simulation.force_sensors import ForceErrors
from handscope.estimators.simulation.magnetic_field import EARTH, homogeneous
from handscope.estimators.simulation.movements import object_dynamics, task_performance
from handscope.estimators.simulation.scenario import ForceGlove, Simulated, simulate_performances
from handscope.estimators.simulation.sensors import PRESETS
from handscope.validation.benchmarks import Metric

SECONDS = 60.0
TARGET = 50.0
REPEATS = 3


def measure() -> list[Metric]:
    """Processor's time of what a minute of movement needs; the first call translates what is compiled."""
    setup, readings = _time_tracking()
    _, unheard = _time_tracking(away=50.0)
    array = readings.mag[::6]  # ten a second
    return [
        Metric("magnet, four magnetometers at 60 Hz", _speed(SECONDS, lambda: _smooth(setup, readings)), "x real time", TARGET, "higher"),
        Metric("the same, out of reach for 50 s of the minute", _speed(SECONDS, lambda: _smooth(setup, unheard)), "x real time", None, "higher"),
        Metric("magnet by the array alone at 10 Hz", _speed(SECONDS, lambda: locate(array, setup.array, None, setup.magnet.size)), "x real time", None, "higher"),
        *_record_lift(),
    ]  # fmt: skip


def _smooth(setup: Setup, readings: Readings) -> None:
    magnet_smoother.smooth(MagnetParams(), magnet_tracker.start(setup), readings)


def _time_tracking(away: float = 0.0) -> tuple[Setup, Readings]:
    """A minute of picking and placing, calibrated; for `away` s of it the hand is out of reach."""
    rng = np.random.default_rng(1)
    w, m = magnet.draw_worn(rng), magnet.simulate_condition("both", rng, SECONDS)
    m = magnet.move_hand_away(m, 5.0, 5.0 + away) if away else m
    imu, raw = (
        magnet.simulate_inertial(w, m, rng),
        magnet.simulate_magnetic(w, m, homogeneous(), rng),
    )
    mag = np.einsum("lij,nlj->nli", np.linalg.inv(w.soft), raw - w.hard)
    setup = Setup(
        magnet_setup.make_constellation(w.declared_places, w.q_bl),
        magnet_setup.make_magnet(w.declared_moment, w.declared_lever),
        EARTH,
        None,
        q_bt=m.q_bt[0],
    )
    return setup, Readings(m.t, imu[:, 0], imu[:, 1], mag)


def _record_lift() -> list[Metric]:
    """An object lifted with two force sensors at 12 and 100 Hz: method, forces and mass together."""
    rng, model = np.random.default_rng(2), sized("left")
    done = [
        task_performance.initial_pose(model),
        object_dynamics.lift(model, rng, mass=0.28, height=0.5),
    ]
    found = []
    for rate in (12.0, 100.0):
        made = simulate_performances(
            done,
            "left",
            model,
            rng,
            PRESETS["LSM330DLC/HMC5983"],
            force=ForceGlove(rate=rate, errors=ForceErrors()),
        )
        speed = _speed(float(made.truth.t[-1]), partial(_weigh, made))
        found.append(
            Metric(
                f"m2 with forces at {rate:g} Hz, and the mass",
                speed,
                "x real time",
                TARGET,
                "higher",
            )
        )
    return found


def _weigh(made: Simulated) -> object:
    event = next(e for e in made.events if e.trial_type == "task")
    return lift.measure(
        lift.Params(),
        process(m2, m2.Params(), made).trajectory,
        event.onset,
        event.end,
        made.geometry,
    )


def _speed(seconds: float, work: Callable[[], object]) -> float:
    """Times real time, of the processor's."""
    work()
    taken = []
    for _ in range(REPEATS):
        began = time.process_time()
        work()
        taken.append(time.process_time() - began)
    return seconds / statistics.median(taken)
