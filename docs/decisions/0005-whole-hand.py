"""Fingers alone and the whole hand as one problem, on the same 40 s: python docs/decisions/0005-whole-hand.py [seed ...]."""

import sys
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.hand.geometry import HandGeometry, HandMeasures, sized
from handscope.estimators.self_calibration import initialisation as self_calibration_initialisation
from handscope.estimators.self_calibration import sample_preparation, segments, solver
from handscope.estimators.self_calibration.problem import (
    Noise,
    Z,
    axis_in_sensors,
    build_chain,
    build_problem,
    with_lengths,
)
from handscope.estimators.self_calibration.solver import Limits, Solution
from handscope.estimators.self_calibration.whole_hand import solver as whole_hand_solver
from handscope.estimators.simulation.movements import free_movement
from handscope.estimators.simulation.scenario import Simulated
from handscope.estimators.simulation.sensors import SensorErrors

DURATION = 40.0  # s
SPREAD = 0.06  # of the lengths about those of an average hand of the person's size


def compared(seed: int) -> str:
    """One person, all errors of sensors and skin; lengths are given as an average hand's."""
    true = _person(seed)
    made = free_movement.record_trial(
        np.random.default_rng(seed), SensorErrors(), "left", true, sized("left"), duration=DURATION
    )
    began = time.process_time()
    alone = [_alone(made, finger) for finger in CHAINS]
    between = time.process_time()
    together = whole_hand_solver.solve(alone, Noise(), Limits(least_gain=0.25))
    took = time.process_time() - between
    return (
        f"seed {seed}: alone {_errors(made, true, alone)}, {between - began:.0f} s;"
        f" together ({together.outcome}) {_errors(made, true, whole_hand_solver.split_limbs(together))}, {took:.0f} s more"
    )


def _person(seed: int) -> HandGeometry:
    average = sized("left", HandMeasures(hand_length=0.175 + 0.01 * (seed % 3)))
    lengths = {
        name: length * (1 + SPREAD * np.random.default_rng([seed, 9, k]).standard_normal())
        for k, (name, length) in enumerate(average.lengths.items())
    }
    return replace(average, lengths=lengths)


def _alone(made: Simulated, finger: str) -> Solution:
    links = build_chain(("hand", *CHAINS[finger]))
    _, read = sample_preparation.prepare_readings(list(made.blocks()), links.sensors, 0.0, DURATION)
    guess = self_calibration_initialisation.initial_unknowns(
        links, Noise(), read, axis_in_sensors(links, made.mounting, Z)
    )
    return solver.solve_with_noise(
        with_lengths(
            build_problem(links, Noise(), read, guess.q_GS[0], "left", made.mounting),
            made.geometry.lengths,
        ),
        guess,
    )


def _errors(made: Simulated, true: HandGeometry, found: Sequence[Solution]) -> str:
    told = [segments.of_solution(finger, "left", made.mounting) for finger in found]
    off = np.array([t.lengths[s] / true.lengths[s] - 1 for t in told for s in t.lengths])
    sd = np.array([t.lengths_sd[s] / true.lengths[s] for t in told for s in t.lengths])
    return f"ten lengths off by {100 * np.sqrt(np.mean(off**2)):.2f} % RMS, {100 * np.abs(off).max():.1f} % at most, {np.sqrt(np.mean((off / sd) ** 2)):.1f} standard deviations"


if __name__ == "__main__":
    for seed in [int(a) for a in sys.argv[1:]] or [1]:
        sys.stdout.write(compared(seed) + "\n")
        sys.stdout.flush()
