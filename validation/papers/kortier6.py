"""What the fingers hold (Kortier's thesis, chapter 6): two masses lifted, a spring squeezed, at the thesis' rate and at 100 Hz."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.measures import lift, squeeze
from handscope.estimators.methods import m2
from handscope.estimators.pipeline.process import process
from handscope.estimators.simulation import kinematics, person
from handscope.estimators.simulation.force_sensors import ForceErrors
from handscope.estimators.simulation.movements import (
    functional_calibration,
    object_dynamics,
    task_performance,
)
from handscope.estimators.simulation.scenario import ForceGlove, Simulated, simulate_performances
from handscope.estimators.simulation.sensors import PRESETS
from handscope.validation.papers import published
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.finding import Finding, Row, Spread, Table, Verdict, spread

RATES = {"12 Hz": 12.0, "100 Hz": 100.0}
POSE = 2.5  # deg by which every freedom of the initial pose may be missed
HEIGHT = 0.5  # m
MASSES = {"0.28 kg": 0.28, "0.44 kg": 0.44}
SPRING, SPRING_NAME = 600.0, "0.6 N/mm"
OBJECTS = (*MASSES, SPRING_NAME)
LIMITS = {"12 Hz": 10.0, "100 Hz": 5.0}  # %


@dataclass(frozen=True)
class Trial:
    """One run: held and seed."""

    held: str  # of OBJECTS
    seed: int  # the person with this glove


Found = Mapping[str, Mapping[str, float]]  # by rate


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    return [Trial(held, seed) for held in OBJECTS for seed in range(wanted.seeds)]


def measure(trial: Trial) -> Found:
    """One trial, felt by slow sensors and by fast ones."""
    return {name: _figures(trial, rate) for name, rate in RATES.items()}


def _figures(trial: Trial, rate: float) -> dict[str, float]:
    made, forces = _made(trial, rate)
    moved = process(m2, m2.Params(), made).trajectory
    event = next(e for e in made.events if e.trial_type == "task")
    if trial.held in MASSES:
        lifted = lift.measure(lift.Params(), moved, event.onset, event.end, made.geometry)
        figure, true = {f.name: f for f in lift.figures(lifted)}["lift_mass"], MASSES[trial.held]
    else:
        squeezed = squeeze.measure(squeeze.Params(), moved, event.onset, event.end, made.geometry)
        figure, true = {f.name: f for f in squeeze.figures(squeezed)}["squeeze_stiffness"], SPRING
    assert moved.forces is not None
    off = (moved.forces - forces)[:, :2]
    return {
        "error": 100 * abs(figure.value / true - 1),
        "honesty": ((figure.value - true) / figure.sd) ** 2 if figure.sd else float("nan"),
        "force": float(
            np.sqrt(np.nanmean((off**2).sum(axis=2)[(np.abs(forces[:, 0]) > 0.05).any(axis=1)]))
        ),
    }


def _made(trial: Trial, rate: float) -> tuple[Simulated, np.ndarray]:
    """The recording, and the true forces (n, 5, 3) at the instants of its truth."""
    of_person, of_sensors, of_pose, of_motion = np.random.default_rng(
        [trial.seed, OBJECTS.index(trial.held), 6]
    ).spawn(4)
    somebody = person.draw_person("left", of_person)
    pose = task_performance.initial_pose(
        somebody.true,
        taken=functional_calibration.miss_posture(task_performance.flat(), POSE, of_pose),
    )
    if trial.held in MASSES:
        done = object_dynamics.lift(
            somebody.true, of_motion, mass=MASSES[trial.held], height=HEIGHT
        )
    else:
        done = object_dynamics.squeeze(somebody.true, of_motion, stiffness=SPRING)
    glove = ForceGlove(rate=rate, errors=ForceErrors())
    made = simulate_performances(
        [pose, done],
        "left",
        somebody.true,
        of_sensors,
        PRESETS["LSM330DLC/HMC5983"],
        known=somebody.declared,
        force=glove,
    )
    t = made.truth.t - pose.motion.duration
    assert done.forces is not None
    forces = np.zeros((len(t), 5, 3))
    forces[t >= 0] = done.forces(
        kinematics.compute_kinematics(done.motion, somebody.true, t[t >= 0])
    )
    return made, forces


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Found]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    columns = tuple(RATES)
    theirs = published.KORTIER_OBJECTS
    errors = Table(
        "Error of the mass and of the stiffness, %",
        columns,
        tuple(
            Row(
                held,
                _columns(results, held, "error"),
                {"12 Hz": theirs[held][0]},
                {"12 Hz": theirs[held][1]},
            )
            for held in OBJECTS
        ),
        "12 Hz",
        "object",
        1,
    )
    others = tuple(
        Table(
            title,
            columns,
            tuple(Row(held, _columns(results, held, figure)) for held in OBJECTS),
            head="object",
            digits=2,
        )
        for figure, title in (
            ("honesty", "Normalised error squared (1 = as sure as it says, less = too careful)"),
            ("force", "Force of a fingertip while it is held, RMS of the vector's error, N"),
        )
    )
    verdicts = tuple(
        Verdict(
            f"{held}, sensors at {rate}",
            _columns(results, held, "error")[rate].mean,
            limit,
            "%",
            "our target",
        )
        for held in OBJECTS
        for rate, limit in LIMITS.items()
    )
    return Finding(
        "kortier6",
        "What the fingers hold (Kortier, thesis ch. 6)",
        _setting(),
        (errors, *others),
        verdicts,
        _remarks(),
    )


def _columns(results: Sequence[tuple[Trial, Found]], held: str, figure: str) -> dict[str, Spread]:
    return {
        rate: spread(found[rate][figure] for trial, found in results if trial.held == held)
        for rate in RATES
    }


def _setting() -> tuple[str, ...]:
    published_text = ", ".join(
        f"{held} {mean} ± {sd} %" for held, (mean, sd) in published.KORTIER_OBJECTS.items()
    )
    return (
        f"Beside ours: Kortier, thesis ch. 6, one subject, ten trials of each object: {published_text}; its abstract says 16.3 ± 12.6 % of the spring.",
        "Every trial is another person, glove and movement; method m2, no magnetometers, an initial pose of which every freedom is missed by up to "
        "2.5 deg; LSM330DLC sensors. Force sensors: noise 0.05 N, a zero of 0.2 N that walks by 0.02 N/sqrt(s), scale 2 %, cross-axis 1 %, turned on the cuff by 1 deg an axis.",
        "Cylinders of 6 cm lifted by 0.5 m and held for 3 s; a spring of 4 cm compressed eight times by about 11 mm.",
    )


def _remarks() -> tuple[str, ...]:
    return (
        "A mass is wrong mostly by the force sensors' scales and by how they are turned on their cuffs, a stiffness by how far the fingertips are taken to move: faster force "
        "sensors help neither.",
        "Left out by the simulation: cuffs that shift on the skin and fingertips that give way (the thesis names both as main causes), forces beyond what a linear sensor tells, "
        "channels read one after the other.",
        "Where we leave the thesis: the balance of forces is used across the specific force, so also while the hand moves; the line between the fingertips is told by the forces; "
        "one estimate of the whole hold in place of the recursive one half a second before the release.",
    )
