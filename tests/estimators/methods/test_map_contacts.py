"""Contacts tell `map` how the hand's sensor and those of the last phalanges sit, which no movement shows."""

from collections.abc import Callable, Mapping
from functools import cache, partial
from types import SimpleNamespace

import numpy as np
import pytest

from handscope.estimators.alignment import initial_pose
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.held_contact import held_contacts
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.anatomy import CHAINS, FINGERS, IS_DOF, JOINT, SEGMENT
from handscope.estimators.hand.geometry import HandGeometry, sized
from handscope.estimators.methods import map_contacts
from handscope.estimators.methods.map_options import Params
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from handscope.estimators.self_calibration.result import Finger
from handscope.estimators.self_calibration.segments import Segments
from handscope.estimators.self_calibration.uncertainty.monte_carlo import Uncertainty
from handscope.estimators.simulation.movements import (
    task_performance,
    touched_fingertips,
    touched_surfaces,
)
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.scenario import Simulated, simulate_performances
from handscope.estimators.simulation.sensors import IDEAL

Touch = Callable[[HandGeometry, np.random.Generator], Performance]
EXACT: Mapping[str, Touch] = {
    "fingertips": partial(touched_fingertips.touch_fingertips, place_sd=0.0),
    "table": partial(touched_surfaces.fingertips_on_table, pulp_sd=0.0, tilt_sd=0.0),
    "palm": partial(touched_surfaces.fingertips_on_palm, mark_sd=0.0, place_sd=0.0),
}
MISSED: Mapping[str, Touch] = {
    "fingertips": partial(touched_fingertips.touch_fingertips, missed=0.06),
    "palm": partial(touched_surfaces.fingertips_on_palm, missed=0.06),
}
PARAMS = Params()
SD = np.radians(PARAMS.mounting)


@cache
def recorded(touch: Touch) -> Simulated:
    geometry = sized("left")
    performances = (touch(geometry, np.random.default_rng(3)), task_performance.tapping(geometry))
    return simulate_performances(performances, "left", geometry, np.random.default_rng(4), IDEAL)


def turned(truth: Trajectory, hand: Array, last: Mapping[str, float]) -> Trajectory:
    """The movement as sensors show it that sit otherwise than believed: the hand's by `hand` (3,), last phalanges' about z (rad)."""
    q_GS = truth.q_GS.copy()
    turns = {"hand": hand, **{CHAINS[f][-1]: a * map_contacts.Z for f, a in last.items()}}
    for name, turn in turns.items():
        q_GS[:, SEGMENT[name]] = quat.multiply(q_GS[:, SEGMENT[name]], quat.exp(turn))
    return Trajectory(
        truth.hand, truth.t, truth.angles, q_GS, truth.tips, np.zeros(q_GS.shape[:2], np.uint8)
    )


def solved(moved: Trajectory) -> list[Finger]:
    """Fingers as if self-calibration had found this movement."""
    rows = np.arange(0, len(moved), 50)
    fingers = []
    for finger in FINGERS:
        names = ("hand", *CHAINS[finger])
        own = [j for j in JOINT if j.startswith(finger)]
        angles = np.full((len(rows), *IS_DOF.shape), np.nan)
        angles[:, [JOINT[j] for j in own]] = SD
        sure = Uncertainty(
            {n: np.full(3, SD) for n in ("hand", names[-1])},
            {},
            rows,
            angles,
            np.full((len(rows), 3), 0.01),
        )
        segments = Segments(
            dict.fromkeys(names, quat.IDENTITY),
            {n: np.zeros(3) for n in names},
            {},
            {},
            {n: moved.q_GS[:, SEGMENT[n]] for n in names},
        )
        fingers.append(Finger(finger, moved.t, SimpleNamespace(), segments, sure))  # type: ignore[arg-type]
    return fingers


def calibrated(recording: Simulated) -> Calibration:
    return initial_pose.uncalibrated("left", recording.geometry, {}, ["hand"], 0.0)


def off(fingers: list[Finger], truth: Trajectory) -> float:
    """How far phalanges are turned against the hand, rad, root mean square."""
    squares = []
    for f in fingers:
        q_GB = f.segments.q_GB
        for name in CHAINS[f.name]:
            believed = quat.relative(q_GB["hand"], q_GB[name])
            true = quat.relative(truth.q_GS[:, SEGMENT["hand"]], truth.q_GS[:, SEGMENT[name]])
            squares.append((quat.log(quat.relative(believed, true)) ** 2).sum(axis=-1))
    return float(np.sqrt(np.mean(squares)))


@pytest.mark.parametrize("kind", EXACT)
def test_contacts_tell_how_the_hands_sensor_sits(kind: str) -> None:
    recording = recorded(EXACT[kind])
    hand = np.radians([2.0, -1.0, 4.0])
    moved = turned(recording.truth, hand, {"index": 0.05, "thumb": -0.04})
    before, held = solved(moved), held_contacts(recording.events)
    found = map_contacts.apply(PARAMS, moved, calibrated(recording), before, held)
    assert [o.outcome for o in found.outcomes] == len(held) * ["used"]
    assert off(found.fingers, recording.truth) < 0.8 * off(before, recording.truth)
    for old, new in zip(before, found.fingers):
        j = JOINT["thumb_cmc" if new.name == "thumb" else f"{new.name}_mcp"]
        assert (new.sure.angles[:, j, 0] < old.sure.angles[:, j, 0]).all()
        assert new.sure.q_BS["hand"][2] < old.sure.q_BS["hand"][2]


@pytest.mark.parametrize("kind", MISSED)
def test_contacts_that_did_not_happen_pull_nothing(kind: str) -> None:
    recording = recorded(MISSED[kind])
    moved = turned(recording.truth, np.radians([1.0, 1.0, 2.0]), {})
    before, held = solved(moved), held_contacts(recording.events)
    found = map_contacts.apply(PARAMS, moved, calibrated(recording), before, held)
    assert {o.outcome for o in found.outcomes} == {"missed"}
    for old, new in zip(before, found.fingers):
        np.testing.assert_array_equal(new.segments.q_BS["hand"], old.segments.q_BS["hand"])
        np.testing.assert_allclose(new.sure.angles, old.sure.angles)
    assert found.geometry.lengths == recording.geometry.lengths
