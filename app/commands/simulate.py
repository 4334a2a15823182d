"""`handscope simulate`: a simulated recording as Motion-BIDS with the truth beside it."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from handscope.app.commands.words import say, seed
from handscope.app.version import software_version
from handscope.estimators.errors import InputError
from handscope.estimators.hand.anatomy import HANDS
from handscope.estimators.hand.geometry import sized
from handscope.estimators.simulation.experiments import EXPERIMENTS, PersonErrors, record_experiment
from handscope.estimators.simulation.magnetic_field import MagneticField, homogeneous, office
from handscope.estimators.simulation.movements import (
    functional_calibration,
    guided_movements,
    object_dynamics,
    optical_capture,
    task_performance,
)
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.person import Person, draw_person
from handscope.estimators.simulation.scenario import (
    ForceGlove,
    InertialGlove,
    Simulated,
    simulate,
    simulate_performances,
)
from handscope.estimators.simulation.sensors import PRESET_SOURCES, PRESETS, SensorErrors
from handscope.estimators.simulation.transmission import LINKS
from handscope.estimators.simulation.trunk import TrunkGlove
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats.qualisys import read_markers
from handscope.sessions.motion_bids import writer
from handscope.sessions.motion_bids.truth import truth_files
from handscope.sessions.tables_io.writing import save_file

FOREARM_RATE = 100.0  # Hz, of a forearm sensor with a clock of its own

FUNCTIONAL = "functional_calibration"
TASKS_HELP = f"tasks are {', '.join(task_performance.TASKS)}; experiments are {', '.join(name for name in EXPERIMENTS if name not in task_performance.TASKS)}; {FUNCTIONAL}: its steps, then free movement; {', '.join(object_dynamics.TASKS)}: with force sensors on thumb and index tip; captured needs --markers"
PRESETS_HELP = "; ".join(f"{name} ({source})" for name, source in PRESET_SOURCES.items())


def add(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument("task", help=f"{TASKS_HELP}; an initial pose comes before it")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.zip")
    parser.add_argument("--hand", choices=HANDS, default="left")
    parser.add_argument("--seed", type=seed, default=0)
    parser.add_argument("--rate", type=float, default=100.0, metavar="HZ")
    parser.add_argument(
        "--setting",
        type=int,
        choices=(1, 2),
        default=1,
        help="1 homogeneous magnetic field, 2 disturbed as in an office with steel furniture",
    )
    parser.add_argument(
        "--preset",
        choices=PRESETS,
        default="MPU-9250",
        help=f"sensors and how they err: {PRESETS_HELP}",
    )
    parser.add_argument(
        "--ideal", action="store_true", help="sensors without errors: --preset ideal"
    )
    parser.add_argument(
        "--link",
        choices=LINKS,
        default="wired",
        help="losses on the way; unless wired, the forearm's sensor has a clock of its own",
    )
    parser.add_argument(
        "--pose-error",
        type=float,
        default=0.0,
        metavar="DEG",
        help="an experiment's initial pose is off by up to this in every joint",
    )
    parser.add_argument(
        "--misalignment",
        type=float,
        metavar="DEG",
        help="sensors are misaligned by up to this, about any axis; else as the preset says",
    )
    parser.add_argument(
        "--trunk",
        action="store_true",
        help="an inertial sensor and four magnetometers on the trunk and a magnet on the hand, for a task; the hand then has no magnetometers",
    )
    parser.add_argument(
        "--six-axes",
        action="store_true",
        help="lift and squeeze only: force sensors also measure torque",
    )
    parser.add_argument(
        "--markers",
        type=Path,
        metavar="FILE.tsv",
        help="Qualisys export of a hand of --hand: the movement that `captured` replays",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the verb; returns the exit code."""
    if not 10 <= arguments.rate <= 1000:
        raise InputError("command.rate_outside", rate=arguments.rate)
    if arguments.six_axes and arguments.task not in object_dynamics.TASKS:
        raise InputError(
            "command.six_axes_without_forces",
            task=arguments.task,
            tasks=" and ".join(object_dynamics.TASKS),
        )
    if not 0 <= arguments.pose_error <= 30:
        raise InputError("command.pose_error_outside", pose_error=arguments.pose_error)
    if arguments.misalignment is not None and not 0 <= arguments.misalignment <= 180:
        raise InputError("command.misalignment_outside", misalignment=arguments.misalignment)
    made = _made(arguments)
    if arguments.out.suffix != ".zip":
        raise InputError("command.zip_suffix", out=arguments.out)
    recording, label = as_recording(made), "".join(c for c in arguments.task if c.isalnum())
    files = writer.tree(recording, "simulated", label, software=software_version())
    files |= truth_files(made.truth, recording, "simulated", label, software_version())
    save_file(writer.pack(files), arguments.out)
    say(
        f"{recording.duration:.0f} s, {arguments.hand} hand, seed {arguments.seed}: {arguments.out}"
    )
    return 0


def as_recording(made: Simulated) -> LoadedRecording:
    """A simulated recording as one that was opened."""
    return LoadedRecording(
        made.hand,
        made.geometry,
        made.mounting,
        made.samples,
        made.events,
        source={"device": "simulated", "software": software_version()},
        plate=made.plate,
    )


def _made(arguments: argparse.Namespace) -> Simulated:
    """A task by the average hand, or an experiment by a person drawn at random."""
    rng, errors = (
        np.random.default_rng(arguments.seed),
        PRESETS["ideal" if arguments.ideal else arguments.preset],
    )
    if arguments.misalignment is not None:
        # angles are uniform between 0 and it: mean and half-width are its half
        errors = replace(
            errors,
            misalignment=arguments.misalignment / 2,
            misalignment_width=arguments.misalignment / 2,
        )
    link, field = LINKS[arguments.link], _field(arguments.setting, *rng.spawn(1))
    forearm_rate = None if arguments.link == "wired" else FOREARM_RATE
    if arguments.task == "captured":
        return _follow_markers(arguments, rng, errors, field)
    if arguments.task in EXPERIMENTS and arguments.task not in task_performance.TASKS:
        experiment, rate = EXPERIMENTS[arguments.task], arguments.rate
        return record_experiment(
            experiment,
            rng,
            errors,
            field,
            arguments.hand,
            person=PersonErrors(pose_deg=arguments.pose_error),
            glove=InertialGlove(rate=rate, forearm_rate=forearm_rate, link=link),
        )
    if arguments.task in object_dynamics.TASKS:
        return _held(arguments, rng, errors, field)
    if arguments.task not in (*task_performance.TASKS, FUNCTIONAL):
        raise InputError("command.unknown_simulation", task=arguments.task, tasks_help=TASKS_HELP)
    if arguments.task == FUNCTIONAL:
        return _functional(arguments, rng, errors, field)
    if arguments.pose_error:
        raise InputError(
            "command.pose_error_without_experiment", task=arguments.task, tasks_help=TASKS_HELP
        )
    if arguments.trunk:
        return _with_trunk(arguments, rng, errors)
    names = ["initial_pose"] + ([] if arguments.task == "initial_pose" else [arguments.task])
    hand = arguments.hand
    return simulate(
        names,
        hand,
        sized(hand),
        rng,
        errors,
        rate=arguments.rate,
        forearm_rate=forearm_rate,
        field=field,
        link=link,
    )


def _with_trunk(
    arguments: argparse.Namespace, rng: np.random.Generator, errors: SensorErrors
) -> Simulated:
    """A task by the average hand that carries a magnet, with magnetometers on the trunk."""
    hand = sized(arguments.hand)
    done = [task_performance.initial_pose(hand), task_performance.TASKS[arguments.task](hand)]
    return simulate_performances(
        done,
        arguments.hand,
        hand,
        rng,
        errors,
        glove=InertialGlove(rate=arguments.rate, link=LINKS[arguments.link]),
        on_trunk=TrunkGlove(),
    )


def _functional(
    arguments: argparse.Namespace,
    rng: np.random.Generator,
    errors: SensorErrors,
    field: MagneticField,
) -> Simulated:
    """Somebody does the initial pose, the steps of a functional calibration and moves freely; --pose-error applies to every held posture."""
    of_person, of_motion, of_sensors = rng.spawn(3)
    person = draw_person(arguments.hand, of_person)
    pose = task_performance.initial_pose(
        person.true,
        taken=functional_calibration.miss_posture(
            task_performance.flat(), arguments.pose_error, of_motion
        ),
    )
    steps = functional_calibration.all_steps(
        person.true, of_motion, functional_calibration.Carelessness(pose=arguments.pose_error)
    )
    return _perform_tasks(
        arguments,
        [pose, *steps, guided_movements.free(person.true, of_motion)],
        person,
        of_sensors,
        errors,
        field,
    )


def _held(
    arguments: argparse.Namespace,
    rng: np.random.Generator,
    errors: SensorErrors,
    field: MagneticField,
) -> Simulated:
    """Somebody lifts a mass or squeezes a spring."""
    of_person, of_motion, of_pose, of_sensors = rng.spawn(4)
    person = draw_person(arguments.hand, of_person)
    pose = task_performance.initial_pose(
        person.true,
        taken=functional_calibration.miss_posture(
            task_performance.flat(), arguments.pose_error, of_pose
        ),
    )
    done = [pose, object_dynamics.TASKS[arguments.task](person.true, of_motion)]
    return _perform_tasks(
        arguments, done, person, of_sensors, errors, field, ForceGlove(six_axes=arguments.six_axes)
    )


def _perform_tasks(
    arguments: argparse.Namespace,
    done: Sequence[Performance],
    person: Person,
    of_sensors: np.random.Generator,
    errors: SensorErrors,
    field: MagneticField,
    force: ForceGlove | None = None,
) -> Simulated:
    """What somebody does one after the other, over the link that was asked for."""
    return simulate_performances(
        done,
        arguments.hand,
        person.true,
        of_sensors,
        errors,
        glove=InertialGlove(
            rate=arguments.rate,
            forearm_rate=None if arguments.link == "wired" else FOREARM_RATE,
            link=LINKS[arguments.link],
        ),
        field=field,
        known=person.declared,
        force=force,
    )


def _follow_markers(
    arguments: argparse.Namespace,
    rng: np.random.Generator,
    errors: SensorErrors,
    field: MagneticField,
) -> Simulated:
    """The model hand moves as the markers did."""
    if arguments.markers is None:
        raise InputError("command.markers_missing")
    markers = read_markers(arguments.markers)
    fit = optical_capture.fit_markers(markers, arguments.hand)
    done = optical_capture.performance(fit, "captured", float(markers.t[0]), float(markers.t[-1]))
    say(f"markers followed within {1e3 * np.sqrt(np.nanmean(fit.misfit**2)):.1f} mm RMS")
    pose = task_performance.initial_pose(fit.geometry)
    return simulate_performances(
        [pose, done],
        arguments.hand,
        fit.geometry,
        rng,
        errors,
        glove=InertialGlove(rate=arguments.rate, link=LINKS[arguments.link]),
        field=field,
    )


def _field(setting: int, rng: np.random.Generator) -> MagneticField:
    return homogeneous() if setting == 1 else office(rng)
