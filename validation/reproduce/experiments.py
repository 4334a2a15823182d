"""The papers' experiments run on simulated people: what every trial has in common.

One seed is one person with a hand, sensors and movements of their own; the methods see the recording, never the truth.
"""

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace

import numpy as np

from handscope.estimators.data.options import describe
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import DOF_NAMES
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.methods import METHODS
from handscope.estimators.numerics.typing import Array, Indices
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation import experiments
from handscope.estimators.simulation.experiments import (
    Experiment,
    PersonErrors,
    judged_samples,
    record_experiment,
)
from handscope.estimators.simulation.magnetic_field import homogeneous, office
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.person import Anatomy
from handscope.estimators.simulation.scenario import InertialGlove, Simulated
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.reproduce.finding import Sizes

Rows = Indices
# deg, largest, of every freedom in the initial pose: what a person misses the flat hand by
POSE_ERROR = 2.5
RATE = 100.0  # Hz
# only `honesty` changes these
OF_OTHER_WORLDS = "distribution", "skin_law", "slip", "slipping"
VARIANTS: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "b": ("b", {}),
    "m1": ("m1", {}),
    "m2": ("m2", {}),
    "m2 heading": ("m2", {"alignment": "heading"}),
}


@dataclass(frozen=True)
class Trial:
    """One person doing one experiment."""

    experiment: str
    seed: int


def chosen(names: Sequence[str], table: Mapping[str, Experiment]) -> list[str]:
    """The experiments asked for that are in the table, all where none is named; InputError for one that is in no table."""
    for name in names:
        if name not in experiments.EXPERIMENTS:
            raise InputError(
                f"there is no experiment {name!r}; experiments are {', '.join(experiments.EXPERIMENTS)}"
            )
    return [name for name in table if not names or name in names]


def performed(
    trial: Trial,
    errors: SensorErrors | None = None,
    pose_error: float = POSE_ERROR,
    length_errors: bool = True,
    wrist_error: float | None = None,
    normal_pose_error: bool = False,
) -> Simulated:
    """The trial's recording in a homogeneous field, with the truth beside it: full errors unless told otherwise.

    `pose_error` is the largest error of each freedom in the pose, or the standard deviation of a normal one."""
    person = PersonErrors(
        pose_deg=pose_error,
        lengths=length_errors,
        wrist_deg=wrist_error,
        distribution="normal" if normal_pose_error else None,
    )
    return performed_by(trial, person, errors or SensorErrors())


def performed_by(
    trial: Trial,
    person: PersonErrors,
    errors: SensorErrors,
    changed: Callable[[Experiment], Experiment] | None = None,
) -> Simulated:
    """The same of a person who errs so, with sensors that err so; `changed` makes another experiment of the trial's."""
    of_field, of_person = _generators(trial)
    field, experiment = homogeneous(_north(of_field)), experiments.EXPERIMENTS[trial.experiment]
    return record_experiment(
        changed(experiment) if changed else experiment,
        of_person,
        errors,
        field,
        "left",
        person=person,
        glove=InertialGlove(rate=RATE),
    )


def calibrating(trial: Trial) -> Simulated:
    """The trial's recording with the steps of a functional calibration before the movement, in a homogeneous field."""
    of_field, of_person = _generators(trial)
    field, experiment = homogeneous(_north(of_field)), experiments.EXPERIMENTS[trial.experiment]
    return record_experiment(
        experiment,
        of_person,
        SensorErrors(),
        field,
        "left",
        person=PersonErrors(pose_deg=POSE_ERROR),
        glove=InertialGlove(rate=RATE),
        steps=True,
    )


def in_either_field(trial: Trial) -> tuple[Simulated, Simulated]:
    """The same person and movement near steel furniture and in a homogeneous field."""
    (of_field, of_person), experiment = (
        _generators(trial),
        _remembering(experiments.EXPERIMENTS[trial.experiment]),
    )
    north = _north(of_field)
    fields = (office(of_field, north), homogeneous(north))
    near, far = (
        record_experiment(
            experiment,
            deepcopy(of_person),
            SensorErrors(),
            field,
            "left",
            person=PersonErrors(pose_deg=POSE_ERROR),
            glove=InertialGlove(rate=RATE),
        )
        for field in fields
    )
    return near, far


def estimated(recording: Simulated, variant: str) -> tuple[Trajectory, Trajectory]:
    """The estimate of a method and the truth, where the experiment is judged."""
    name, options = VARIANTS[variant]
    moved = process(METHODS[name], METHODS[name].Params(**options), recording).trajectory
    return at_the_truths_instants(recording, moved)


def at_the_truths_instants(
    recording: Simulated, moved: Trajectory
) -> tuple[Trajectory, Trajectory]:
    """The estimate and the truth where the experiment is judged."""
    where = judged_samples(recording)
    return moved.at(_rows(moved.t, recording.truth.t[where])), recording.truth.at(
        np.flatnonzero(where)
    )


def simulated_setting(disturbed: bool) -> tuple[str, ...]:
    """What is the same in all simulated experiments; the error sizes are in `sizes`."""
    # the simulator's own words
    field = " ".join(((office if disturbed else homogeneous).__doc__ or "").split())
    return (
        f"Every seed is another person: hand, lengths, sensors, errors and movement are drawn anew. {len(DOF_NAMES)} freedoms, left hand, 17 sensors "
        f"at {RATE:g} Hz, one initial pose of which every freedom of every joint is missed by up to {POSE_ERROR:g} deg. Magnetic field: {field} "
        "Error sizes as listed under `Error sizes`.",
    )


def sizes() -> Sizes:
    """The error sizes of all simulated experiments."""
    pose = (
        "initial pose missed in every freedom of every joint, largest",
        f"{POSE_ERROR:g} deg",
        "asked for by our targets; evenly spread",
    )
    sensors, hands = (
        [
            (d.meaning, _with_unit(d.default, d.unit), d.source)
            for d in describe(o)
            if d.name not in OF_OTHER_WORLDS
        ]
        for o in (SensorErrors, Anatomy)
    )
    return Sizes(
        "error-sizes", "Error sizes", ("what errs", "size", "source"), (pose, *sensors, *hands)
    )


def _with_unit(value: float, unit: str) -> str:
    return f"{value:g} {unit}".removesuffix(" 1")


def _generators(trial: Trial) -> list[np.random.Generator]:
    """Of the field and of the person."""
    return np.random.default_rng(
        [trial.seed, list(experiments.EXPERIMENTS).index(trial.experiment)]
    ).spawn(2)


def _north(rng: np.random.Generator) -> float:
    return float(rng.uniform(-np.pi, np.pi))


def _remembering(experiment: Experiment) -> Experiment:
    """The same experiment, its movement made up once only: a closed chain takes its time."""
    made: list[tuple[Performance, ...]] = []

    def perform(geometry: HandGeometry, rng: np.random.Generator) -> tuple[Performance, ...]:
        if not made:
            made.append(experiment.perform(geometry, rng))
        return made[0]

    return replace(experiment, perform=perform)


def _rows(t: Array, wanted: Array) -> Rows:
    """Where in t the wanted instants are."""
    k = np.searchsorted(t, wanted - 1e-6)
    assert k[-1] < len(t) and np.abs(t[k] - wanted).max() < 1e-6, (
        "an instant that was not estimated"
    )
    return np.asarray(k)
