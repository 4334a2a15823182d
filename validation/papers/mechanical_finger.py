"""A mechanical finger whose joints go one by one to 90 deg and back: does an angle stay while others move? Valtin 2017, Fig. 4."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from handscope.app.report.units import DEG
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import FINGER_JOINTS, FLEXION, JOINT
from handscope.estimators.numerics.typing import Array
from handscope.estimators.simulation.sensors import SensorErrors
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.experiments import (
    Trial,
    estimated,
    performed,
    simulated_setting,
)
from handscope.validation.reproduce.figures import Line, lines
from handscope.validation.reproduce.finding import Finding, Row, Table, spread

# no skin; full scales of the paper
RIGID = SensorErrors(skin_angle=0.0, skin_shift=0.0, gyr_range=1000.0, acc_range=4.0)
ALIGNED = SensorErrors(
    skin_angle=0.0,
    skin_shift=0.0,
    gyr_range=1000.0,
    acc_range=4.0,
    misalignment=0.0,
    misalignment_width=0.0,
)
MOUNTINGS = {"aligned": ALIGNED, "misaligned": RIGID}
METHODS = ("b", "m1", "m2")
JOINTS = FINGER_JOINTS["index"]
STILL = np.radians(0.1)  # rad/s: a joint that turns less stays where it is
THIN = 10  # of the samples every tenth is drawn


@dataclass(frozen=True)
class Moved:
    """Largest deviation (deg) by mounting, method and joint; the curves of m2 where they are drawn."""

    largest: Mapping[tuple[str, str], Sequence[float]]
    t: Array | None = None
    angles: Array | None = None  # (n, joints) deg


def trials(wanted: Wanted) -> Sequence[Trial]:
    """The trials that a reproduction of this size runs."""
    return [Trial("mechanical finger", seed) for seed in range(wanted.seeds)]


def measure(trial: Trial) -> Moved:
    """All mountings and methods; of the first seed the curves, too."""
    largest, curves = {}, None
    for mounting, errors in MOUNTINGS.items():
        recording = performed(trial, errors, pose_error=0.0)
        for method in METHODS:
            estimate, truth = estimated(recording, method)
            largest[mounting, method] = [DEG * x for x in held_deviation(estimate, truth)]
            curves = (
                estimate if (mounting, method, trial.seed) == ("misaligned", "m2", 0) else curves
            )
    if curves is None:
        return Moved(largest)
    return Moved(largest, curves.t[::THIN] - curves.t[0], DEG * _flexions(curves)[::THIN])


def held_deviation(estimate: Trajectory, truth: Trajectory) -> list[float]:
    """Of each joint the largest error in rad while it stays and another one moves."""
    rates = np.abs(np.gradient(_flexions(truth), truth.t, axis=0))
    error = np.abs(_flexions(estimate) - _flexions(truth))
    moving = rates > STILL
    return [float(error[~moving[:, k] & moving.any(axis=1), k].max()) for k in range(len(JOINTS))]


def finding(wanted: Wanted, results: Sequence[tuple[Trial, Moved]]) -> Finding:
    """The tables, ours beside the published ones, with remarks."""
    columns = tuple(f"{method}, {mounting}" for mounting, method in product(MOUNTINGS, METHODS))
    rows = []
    for k, joint in enumerate(JOINTS):
        ours = {
            f"{method}, {mounting}": spread(
                found.largest[mounting, method][k] for _, found in results
            )
            for mounting in MOUNTINGS
            for method in METHODS
        }
        rows.append(Row(joint.removeprefix("index_").upper(), ours))
    table = Table(
        "Largest deviation of a joint's flexion while it stays and another one moves, deg",
        columns,
        tuple(rows),
        head="joint",
        digits=1,
    )
    drawn = next(found for _, found in results if found.angles is not None)
    assert drawn.t is not None and drawn.angles is not None
    curves = [
        Line(joint.removeprefix("index_").upper(), drawn.t, drawn.angles[:, k])
        for k, joint in enumerate(JOINTS)
    ]
    figures = {
        "reproduce-mechanical-finger.svg": lines(
            [curves], ("Flexion in deg over time in s",), (0.0, 90.0)
        )
    }
    worst = max(row.ours["m2, aligned"].worst for row in rows)
    remarks = (
        "The paper gives no number: it says of its Fig. 4 that the DIP angle `remains close to 90 deg` while the other joints move.",
        f"m2 with aligned sensors: no joint deviates by more than {worst:.1f} deg in any seed.",
    )
    title = "One joint after the other (Valtin 2017, Fig. 4)"
    return Finding(
        "mechanical-finger", title, _setting(), (table,), remarks=remarks, figures=figures
    )


def _flexions(trajectory: Trajectory) -> Array:
    return np.asarray(trajectory.angles[:, [JOINT[joint] for joint in JOINTS], FLEXION])


def _setting() -> tuple[str, ...]:
    return (
        "DIP, then PIP, then MCP to 90 deg, and back in reverse order. The finger is rigid and straight in the initial pose: no soft tissue, no missed "
        "pose; full scales as in the paper (4 g, 1000 deg/s). `aligned`: sensors along the anatomical axes, as the paper's were; `misaligned`: 5 to 10 deg off. "
        "The figure shows m2 with misaligned sensors, seed 0. Else as follows, but for soft tissue and pose.",
        *simulated_setting(False),
    )
