"""Contacts tell `map` how the hand's sensor and those of the last phalanges sit, which no movement shows."""

from collections.abc import Callable, Mapping
from functools import cache, partial

import numpy as np
import pytest

from handscope.estimators.data.held_contact import held_contacts
from handscope.estimators.hand.anatomy import (
    JOINT,
    SEGMENT,
)
from handscope.estimators.hand.geometry import HandGeometry, sized
from handscope.estimators.methods import map_contacts, map_unobserved
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.self_calibration.uncertainty import monte_carlo
from handscope.estimators.simulation.movements import (
    task_performance,
    touched_fingertips,
    touched_surfaces,
)
from handscope.estimators.simulation.movements.task_performance import Performance
from handscope.estimators.simulation.scenario import Simulated, simulate_performances
from handscope.estimators.simulation.sensors import IDEAL
from tests.estimators.methods.solved_hands import PARAMS, SD, calibrated, off, solved, turned

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
INEXACT: tuple[Touch, ...] = (
    touched_fingertips.touch_fingertips,
    touched_surfaces.fingertips_on_table,
    touched_surfaces.fingertips_on_palm,
)


@cache
def recorded(*touches: Touch) -> Simulated:
    geometry = sized("left")
    performances = (
        *(touch(geometry, np.random.default_rng(3)) for touch in touches),
        task_performance.tapping(geometry),
    )
    return simulate_performances(performances, "left", geometry, np.random.default_rng(4), IDEAL)


@pytest.mark.parametrize("kind", EXACT)
def test_contacts_tell_how_the_hands_sensor_sits(kind: str) -> None:
    recording = recorded(EXACT[kind])
    hand = np.radians([2.0, -1.0, 4.0])
    moved = turned(recording.truth, hand, {"index": 0.05, "thumb": -0.04})
    before, held = solved(moved), held_contacts(recording.events)
    found = map_contacts.apply(PARAMS, moved, calibrated(recording.geometry), before, held)
    assert [o.outcome for o in found.outcomes] == len(held) * ["used"]
    assert off(found.fingers, recording.truth) < 0.8 * off(before, recording.truth)
    first = {"thumb": "thumb_cmc", "forearm": "wrist"}
    for old, new in zip(before, found.fingers):
        j = JOINT[first.get(new.name, f"{new.name}_mcp")]
        assert (new.sure.angles[:, j, 0] < old.sure.angles[:, j, 0]).all()
        assert new.sure.q_BS["hand"][2] < old.sure.q_BS["hand"][2]


@pytest.mark.parametrize("kind", MISSED)
def test_contacts_that_did_not_happen_pull_nothing(kind: str) -> None:
    recording = recorded(MISSED[kind])
    moved = turned(recording.truth, np.radians([1.0, 1.0, 2.0]), {})
    before, held = solved(moved), held_contacts(recording.events)
    found = map_contacts.apply(PARAMS, moved, calibrated(recording.geometry), before, held)
    assert {o.outcome for o in found.outcomes} == {"missed"}
    for old, new in zip(before, found.fingers):
        np.testing.assert_array_equal(new.segments.q_BS["hand"], old.segments.q_BS["hand"])
        np.testing.assert_allclose(new.sure.angles, old.sure.angles)
    assert found.geometry.lengths == recording.geometry.lengths


def test_draws_follow_what_contacts_leave_open() -> None:
    """24 draws scatter by chance: what contacts tell is a share of their errors, no difference from their standard deviation."""
    hand, last = slice(0, 3), map_unobserved.columns_of("ring").start
    before = np.diag(np.full(map_unobserved.COUNT, SD**2))
    after = before.copy()
    after[2, 2], after[last, last] = (0.3 * SD) ** 2, (0.7 * SD) ** 2
    numbers = monte_carlo.mounting_numbers()
    was = {
        "hand": SD * numbers[:, SEGMENT["hand"]],
        "ring": SD * numbers[:, SEGMENT["ring_distal"], 2],
    }
    changes = map_unobserved.draw_changes(PARAMS, before, after)
    np.testing.assert_allclose(was["hand"] + changes[:, hand], was["hand"] * [1.0, 1.0, 0.3])
    np.testing.assert_allclose(was["ring"] + changes[:, last], 0.7 * was["ring"])
    assert not map_unobserved.draw_changes(PARAMS, before, before).round(12).any()


def test_a_contact_that_did_not_happen_is_refused_by_those_after_it() -> None:
    """Alone the first would be believed: the hand's sensor sits worse than usual."""
    missed = partial(touched_fingertips.touch_fingertips, missed=0.04)
    recording = recorded(missed, EXACT["table"], EXACT["palm"])
    moved = turned(recording.truth, np.radians([-14.0, -9.0, -1.0]), {})
    held, before = held_contacts(recording.events), solved(moved)
    false, true = held[:4], held[4:]
    alone, together = (
        map_contacts.apply(PARAMS, moved, calibrated(recording.geometry), before, contacts)
        for contacts in (true, held)
    )
    assert [o.used for o in together.outcomes] == [False] * len(false) + [True] * len(true)
    for a, b in zip(alone.fingers, together.fingers):
        off = quat.log(quat.relative(a.segments.q_BS["hand"], b.segments.q_BS["hand"]))
        assert np.linalg.norm(off) < np.radians(0.1)
