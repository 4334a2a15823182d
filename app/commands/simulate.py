"""`handscope simulate`: a simulated recording as Motion-BIDS with the truth beside it."""

import argparse
from pathlib import Path

import numpy as np

from app.commands.words import say
from app.version import software_version
from estimators.errors import InputError
from estimators.hand_anatomy import HANDS
from estimators.hand_geometry import sized
from estimators.simulation import tasks
from estimators.simulation.scenario import Simulated, simulate
from estimators.simulation.sensors import IDEAL, SensorErrors
from sessions.motion_bids import writer
from sessions.motion_bids.truth import truth_files
from sessions.recording import LoadedRecording
from sessions.writing import save_file


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("task", help=f"one of {', '.join(tasks.TASKS)}; an initial pose comes before it")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.zip")
    parser.add_argument("--hand", choices=HANDS, default="left")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rate", type=float, default=100.0, metavar="HZ")
    parser.add_argument(
        "--setting",
        type=int,
        choices=(1, 2),
        default=1,
        help="1 homogeneous magnetic field, 2 disturbed (magnetometers come with the full error model)",
    )
    parser.add_argument("--ideal", action="store_true", help="sensors without errors")


def run(arguments: argparse.Namespace) -> int:
    if not 10 <= arguments.rate <= 1000:
        raise InputError(f"--rate {arguments.rate:g} Hz is outside 10 to 1000 Hz")
    names = ["initial_pose"] + ([] if arguments.task == "initial_pose" else [arguments.task])
    errors = IDEAL if arguments.ideal else SensorErrors()
    made = simulate(names, arguments.hand, sized(arguments.hand), np.random.default_rng(arguments.seed), errors, rate=arguments.rate)
    if arguments.out.suffix != ".zip":
        raise InputError(f"{arguments.out} does not end in .zip")
    recording = as_recording(made)
    files = writer.tree(recording, "simulated", arguments.task.replace("_", ""))
    files |= truth_files(made.truth, recording, "simulated", arguments.task.replace("_", ""), software_version())
    save_file(writer.packed(files), arguments.out)
    say(f"{recording.duration:.0f} s, {arguments.hand} hand, seed {arguments.seed}: {arguments.out}")
    return 0


def as_recording(made: Simulated) -> LoadedRecording:
    """A simulated recording as one that was opened."""
    return LoadedRecording(
        made.hand, made.geometry, made.mounting, made.samples, made.events, source={"device": "simulated", "software": software_version()}
    )
