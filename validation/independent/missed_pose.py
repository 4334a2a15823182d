"""What a missed initial pose costs, by a simulator that shares no line with the estimators: `m2`, and `ekf` with and without what it infers of the pose."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import FINGERS, IS_DOF, JOINT
from handscope.estimators.methods import METHODS, ekf
from handscope.estimators.methods import map as self_calibration
from handscope.estimators.numerics.typing import Array
from handscope.estimators.pipeline.process import process
from handscope.sessions.clinic import self_calibrations
from handscope.sessions.formats.derivative import calibration_table
from handscope.validation.independent.recordings import write_and_load
from handscope.validation.independent.simulator import contacts, daily_movements
from handscope.validation.independent.simulator.free_movement import (
    BEGUN,
    DEG,
    Setup,
    Truth,
)
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.accuracy import angle_difference, nees, rms
from handscope.validation.reproduce.finding import Finding, Row, Table, spread

POSES = (2.5, 1.5)  # deg, standard deviation of every freedom's error
CASES: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "m2": ("m2", {}),
    "ekf, pose taken as held": ("ekf", {"pose_inference": False}),
    "ekf": ("ekf", {}),
}
ALL, AWAY = tuple(contacts.HOLDS), 0.04  # m, between what is said to touch
CONTACTS: Mapping[str, tuple[Sequence[str], float]] = {
    **{f"ekf, {kind}": ((kind,), 0.0) for kind in contacts.HOLDS},
    "ekf, all contacts": (ALL, 0.0),
    "ekf, all contacts missed": (ALL, AWAY),
}
DAILY = "ekf, daily movements"
KNOWN: Mapping[str, str] = {  # what of a self-calibration in the slow movement is taken over
    DAILY: self_calibrations.NOTHING,
    f"{DAILY}, lengths known": self_calibrations.LENGTHS,
    f"{DAILY}, lengths and mountings known": self_calibrations.ALL,
}
DURATION, PACE = 45.0, 0.6  # s, Hz
DAILY_DURATION = 24.0  # s
COLUMNS = ("tips, cm", "angles, deg", "NEES angles", "NEES tips")


@dataclass(frozen=True)
class Trial:
    """One person and one size of the pose's errors."""

    pose: float  # deg
    seed: int


def trials(wanted: Wanted) -> Sequence[Trial]:
    """Every size with as many people as seeds."""
    return [Trial(pose, seed) for pose, seed in product(POSES, range(wanted.seeds))]


def measure(trial: Trial) -> Mapping[str, float]:
    """Errors by case and column, over the movement behind the pose."""
    person = Setup(trial.seed, fingers=FINGERS, forearm=True, missed=trial.pose * DEG)
    slow = replace(person, pace=PACE, duration=DURATION)
    recording, true = write_and_load(slow)
    found: dict[str, float] = {}
    for case, (name, options) in CASES.items():
        method = METHODS[name]
        moved = process(method, method.Params(**options), recording).trajectory
        errors = _errors(moved, true, BEGUN, DURATION)
        found |= {f"{case}: {what}": error for what, error in errors.items()}
    for case, (kinds, separation) in CONTACTS.items():
        errors = _with_contacts(slow, kinds, separation)
        found |= {f"{case}: {what}": error for what, error in errors.items()}
    calibrated = process(self_calibration, self_calibration.Params(), recording).calibrations[0]
    return found | _in_daily_movements(person, calibration_table(calibrated))


def _in_daily_movements(person: Setup, table: Mapping[str, Any]) -> dict[str, float]:
    """Errors of `ekf`, mean over the movements, each after a pose of its own that the person misses alike, by what is taken over of a self-calibration's table."""
    setup, each = replace(person, duration=DAILY_DURATION), list[dict[str, float]]()
    for name in daily_movements.MOVEMENTS:
        recording, true = write_and_load(setup, daily_movements.movement(name, setup))
        found: dict[str, float] = {}
        for case, parts in KNOWN.items():
            taken = parts != self_calibrations.NOTHING
            known = self_calibrations.select_parts(table, parts) if taken else None
            moved = process(ekf, ekf.Params(), recording, known=known).trajectory
            errors = _errors(moved, true, BEGUN, DAILY_DURATION)
            found |= {f"{case}: {what}": error for what, error in errors.items()}
        each.append(found)
    return {key: float(np.mean([errors[key] for errors in each])) for key in each[0]}


def _with_contacts(setup: Setup, kinds: Sequence[str], separation: float) -> dict[str, float]:
    """Errors of `ekf` where contacts are held, or missed by a separation (m), between the pose and the same movement."""
    movement, held, begun = contacts.with_contacts(setup, kinds, separation)
    setup = replace(setup, duration=begun + DURATION - BEGUN)
    recording, true = write_and_load(setup, movement, held)
    moved = process(ekf, ekf.Params(), recording).trajectory
    return _errors(moved, true, begun, setup.duration)


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Mapping[str, float]]]) -> Finding:
    """One row a size and case."""
    rows = []
    for pose, case in product(POSES, [*CASES, *CONTACTS, *KNOWN]):
        of_pose = [found for trial, found in results if trial.pose == pose]
        given = [c for c in COLUMNS if of_pose and f"{case}: {c}" in of_pose[0]]
        rows.append(
            Row(
                f"{pose:g} deg, {case}",
                {c: spread(found[f"{case}: {c}"] for found in of_pose) for c in given},
            )
        )
    table = Table("Pose missed by, method", COLUMNS, tuple(rows), over="people")
    setting = (
        f"{wanted.seeds} people a row, simulated by validation/independent/simulator/free_movement.py, which shares no line with estimators/. Whole left hand with forearm, {DURATION:g} s, "
        f"every joint and the hand itself move at up to {PACE:g} Hz after a flat hand of which every freedom is missed by a normal error of that standard deviation. "
        "Sensors misaligned by 5 deg about each axis, skin 2 deg and 1 mm in 90 deg. All 23 freedoms and five tips; NEES: mean normalised error squared, 1 is honest. "
        f"Daily movements: {len(daily_movements.MOVEMENTS)} of {DAILY_DURATION:g} s each, from tapping to a hand that rests, errors averaged over them; known is what `map` found in the slow movement, of the same wearing. "
        "Contacts: between pose and movement, each held for 2 s; pads 3 mm beside each other (each axis), creases 4 mm beside where they are believed, a table tilted by 0.8 deg; "
        f"missed: {1e3 * AWAY:g} mm from there, up to that above the table.",
    )
    return Finding(
        "independent-pose", "What an inexact pose costs in another simulator", setting, (table,)
    )


def _errors(moved: Trajectory, true: Truth, begun: float, end: float) -> dict[str, float]:
    rows = np.flatnonzero((moved.t > begun) & (moved.t < end - 0.1))
    t, joints = moved.t[rows], list(true.angles)
    angles = _at(t, true.t, np.stack([true.angles[j] for j in joints], axis=1))
    tips = _at(t, true.t, np.stack([true.tips[f] for f in FINGERS], axis=1))
    k = [JOINT[j] for j in joints]
    off = angle_difference(moved.angles[rows][:, k], angles)
    off = np.where(IS_DOF[k], off, np.nan)
    missed = moved.tips[rows] - tips
    found = {
        "tips, cm": 100 * rms(np.linalg.norm(missed, axis=-1)),
        "angles, deg": float(np.degrees(rms(off[np.isfinite(off)]))),
    }
    if moved.angles_sd is not None and moved.tips_sd is not None:
        found["NEES angles"] = nees(off, moved.angles_sd[rows][:, k])
        found["NEES tips"] = nees(missed, moved.tips_sd[rows])
    return found


def _at(t: Array, known: Array, values: Array) -> Array:
    """Values (n, k, 3) interpolated to the instants t."""
    flat = values.reshape(len(known), -1)
    found = np.stack([np.interp(t, known, x) for x in flat.T], axis=1)
    return found.reshape(len(t), *values.shape[1:])
