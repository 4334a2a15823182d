"""Position of the hand by a magnet, from an independent simulator: its files are written as by another program and processed by the product.

In      simulator/reaching.py, which shares nothing with the estimators: a magnet of finite size, soft iron, an inhomogeneous field, sensors with errors
Steps   the plate is turned, its recording opened and its magnetometers calibrated; the movement is written as Motion-BIDS, opened and processed
Out     what a clinician reads against the truth: position and orientations with their standard deviations, errors that are not marked
"""

import itertools
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import find_objects, label
from scipy.spatial.transform import Rotation

from handscope.estimators.data.samples import MAG
from handscope.estimators.data.trajectory import PlaceFlag, Trajectory
from handscope.estimators.magnet.pipeline import hand_position
from handscope.estimators.magnet.pipeline.hand_position import PlaceParams
from handscope.estimators.measures import reach
from handscope.estimators.measures.task_request import Mark, TaskRequest
from handscope.estimators.methods import METHODS
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import process
from handscope.estimators.sensors import magnetometer_board
from handscope.sessions.files.recording import LoadedRecording
from handscope.sessions.formats import recordings as formats_recordings
from handscope.validation.independent.simulator import reaching as world
from handscope.validation.independent.simulator.motion_files import axes, write_system
from handscope.validation.independent.simulator.reaching import Motion, Room, Worn
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.finding import Finding, Row, Table, Verdict, spread

MM, DEG = 1e3, 180 / np.pi
FIRST = 10.0  # s that are left out: the hand begins to move after five
COUNTS = {"four": 4, "one": 1}
NAMES = tuple(f"trunk_mag_{k + 1}" for k in range(len(world.PLATE)))
# breastbone's sensor to the trunk: forward, up, right
Q_BS = Rotation.from_matrix([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
UNTOLD = (30.0, 3.0)  # mm and standard deviations beyond which an unmarked position counts as wrong
BACK, WITHIN = 25.0, 3.0  # mm; s: one in which the hand comes back and two to find it
FIGURES = {
    "position": ("Place of the hand where it is told without a flag, RMS, mm", 1),
    "relative": ("Orientation of the hand against the trunk, RMS, deg", 1),
    "trunk": ("Orientation of the trunk, RMS, deg", 1),
    "place nes": (
        "Place where it is told without a flag: normalised error squared (1 = as sure as it says)",
        2,
    ),
    "relative nes": ("Relative orientation: normalised error squared", 2),
    "trunk nes": ("Orientation of the trunk: normalised error squared", 2),
    "told": ("Time for which the place is told without a flag, %", 1),
    "doubtful": ("Time marked doubtful, %", 1),
    "unsaid": (
        "Time at which the place is told without a flag and wrong by more than 3 cm and three standard deviations, %",
        2,
    ),
    "reach_straightness": ("Way of a reach over its straight distance: as told less as it was", 3),
    "reach_hand_speed": ("Peak speed of the hand in a reach: as told less as it was, mm/s", 1),
    "reach_hand_sparc": ("SPARC of the hand's way: as told less as it was", 3),
    "reach_hand_ldlj": ("LDLJ of the hand's way: as told less as it was", 3),
    "reach_hand_units": ("Movement units of the hand's way: as told less as they were", 3),
    "back": ("Place from 2 s after ten seconds out of reach, whether marked or not, RMS, mm", 1),
}
MEASURED = {
    "reach_straightness": 1.0,
    "reach_hand_speed": MM,
    "reach_hand_sparc": 1.0,
    "reach_hand_ldlj": 1.0,
    "reach_hand_units": 1.0,
}
REACHED = ("reaches", "reaches, trunk leans")  # movements with rests between reaches
RESTS = 0.03  # share of the hand's largest speed below which it rests between two reaches
SHORTEST = 0.8  # s from one rest to the next
LIMITS = {"position": (15.0, "mm"), "relative": (2.0, "deg"), "trunk": (6.0, "deg")}


@dataclass(frozen=True)
class Trial:
    """One run: movement, seed and seconds."""

    movement: str
    seed: int
    seconds: float = 60.0


# by number of magnetometers; a figure that a movement does not have is left out
Found = Mapping[str, Mapping[str, float]]


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    return [Trial(movement, seed) for movement in world.TRUNKS for seed in range(wanted.seeds)]


def measure(trial: Trial) -> Found:
    """Errors with one plate, magnet, room and movement, by all of its magnetometers and by the first alone."""
    return {name: _figures(trial, count) for name, count in COUNTS.items()}


def _figures(trial: Trial, count: int) -> dict[str, float]:
    seeds = np.random.SeedSequence([trial.seed, *trial.movement.encode()]).spawn(4)
    worn, room = (
        world.worn(np.random.default_rng(seeds[0]), count),
        world.room(np.random.default_rng(seeds[1])),
    )
    motion, rng = (
        world.moving(trial.movement, np.random.default_rng(seeds[2]), trial.seconds),
        np.random.default_rng(seeds[3]),
    )
    with tempfile.TemporaryDirectory() as folder:
        calibrated, strength = _calibrate_plate(Path(folder) / "turned", worn, room, rng)
        recording = _record(Path(folder) / "moved", worn, motion, room, rng, calibrated, strength)
    moved = process(METHODS["m2"], METHODS["m2"].Params(), recording).trajectory
    s = hand_position.make_setting(
        PlaceParams(), recording.plate, recording.streams, recording.mounting
    )
    assert (
        s is not None
        and moved.place is not None
        and moved.place_sd is not None
        and moved.place_flags is not None
    )
    track = hand_position.smooth_recording(s, list(recording.samples.values()))[1]
    after = track.t > FIRST
    t, q_bt, q_bt_sd, q_gb, q_gb_sd = (
        getattr(track, f)[after] for f in ("t", "q_bt", "q_bt_sd", "q_gb", "q_gb_sd")
    )
    (p_b, p_t), (R_b, _) = motion.at(moved.t)
    true = (Q_BS * R_b.inv()).apply(p_t - p_b)
    off = moved.place - true
    wrong, sd = MM * np.linalg.norm(off, axis=1), MM * np.linalg.norm(moved.place_sd, axis=1)
    late, reported = moved.t > FIRST, moved.place_flags == 0
    both = late & reported
    relative, trunk = _orientation_errors(t, q_bt, q_gb, motion, room)
    return {
        "told": 100 * float(reported[late].mean()),
        "doubtful": 100 * float((moved.place_flags[late] & PlaceFlag.DOUBTFUL != 0).mean()),
        "unsaid": 100 * float((both & (wrong > UNTOLD[0]) & (wrong > UNTOLD[1] * sd))[late].mean()),
        **(
            {
                "position": _rms(wrong[both]),
                "place nes": float(((off / moved.place_sd)[both] ** 2).mean()),
            }
            if both.any()
            else {}
        ),
        "relative": DEG * _rms(np.linalg.norm(relative, axis=1)),
        "trunk": DEG * _rms(np.linalg.norm(trunk, axis=1)),
        "relative nes": float(((relative / q_bt_sd) ** 2).mean()),
        "trunk nes": float(((trunk / q_gb_sd) ** 2).mean()),
        **(_measure_errors(moved, true) if trial.movement in REACHED and both.any() else {}),
        **(
            {"back": _rms(wrong[moved.t > world.BACK + WITHIN])}
            if "out of reach" in trial.movement
            else {}
        ),
    }


def _measure_errors(moved: Trajectory, true: Array) -> dict[str, float]:
    """Measures of the reaches from rest to rest, estimated less true; `true` (n, 3) m is the path of the hand."""
    speed = np.linalg.norm(np.gradient(true, moved.t, axis=0), axis=1)
    rests = find_objects(label((speed < RESTS * speed.max()) & (moved.t > FIRST))[0])
    middles = [float(moved.t[rest].mean()) for (rest,) in rests]
    marks = tuple(
        Mark(a, b, "reach", k)
        for k, (a, b) in enumerate(itertools.pairwise(middles))
        if b - a > SHORTEST
    )
    known = np.zeros(len(moved), np.uint8)
    means = []
    for path in (replace(moved, place_flags=known), replace(moved, place=true, place_flags=known)):
        found = reach.figures(
            reach.measure(
                reach.Params(),
                path,
                FIRST,
                float(path.t[-1]),
                None,
                TaskRequest("reach", {}, marks),
            )
        )
        means.append({f.what: f.value for f in found})
    return {name: unit * (means[0][name] - means[1][name]) for name, unit in MEASURED.items()}


def _orientation_errors(
    t: Array, q_bt: Array, q_gb: Array, motion: Motion, room: Room
) -> tuple[Array, Array]:
    """Errors of orientation (n, 3), (n, 3) rad: of hand against trunk about the hand's axes, of the trunk about its own.

    North is the mean direction of the field over the trunk's positions.
    """
    (p_b, _), (R_b, R_t) = motion.at(t)
    x, y, _ = room.at(p_b).mean(axis=0)
    north = Rotation.from_euler("z", np.arctan2(x, y))
    relative = _rotation(q_bt).inv() * R_b.inv() * R_t
    return relative.as_rotvec(), (_rotation(q_gb).inv() * north * R_b).as_rotvec()


def _rotation(q: Array) -> Rotation:
    return Rotation.from_quat(q[:, [1, 2, 3, 0]])


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


def _calibrate_plate(
    folder: Path, worn: Worn, room: Room, rng: np.random.Generator
) -> tuple[Mapping[str, tuple[Array, Array]], float]:
    """Matrix and bias by magnetometer from a recording of the plate being turned, and the field's strength, T."""
    turning = world.turned_about(rng)
    _write(
        folder,
        "turned",
        {"trunk": world.inertial(worn, turning, 0, rng)},
        world.magnetometers(worn, turning, room, rng, magnet=False),
    )
    recording = formats_recordings.load(folder, correct=False)
    block = next(b for b in recording.samples.values() if MAG in b.stream.quantities)
    mounting = np.array([recording.mounting[name] for name in block.stream.sensors])
    found = magnetometer_board.calibrate_board(block.stream.sensors, block.of(MAG), mounting)
    assert not found.refused, found.refused
    return {
        name: (s.calibration.matrix[MAG], s.calibration.bias[MAG])
        for name, s in found.solved.items()
    }, found.strength


def _record(
    folder: Path,
    worn: Worn,
    motion: Motion,
    room: Room,
    rng: np.random.Generator,
    calibrated: Mapping[str, tuple[Array, Array]],
    strength: float,
) -> LoadedRecording:
    t, raw = world.magnetometers(worn, motion, room, rng)
    mag = np.stack(
        [
            (raw[:, k] - bias) @ matrix.T
            for k, (matrix, bias) in enumerate(calibrated[name] for name in NAMES[: raw.shape[1]])
        ],
        axis=1,
    )
    places = {name: list(p) for name, p in zip(NAMES, worn.declared_places)}
    setup = {
        "places": places,
        "moment": list(worn.declared_moment),
        "place": list(world.ON_HAND),
        "earth": strength,
    }
    inertial = {
        name: world.inertial(worn, motion, which, rng)
        for which, name in enumerate(("trunk", "hand"))
    }
    _write(folder, "reach", inertial, (t, mag), {"MagnetSetup": setup})
    return formats_recordings.load(folder)


def _write(
    folder: Path,
    task: str,
    inertial: Mapping[str, tuple[Array, Array]],
    mag: tuple[Array, Array],
    more: Mapping[str, object] | None = None,
) -> None:
    """Motion-BIDS as text, in the units of data sheets."""
    place = folder / "sub-01" / "motion"
    place.mkdir(parents=True)
    stem = f"{place}/sub-01_task-{task}"
    q = list(np.roll(Q_BS.as_quat(), 1))
    for name, (t, samples) in inertial.items():
        values = np.column_stack([samples[:, :3] * DEG, samples[:, 3:]])
        channels = [*axes(name, "GYRO", "GYRO", "deg/s"), *axes(name, "ACCEL", "ACCEL", "m/s^2")]
        mounted = {"SensorMounting": {name: q} if name == "trunk" else {}}
        write_system(
            stem, name, t, values, channels, {**_sidecar(task, t), **(more or {}), **mounted}
        )
    t, readings = mag
    some = NAMES[: readings.shape[1]]
    channels = [channel for name in some for channel in axes(name, "MAGN", "MAGN", "uT")]
    mounted = {"SensorMounting": dict.fromkeys(some, q)}
    write_system(
        stem,
        "array",
        t,
        1e6 * readings.reshape(len(t), -1),
        channels,
        {**_sidecar(task, t), **mounted},
    )
    Path(f"{stem}_events.tsv").write_text(
        f"onset\tduration\ttrial_type\ttask_name\n1\t3\tinitial_pose\tn/a\n{world.STILL}\t{t[-1] - world.STILL:.1f}\ttask\treach\n"
    )


def _sidecar(task: str, t: Array) -> dict[str, object]:
    return {
        "TaskName": task,
        "SamplingFrequency": round(1 / float(np.median(np.diff(t))), 3),
        "MeasuredHand": "left",
    }


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Found]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    tables = tuple(_table(results, figure) for figure in FIGURES)
    verdicts = tuple(
        Verdict(
            f"reaches, trunk leans, {figure}",
            _mean(results, "reaches, trunk leans", figure),
            limit,
            unit,
            "our target",
        )
        for figure, (limit, unit) in LIMITS.items()
    )
    verdicts += (
        Verdict(
            "back in reach", _mean(results, "10 s out of reach", "back"), BACK, "mm", "our target"
        ),
    )
    return Finding(
        "independent-reach",
        "The hand followed by a magnet, in a world that is not ours",
        _setting(wanted),
        tables,
        verdicts,
        _remarks(),
    )


def _table(results: Sequence[tuple[Trial, Found]], figure: str) -> Table:
    title, digits = FIGURES[figure]
    rows = []
    for movement in world.TRUNKS:
        values = {
            name: [
                f[name][figure] for t, f in results if t.movement == movement and figure in f[name]
            ]
            for name in COUNTS
        }
        ours = {name: spread(v) for name, v in values.items() if v}
        if ours:
            rows.append(Row(movement, ours))
    return Table(title, tuple(COUNTS), tuple(rows), head="movement", digits=digits)


def _mean(results: Sequence[tuple[Trial, Found]], movement: str, figure: str) -> float:
    return spread(f["four"][figure] for t, f in results if t.movement == movement).mean


def _setting(wanted: Wanted) -> tuple[str, ...]:
    return (
        "Motion, field and sensors come from a simulator of its own (validation/independent/simulator/reaching.py: numpy and scipy, nothing of the estimators or of their simulator), are written as Motion-BIDS in deg/s and uT, and go the product's way: "
        "the plate's calibration from a recording of it being turned, then `process` with its defaults, which are not told how large the simulated errors are.",
        f"{wanted.seeds} seeds. Every one is another plate, magnet, room and movement of 60 s, first 10 s left out: a rod of neodymium of 8 mm by 8 mm as currents around it (0.38 A m^2), reaches of least jerk to 12 to 38 cm, a trunk that breathes, leans and turns by up to 30 deg, or steps; "
        "inertial sensors at 100 Hz (means over the sample, 0.3 deg/s and 0.05 m/s^2 of bias, 0.3 % of scale, 0.2 deg between axes), magnetometers at 75 Hz (0.35 uT of noise, 400 uT at most, 30 uT of hard iron, 4 % of soft iron, read up to 10 ms late), places told to 1 mm, the moment to 1 deg and 1 %; "
        "a room whose field changes by 2.3 uT/m.",
    )


def _remarks() -> tuple[str, ...]:
    return (
        "One magnetometer cannot contradict itself: all of it is marked doubtful, and no place is told.",
    )
