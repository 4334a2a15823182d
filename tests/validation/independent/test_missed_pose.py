"""The pose that a simulator of its own lets people miss."""

import numpy as np
import pytest

from handscope.validation.independent import missed_pose
from handscope.validation.independent.missed_pose import Trial
from handscope.validation.independent.simulator import contacts, daily_movements, free_movement
from handscope.validation.independent.simulator.free_movement import (
    BEGUN,
    CHAINS,
    DEG,
    POSED,
    Setup,
)
from handscope.validation.reproduce import Wanted


def test_the_pose_is_held_palm_down_and_missed_and_then_the_movement_is_the_free_one() -> None:
    free, posed = (
        free_movement._movement(Setup(3, fingers=("index", "thumb"), missed=missed))
        for missed in (None, 2.5 * DEG)
    )
    held, moving = np.array([0.5, POSED - 0.1]), np.array([BEGUN + 1.0, 20.0])
    at = posed.angles["index"](held)
    np.testing.assert_array_equal(at[0], at[1])
    assert 0.5 * DEG < np.abs(at[0]).max() < 10 * DEG and not at[:, 1:, 1:].any()
    dorsal = posed.turns(held)[:, :, 0]
    np.testing.assert_allclose(dorsal, np.tile([0.0, 0.0, 1.0], (2, 1)), atol=1e-12)
    for finger in ("index", "thumb"):
        np.testing.assert_allclose(
            posed.angles[finger](moving), free.angles[finger](moving), atol=1e-12
        )


@pytest.mark.slow
def test_what_is_inferred_of_the_pose_helps_people_of_another_simulator(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in set(daily_movements.MOVEMENTS) - {"tapping"}:
        monkeypatch.delitem(daily_movements.MOVEMENTS, name)
    measured = missed_pose.measure(Trial(2.5, 0))
    for what in ("angles, deg", "tips, cm"):
        assert measured[f"ekf: {what}"] < measured[f"ekf, pose taken as held: {what}"]
    for case in ("ekf", missed_pose.DAILY):
        assert 0.3 < measured[f"{case}: NEES angles"] < 2.5
    daily, lengths, mountings = missed_pose.KNOWN
    assert measured[f"{lengths}: tips, cm"] < measured[f"{daily}: tips, cm"]
    assert measured[f"{lengths}: angles, deg"] == pytest.approx(measured[f"{daily}: angles, deg"])
    assert measured[f"{mountings}: angles, deg"] < measured[f"{daily}: angles, deg"]
    table = missed_pose.finding(Wanted(seeds=1), [(Trial(2.5, 0), measured)]).tables[0]
    assert [row.name for row in table.rows[:3]] == [f"2.5 deg, {c}" for c in missed_pose.CASES]


def test_contacts_are_held_still_before_the_same_free_movement() -> None:
    setup = Setup(3, fingers=tuple(CHAINS), forearm=True, missed=2.5 * DEG)
    plain = free_movement._movement(setup)
    moved, held, begun = contacts.with_contacts(setup, ("thumb on fingertips", "table", "palm"))
    assert len(held) == 10
    later, shift = np.array([1.0, 20.0]), begun - BEGUN
    for finger in CHAINS:
        for h in held:
            first, last = moved.angles[finger](np.array([h.onset, h.end]))
            np.testing.assert_allclose(first, last, atol=1e-9)
        np.testing.assert_allclose(
            moved.angles[finger](begun + later), plain.angles[finger](begun + later - shift)
        )
        (before,) = moved.angles[finger](np.array([1.0])) - plain.angles[finger](np.array([1.0]))
        assert not before.any()
