"""Recordings without a fault, of many kinds: free movement, tasks, stiff and amputated fingers, lost samples; by two simulators."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from handscope.estimators.data.samples import Block
from handscope.estimators.hand.anatomy import FINGERS, SEGMENTS
from handscope.estimators.simulation import experiments
from handscope.estimators.simulation.motion import Motion
from handscope.estimators.simulation.movements import free_movement
from handscope.estimators.simulation.movements import task_performance as tasks
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.person import draw_person
from handscope.estimators.simulation.scenario import InertialGlove, simulate_performances
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.estimators.simulation.transmission import WIRED, Transmission
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator.free_movement import Setup

Make = Callable[[np.random.Generator], list[Block]]
LOSSY = Transmission(lost=0.12, bursts=4.0)
STIFF = 0.3  # of every joint's range
AMPUTATED = tuple(s for s in SEGMENTS if s not in ("index_middle", "index_distal", "middle_distal"))


def _tasks(
    *names: str, link: Transmission = WIRED, stiff: float = 1.0, worn: Sequence[str] = SEGMENTS
) -> Make:
    def make(rng: np.random.Generator) -> list[Block]:
        person = draw_person("left", rng)
        done = [_stiffen(tasks.TASKS[name](person.true), stiff) for name in names]
        return list(
            simulate_performances(
                done,
                "left",
                person.true,
                rng,
                SensorErrors(),
                glove=InertialGlove(segments=worn, link=link),
            ).blocks()
        )

    return make


def _stiffen(done: Performance, share: float) -> Performance:
    """The same with every coordinate nearer to the relaxed hand."""
    spline = done.motion.spline
    c = share * spline.c
    c[-1] += (1 - share) * tasks.relaxed()
    return replace(done, motion=Motion(type(spline)(c, spline.x)))


def _experiment(name: str) -> Make:
    return lambda rng: list(
        experiments.record_experiment(
            experiments.EXPERIMENTS[name],
            rng,
            SensorErrors(),
            None,
            person=experiments.PersonErrors(pose_deg=2.5),
        ).blocks()
    )


def _free(duration: float) -> Make:
    def make(rng: np.random.Generator) -> list[Block]:
        person = draw_person("right", rng)
        errors = SensorErrors()
        return list(
            free_movement.record_trial(
                rng, errors, "right", person.true, person.declared, duration=duration
            ).blocks()
        )

    return make


def _outside(duration: float, pace: float) -> Make:
    """By the simulator that shares no line with the estimators, through files."""

    def make(rng: np.random.Generator) -> list[Block]:
        setup = Setup(
            int(rng.integers(1 << 30)), hand="right", fingers=FINGERS, duration=duration, pace=pace
        )
        return list(write_and_load(setup)[0].blocks())

    return make


FREE: Mapping[str, Make] = {
    "moving freely, 10 s": _free(10.0),
    "moving freely, 30 s": _free(30.0),
    "moving freely, 10 s, outside simulator": _outside(10.0, 1.3),
    "moving freely, 30 s, outside simulator": _outside(30.0, 1.3),
    "moving fast, 20 s, outside simulator": _outside(20.0, 2.0),
    "moving slowly, 20 s, outside simulator": _outside(20.0, 0.4),
    "one posture to another": _experiment("free"),
}
TASKS: Mapping[str, Make] = {
    "tapping": _tasks("initial_pose", "tapping"),
    "range of motion": _tasks("initial_pose", "rom"),
    "fist and flat hand": _tasks("initial_pose", "open_close"),
    "tremor at rest": _tasks("initial_pose", "tremor_rest"),
    "tremor, hand held out": _tasks("initial_pose", "tremor_posture"),
    "hand at rest": _tasks("initial_pose", "rest"),
    "turning the forearm": _tasks("initial_pose", "pronation_supination"),
    "reaching": _tasks("initial_pose", "reach"),
    "wrist": _tasks("initial_pose", "rom_wrist"),
    "one finger after the other": _tasks("initial_pose", "finger_independence"),
    "thumb to every finger": _tasks("initial_pose", "kapandji"),
    "fast finger and wrist": _tasks(
        "initial_pose", "powerglove_12_tapping_wrist", "powerglove_10_index_fast"
    ),
    "something held": _experiment("pinch"),
    "12 % of samples lost": _tasks("initial_pose", "rom_fist", "tapping", link=LOSSY),
    "stiff fingers": _tasks("initial_pose", "rom", stiff=STIFF),
    "amputated phalanges": _tasks("initial_pose", "rom", worn=AMPUTATED),
}
CONDITIONS = {**FREE, **TASKS}
