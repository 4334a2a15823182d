"""A third finger without a sensor carries a share of what thumb and index lift: how often it is said, how wrong the mass is, how sure it says it is.

Run     python docs/decisions/0008-third-finger.py [people] (40), from the repository; two minutes for forty people and three shares
Out     per share: lifts of which it is said, lifts of which no mass is told, mean error of the others and its spread, their normalised error squared
"""

import sys

import numpy as np

from estimators.measures import lift
from estimators.methods import m2
from estimators.processing import process
from estimators.simulation import functional, held_object, person, tasks
from estimators.simulation.held_object import Mishap
from estimators.simulation.scenario import ForceGlove, Simulated, performed
from estimators.simulation.sensors import PRESETS

SHARES = (0.0, 0.1, 0.2)
POSE = 2.5  # deg by which every freedom of the initial pose may be missed


def lifted(seed: int, mass: float, third: float) -> Simulated:
    """Somebody with a hand of their own lifts a cylinder."""
    of_person, of_pose, of_motion, of_sensors = np.random.default_rng([seed, 7]).spawn(4)
    somebody = person.drawn("left", of_person)
    pose = tasks.initial_pose(somebody.true, taken=functional.missed(tasks.flat(), POSE, of_pose))
    task = held_object.lift(somebody.true, of_motion, mass=mass, mishap=Mishap(third=third))
    preset = PRESETS["LSM330DLC/HMC5983"]
    return performed([pose, task], "left", somebody.true, of_sensors, preset, known=somebody.told, force=ForceGlove())


def main(people: int) -> None:
    for share in SHARES:
        said, errors, surprise = 0, [], []
        for seed in range(people):
            mass = 0.28 if seed % 2 else 0.44
            made = lifted(seed, mass, share)
            event = next(e for e in made.events if e.trial_type == "task")
            found = lift.measure(lift.Params(), process(m2, m2.Params(), made).trajectory, event.onset, event.end)
            said += "another finger" in found.reason or "do not balance" in found.reason
            for one in found.lifts:
                if np.isfinite(one.mass):
                    errors.append(100 * (one.mass / mass - 1))
                    surprise.append(((one.mass - mass) / one.mass_sd) ** 2)
        told = f"error {np.mean(errors):.1f} +- {np.std(errors):.1f} %, normalised error squared {np.mean(surprise):.2f}"
        sys.stdout.write(f"share {share:.1f}: said of {said} of {people}, no mass of {people - len(errors)}; {told}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
