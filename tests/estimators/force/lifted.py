"""Somebody with a hand of their own lifts or squeezes something, simulated and followed by m2."""

from collections.abc import Callable
from typing import Any

import numpy as np

from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import Processed, process
from handscope.estimators.simulation import kinematics, person
from handscope.estimators.simulation.force_sensors import ForceErrors
from handscope.estimators.simulation.movements import (
    functional_calibration,
    object_dynamics,
    task_performance,
)
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.scenario import ForceGlove, Simulated, simulate_performances
from handscope.estimators.simulation.sensors import PRESETS

POSE = 2.5  # deg by which every freedom of the initial pose may be missed


def done(
    seed: int,
    perform: Callable[..., Performance] = object_dynamics.lift,
    rate: float = 12.0,
    errors: ForceErrors | None = None,
    six_axes: bool = False,
    **how: Any,
) -> tuple[Simulated, np.ndarray]:
    """The recording, and the true forces (n, 5, 3) N in the global frame at the instants of its truth."""
    of_person, of_pose, of_motion, of_sensors = np.random.default_rng(seed).spawn(4)
    somebody = person.draw_person("left", of_person)
    pose = task_performance.initial_pose(
        somebody.true,
        taken=functional_calibration.miss_posture(task_performance.flat(), POSE, of_pose),
    )
    task = perform(somebody.true, of_motion, **how)
    glove = ForceGlove(rate=rate, errors=errors or ForceErrors(), six_axes=six_axes)
    preset = PRESETS["LSM330DLC/HMC5983"]
    made = simulate_performances(
        [pose, task],
        "left",
        somebody.true,
        of_sensors,
        preset,
        known=somebody.declared,
        force=glove,
    )
    t = made.truth.t - pose.motion.duration
    assert task.forces is not None
    forces = np.zeros((len(t), 5, 3))
    forces[t >= 0] = task.forces(
        kinematics.compute_kinematics(task.motion, somebody.true, t[t >= 0])
    )
    return made, forces


def followed(made: Simulated) -> Processed:
    return process(m2, m2.Params(), made)
