"""What is told of a mass and of a stiffness where conditions are violated on purpose: how often it is said, how wrong it is, how sure it says it is.

Run     python docs/decisions/0008-conditions-violated.py [people] (40) [first seed] (1000) [conditions] (all), from the repository; two seconds a recording
Out     per condition: recordings of which something is said, of which nothing is told, error of the others in percent (of a damping in N s/m; mean, spread,
        largest), their normalised error squared, also of what recursive least squares tell at the end, and how many are wrong by more than 10 % and more than
        2.5 of their standard deviations with nothing said
Source  third finger, slip, sensors that drift and saturate: sizes ours, on top of the errors that every simulated sensor has
"""

import sys
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.samples import Block
from handscope.estimators.measures import lift, squeeze
from handscope.estimators.methods import m2
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation import person
from handscope.estimators.simulation.force_sensors import ForceErrors
from handscope.estimators.simulation.movements import (
    functional_calibration,
    object_dynamics,
    task_performance,
)
from handscope.estimators.simulation.movements.object_dynamics import NO_MISHAP, Mishap
from handscope.estimators.simulation.scenario import ForceGlove, Simulated, simulate_performances
from handscope.estimators.simulation.sensors import PRESETS

POSE = 2.5  # deg by which every freedom of the initial pose may be missed
MASSES, STIFFNESS = (0.44, 0.28), 600.0


USUAL = ForceErrors()


@dataclass(frozen=True)
class Condition:
    mishap: Mishap = NO_MISHAP
    errors: ForceErrors = USUAL
    limit_told: bool = True  # False: readings are clipped, and no full scale is told
    spoil: Callable[[Array, Array], Array] = lambda t, v: (
        v
    )  # of times since the task's beginning and readings (n, 2, 3), thumb first


THUMB = np.array([1.0, 0.0])[:, None]
CONDITIONS = {
    "none": Condition(),
    "third finger, a tenth": Condition(Mishap(third=0.1)),
    "third finger, a fifth": Condition(Mishap(third=0.2)),
    "third finger, a third": Condition(Mishap(third=0.35)),
    "slip": Condition(Mishap(slips=(4.0,))),
    "slips, four": Condition(Mishap(slips=(3.2, 4.0, 4.8, 5.6))),
    "drift, three times": Condition(errors=ForceErrors(drift=0.06)),
    "drift, ten times": Condition(errors=ForceErrors(drift=0.2)),
    "drift of the supply, 0.1 N/s within the grasp": Condition(
        spoil=lambda t, v: v + 0.1 * np.clip(t, 0.0, 10.0)[:, None, None]
    ),
    "jump of the thumb's zero by 0.5 N": Condition(
        spoil=lambda t, v: v + 0.5 * (t > 4.0)[:, None, None] * THUMB
    ),
    "the thumb's gain sinks by 15 %": Condition(spoil=lambda t, v: v * (1 - 0.15 * THUMB)),
    "both gains sink by 15 %": Condition(spoil=lambda t, v: 0.85 * v),
    "limit of 3 N, told": Condition(errors=ForceErrors(limit=3.0)),
    "limit of 3 N, not told": Condition(errors=ForceErrors(limit=3.0), limit_told=False),
    "saturates softly at 6 N": Condition(spoil=lambda t, v: 6.0 * np.tanh(v / 6.0)),
}


def performed_by(seed: int, what: str, condition: Condition) -> tuple[Simulated, float]:
    """Somebody with a hand of their own lifts or squeezes; with the true mass or stiffness."""
    of_person, of_pose, of_motion, of_sensors = np.random.default_rng([seed, 7]).spawn(4)
    somebody = person.draw_person("left", of_person)
    pose = task_performance.initial_pose(
        somebody.true,
        taken=functional_calibration.miss_posture(task_performance.flat(), POSE, of_pose),
    )
    if what == "lift":
        true = MASSES[seed % 2]
        task = object_dynamics.lift(somebody.true, of_motion, mass=true, mishap=condition.mishap)
    else:
        true = STIFFNESS
        task = object_dynamics.squeeze(
            somebody.true, of_motion, stiffness=true, mishap=condition.mishap
        )
    glove = ForceGlove(errors=condition.errors)
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
    block = made.samples["force"]
    onset = next(e.onset for e in made.events if e.trial_type == "task")
    stream = block.stream if condition.limit_told else replace(block.stream, full_scale={})
    spoilt = Block(stream, block.t, condition.spoil(block.t - onset, block.values))
    return replace(made, samples={**made.samples, "force": spoilt}), true


@dataclass(frozen=True)
class Told:
    value: float
    sd: float
    true: float


def told(what: str, made: Simulated, true: float) -> tuple[dict[str, Told], str]:
    """What is told of the object, and what is said of it."""
    event = next(e for e in made.events if e.trial_type == "task")
    moved = process(m2, m2.Params(), made).trajectory
    if what == "lift":
        lifted = lift.measure(lift.Params(), moved, event.onset, event.end, made.geometry)
        figures, runs, wanted = (
            lift.figures(lifted),
            [one.running for one in lifted.lifts],
            {"lift_mass": true},
        )
    else:
        squeezed = squeeze.measure(squeeze.Params(), moved, event.onset, event.end, made.geometry)
        figures, runs = squeeze.figures(squeezed), [one.running for one in squeezed.grasps]
        wanted = {"squeeze_stiffness": true, "squeeze_damping": 0.0}
    by_name = {f.what: f for f in figures}
    found = {
        name: Told(f.value, f.sd, of)
        for name, of in wanted.items()
        if np.isfinite((f := by_name[name]).value) and f.sd
    }
    ends = [one for one in runs if one is not None and np.isfinite(one.value[-1])]
    if ends:
        found["recursive"] = Told(float(ends[0].value[-1]), float(ends[0].sd[-1]), true)
    return found, by_name[next(iter(wanted))].reason


def line(each: list[Told]) -> str:
    off = np.array([100 * (one.value / one.true - 1) if one.true else one.value for one in each])
    squared = np.mean([((one.value - one.true) / one.sd) ** 2 for one in each])
    unit = "%" if each[0].true else "N s/m"
    return f"of {len(each)} {off.mean():+.1f} +- {off.std():.1f} ({np.abs(off).max():.1f}) {unit}, squared {squared:.2f}"


def surely_wrong(one: Told) -> bool:
    return abs(one.value / one.true - 1) > 0.1 and abs(one.value - one.true) > 2.5 * one.sd


def main(people: int, first: int, wanted: str) -> None:
    for what in ("lift", "squeeze"):
        for name, condition in CONDITIONS.items():
            if wanted not in f"{what}: {name}" or (what == "squeeze" and condition.mishap.slips):
                continue
            said, wrong, of_each = 0, 0, defaultdict[str, list[Told]](list)
            for seed in range(first, first + people):
                found, reason = told(what, *performed_by(seed, what, condition))
                said += bool(reason)
                wrong += not reason and any(surely_wrong(one) for one in found.values() if one.true)
                for quantity, one in found.items():
                    of_each[quantity].append(one)
            figures = (
                "; ".join(f"{quantity} {line(each)}" for quantity, each in of_each.items())
                or "nothing told"
            )
            sys.stdout.write(
                f"{what}: {name}: said of {said} of {people}; {figures}; surely wrong, unsaid: {wrong}\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    given = sys.argv[1:]
    main(
        int(given[0]) if given else 40,
        int(given[1]) if given[1:] else 1000,
        given[2] if given[2:] else "",
    )
