"""Functional calibrations of people with sensors put on anyhow, made once."""

from functools import cache

import numpy as np

from handscope.estimators.alignment.functional_movements import CalibrationMovement
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.hand.anatomy import Hand
from handscope.estimators.methods import m2
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline import recording_calibration
from handscope.estimators.simulation.movements import functional_calibration, task_performance
from handscope.estimators.simulation.movements.functional_calibration import (
    Carelessness,
    miss_posture,
)
from handscope.estimators.simulation.person import draw_person
from handscope.estimators.simulation.scenario import Simulated, simulate_performances
from handscope.estimators.simulation.sensors import IDEAL, SensorErrors

# up to 30 deg off, about any axis
ANYHOW = SensorErrors(misalignment=15.0, misalignment_width=15.0)
PERFECT = Carelessness(pose=0.0, divergence=0.0, joints=0.0, hand=2.0)
TURNED = SensorErrors(
    **{
        **{n: getattr(IDEAL, n) for n in IDEAL.__dataclass_fields__},
        "misalignment": 15.0,
        "misalignment_width": 15.0,
    }
)


@cache
def done(
    hand: Hand,
    seed: int = 3,
    errors: SensorErrors = ANYHOW,
    care: Carelessness | None = None,
    after: bool = False,
) -> Simulated:
    """The initial pose and all steps; `after` them fists, spreading, the thumb and tapping."""
    rng, care = np.random.default_rng(seed), care or Carelessness()
    person = draw_person(hand, rng)
    g = person.true
    pose = task_performance.initial_pose(
        g, taken=miss_posture(task_performance.flat(), care.pose, rng)
    )
    steps = functional_calibration.all_steps(g, rng, care)
    rest = (
        (
            task_performance.fist_and_stretch(g),
            task_performance.spread_and_close(g),
            task_performance.thumb_across_and_away(g),
            task_performance.tapping(g, 6.0),
        )
        if after
        else ()
    )
    return simulate_performances([pose, *steps, *rest], hand, g, rng, errors, known=person.declared)


def posed(recording: Simulated) -> Calibration:
    """The calibration from the initial pose alone."""
    (calibration,), _ = recording_calibration.calibrate(m2.Params(functional=False), recording)
    return calibration


def pieces(recording: Simulated, params: m2.Params | None = None) -> dict[str, CalibrationMovement]:
    return recording_calibration.functional_pieces(
        params or m2.Params(), recording, [posed(recording)]
    )[0]


def errors_of(recording: Simulated, calibration: Calibration) -> dict[str, Array]:
    """Turns (3,) in rad, in the segment's frame, between the sensors as they are taken to sit and
    as they do."""
    true = dict(zip(recording.sensors.segments, recording.sensors.q_BS))
    return {
        s: quat.log(quat.multiply(q, quat.conjugate(true[s]))) for s, q in calibration.q_BS.items()
    }
