"""The experiments of the papers' tables, each as somebody with a hand of their own would do it.

Source  Salchow-Hoemmen 2019, 3.1.3 and Table 4 (10-15 repetitions, 30-50 s, joint rates below 2 rad/s), 3.2 and Table 5 (15-35 s, the hand moving
        in all directions); Valtin 2017, Fig. 4; flexion, circles, pinches, open and close at 116 per minute with 80 deg of PIP flexion and the
        repeatability protocol: Kortier thesis, ch. 2
Limits  how far each joint goes is ours: the papers give numbers of repetitions, durations and greatest rates
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from handscope.estimators.hand.anatomy import FINGERS, IS_DOF, JOINT, Hand
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation import joint_compliance
from handscope.estimators.simulation.distributions import draw
from handscope.estimators.simulation.magnetic_field import MagneticField
from handscope.estimators.simulation.movements import (
    functional_calibration,
    guided_movements,
    static_hold,
    task_performance,
)
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.person import Anatomy, draw_person
from handscope.estimators.simulation.scenario import (
    FULL_GLOVE,
    InertialGlove,
    Simulated,
    simulate_performances,
)
from handscope.estimators.simulation.sensors import SensorErrors

Perform = Callable[[HandGeometry, np.random.Generator], tuple[Performance, ...]]


@dataclass(frozen=True)
class Experiment:
    """One row of a table of the paper: what the person does and what is judged.

    The task events of what is performed are the stretches that are judged: of a pinch only while it is closed.
    """

    name: str
    fingers: tuple[str, ...]  # whose tips are judged
    perform: Perform  # begins with the initial pose
    # (finger, contact point) pair of Table 7; points left, right, bottom, distal
    contact: tuple[tuple[str, str], ...] = ()
    distance: float = 0.0  # m, true distance between the contact points


@dataclass(frozen=True)
class PersonErrors:
    """In what a person differs from what a method is given of them."""

    pose_deg: float = 0.0  # deg, largest miss of the initial pose in each freedom
    wrist_deg: float | None = None  # deg, the wrist's; None: as the fingers'
    # None: evenly spread up to the largest; else their distribution, with these standard deviations
    distribution: str | None = None
    lengths: bool = True  # the hand differs from its declared geometry
    give_deg: float = 0.0  # deg, by which joints give (joint_compliance.py)
    anatomy: Anatomy = field(default_factory=Anatomy)  # how far hands differ


def record_experiment(
    experiment: Experiment,
    rng: np.random.Generator,
    errors: SensorErrors,
    field: MagneticField | None,
    hand: Hand = "left",
    person: PersonErrors = PersonErrors(),
    glove: InertialGlove = FULL_GLOVE,
    steps: bool = False,
) -> Simulated:
    """Somebody with a hand of their own does it; the method gets its declared geometry.

    With `steps` a functional calibration stands between the pose and the experiment.

    Each source of error has a random stream of its own: what is switched off leaves all the others as they were.
    """
    of_person, of_pose, of_motion, of_sensors, of_steps, of_give = rng.spawn(6)
    somebody = draw_person(hand, of_person, person.anatomy)
    true = somebody.true if person.lengths else somebody.declared
    pose, *rest = experiment.perform(true, of_motion)
    missed = _miss_posture(task_performance.flat(), person, of_pose)
    pose = task_performance.initial_pose(true, pose.motion.duration, taken=missed)
    calibrating = functional_calibration.all_steps(true, of_steps) if steps else ()
    whole, phase = [pose, *calibrating, *rest], joint_compliance.draw_phases(of_give)
    if person.give_deg:
        give = np.radians(person.give_deg)
        whole = [
            replace(p, motion=joint_compliance.JointCompliance(p.motion.spline, give, phase))
            for p in whole
        ]
    return simulate_performances(
        whole, hand, true, of_sensors, errors, glove, field, known=somebody.declared
    )


def judged_samples(made: Simulated) -> Array:
    """Which samples (n,) of the truth lie within what is judged."""
    t = made.truth.t
    return np.asarray(
        np.any(
            [(t >= e.onset) & (t <= e.end) for e in made.events if e.trial_type == "task"], axis=0
        )
    )


def _miss_posture(pose: Array, person: PersonErrors, rng: np.random.Generator) -> Array:
    """The pose with every freedom of every joint off by what the person misses it by."""
    largest = np.full((len(IS_DOF), 1), person.pose_deg)
    largest[JOINT["wrist"]] = person.pose_deg if person.wrist_deg is None else person.wrist_deg
    share = (
        rng.uniform(-1, 1, IS_DOF.shape)
        if person.distribution is None
        else draw(rng, person.distribution, IS_DOF.shape)
    )
    off = np.radians(largest) * share * IS_DOF
    return np.concatenate([pose[:6], pose[6:] + off.ravel()])


def _perform_after_pose(
    perform: Callable[[HandGeometry, np.random.Generator], Performance],
) -> Perform:
    return lambda geometry, rng: (task_performance.initial_pose(geometry), perform(geometry, rng))


def _table6(
    name: str,
    finger: str,
    perform: Callable[[HandGeometry, np.random.Generator, str, str], Performance],
) -> Experiment:
    return Experiment(
        name,
        (finger,),
        _perform_after_pose(lambda geometry, rng: perform(geometry, rng, name, finger)),
    )


def _table7(
    name: str,
    hold: static_hold.Hold,
    perform: Callable[[HandGeometry, np.random.Generator], Performance],
) -> Experiment:
    return Experiment(
        name, hold.fingers, _perform_after_pose(perform), (hold.a, hold.b), hold.distance
    )


TABLE6: Mapping[str, Experiment] = {
    e.name: e
    for e in (
        _table6("A-F1", "thumb", guided_movements.abduction),
        _table6("A-F2", "index", guided_movements.abduction),
        _table6("A-F3", "middle", guided_movements.abduction),
        _table6("AF-F1", "thumb", guided_movements.circling),
        _table6("AF-F2", "index", guided_movements.circling),
        _table6("AF-F3", "middle", guided_movements.circling),
        _table6("F-F2", "index", guided_movements.flexion),
        _table6("F-F3", "middle", guided_movements.flexion),
    )
}
TABLE7: Mapping[str, Experiment] = {
    e.name: e
    for e in (
        _table7("P1 F1-F2", static_hold.SPACER_THUMB_INDEX, static_hold.spacer_thumb_index),
        _table7("P2 F2-F3", static_hold.SPACER_INDEX_MIDDLE, static_hold.spacer_index_middle),
        _table7("P3 F1-F2", static_hold.PINCH, static_hold.pinch_twice),
        *(
            _table7(f"P4 {pair}", hold, static_hold.block)
            for pair, hold in static_hold.BLOCK.items()
        ),
    )
}
OTHERS: Mapping[str, Experiment] = {
    e.name: e
    for e in (
        Experiment(
            "mechanical finger", ("index",), _perform_after_pose(guided_movements.mechanical_finger)
        ),
        Experiment(
            "tapping",
            ("thumb", "index"),
            _perform_after_pose(lambda geometry, rng: task_performance.tapping(geometry)),
        ),
        Experiment(
            "open_close 116/min",
            ("index", "middle", "ring", "little"),
            _perform_after_pose(guided_movements.open_close),
        ),
        Experiment(
            "circles",
            ("index",),
            _perform_after_pose(
                lambda geometry, rng: guided_movements.circling(geometry, rng, "circles", "index")
            ),
        ),
        Experiment(
            "free",
            ("thumb", "index", "middle", "ring", "little"),
            _perform_after_pose(guided_movements.free),
        ),
    )
}
KORTIER2: Mapping[str, Experiment] = {
    e.name: e
    for e in (
        Experiment(
            "brisk flexion", ("index",), _perform_after_pose(guided_movements.brisk_flexion)
        ),
        Experiment(
            "brisk circles", ("index",), _perform_after_pose(guided_movements.brisk_circles)
        ),
        Experiment(
            "pinch",
            ("thumb", "index"),
            _perform_after_pose(static_hold.pinches),
            (static_hold.PINCH.a, static_hold.PINCH.b),
            static_hold.PINCH.distance,
        ),
        Experiment(
            "flat hand",
            FINGERS,
            _perform_after_pose(
                lambda geometry, rng: task_performance.TASKS["repeatability_flat"](geometry)
            ),
        ),
        Experiment(
            "clenched mould",
            FINGERS,
            _perform_after_pose(
                lambda geometry, rng: task_performance.TASKS["repeatability_mould"](geometry)
            ),
        ),
    )
}
# new ones last: a trial's random numbers go by the place
EXPERIMENTS: Mapping[str, Experiment] = {**TABLE6, **TABLE7, **OTHERS, **KORTIER2}
