"""What one pass of self-calibration takes by the length of the stretch: the pulls of five fingers, the factor of the whole hand, its step and its pulls, at 25 Hz, about the first guess.

python docs/decisions/0022-length-of-the-stretch.py SECONDS
"""

import sys
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.self_calibration import initialisation, multi_resolution, solver
from handscope.estimators.self_calibration import sample_preparation as samples
from handscope.estimators.self_calibration.problem import (
    Noise,
    Z,
    axis_in_sensors,
    build_chain,
    build_problem,
)
from handscope.estimators.self_calibration.solver import Limits, Solution
from handscope.estimators.self_calibration.uncertainty import sandwich_covariance
from handscope.estimators.self_calibration.whole_hand import normal_equations, problem
from handscope.estimators.simulation.movements import free_movement
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors

RATE = 25.0  # Hz
A = TypeVar("A")


def main(seconds: float) -> None:
    """Each in s on the processor, after 10 s that translate what is compiled."""
    for length in (10.0, seconds):
        hand, rng = sized("left"), np.random.default_rng(0)
        made = free_movement.record_trial(rng, SensorErrors(), "left", hand, hand, duration=length)
        limbs = [_guess(made, ("hand", *links), length) for links in CHAINS.values()]
        spent = [_limbs(limbs), *_hand(limbs)]
    named = zip(("pulls of the fingers", "factor of the hand", "its step", "its pulls"), spent)
    words = ", ".join(f"{name} {value:.2f} s" for name, value in named)
    sys.stdout.write(f"{seconds:g} s: {words}\n")


def _guess(made: Simulated, sensors: Sequence[str], length: float) -> Solution:
    chain, noise = build_chain(sensors), Noise()
    _, read = samples.prepare_readings(list(made.blocks()), chain.sensors, 0.0, length)
    axes = axis_in_sensors(chain, made.mounting, Z)
    guess = initialisation.initial_unknowns(chain, noise, read, axes)
    whole = build_problem(chain, noise, read, guess.q_GS[0], made.hand, made.mounting)
    every = multi_resolution.thinning(whole.dt, RATE)
    thin = multi_resolution.thin_problem(
        multi_resolution.average_accelerations(whole, every), every
    )
    return solver.solve(thin, multi_resolution.thin_unknowns(guess, every), Limits(iterations=0))


def _limbs(limbs: Sequence[Solution]) -> float:
    return sum(
        _timed(lambda f=f: sandwich_covariance.limb_pulls(f.problem, f.at, f.factor))[1]
        for f in limbs
    )


def _hand(limbs: Sequence[Solution]) -> list[float]:
    whole = problem.gather_limbs([f.problem for f in limbs], Noise())
    at = problem.merge_places([f.at for f in limbs])
    factor, factoring = _timed(lambda: normal_equations.factorise(whole, at))
    back = _timed(lambda: normal_equations.solve_step(factor))[1]
    pulls = _timed(lambda: sandwich_covariance.hand_pulls(whole, at, factor))[1]
    return [factoring, back, pulls]


def _timed(work: Callable[[], A]) -> tuple[A, float]:
    began = time.process_time()
    return work(), time.process_time() - began


if __name__ == "__main__":
    main(float(sys.argv[1]))
