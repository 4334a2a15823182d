"""The hand's place in a live station: followed tick by tick, told in millimetres, with the reason where it cannot be."""

from dataclasses import replace

import numpy as np
import pytest

from handscope.app.live.readouts.hand_position import HandPositionReadout
from handscope.estimators.hand.geometry import sized
from handscope.estimators.magnet.pipeline.hand_position import PlaceParams
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.simulation.movements import task_performance
from handscope.estimators.simulation.scenario import InertialGlove, Simulated, simulate_performances
from handscope.estimators.simulation.sensors import IDEAL
from handscope.estimators.simulation.trunk import TrunkGlove


@pytest.fixture(scope="module")
def made() -> Simulated:
    hand = sized("left")
    return simulate_performances(
        [task_performance.initial_pose(hand, 4.0)],
        "left",
        hand,
        np.random.default_rng(2),
        IDEAL,
        glove=InertialGlove(segments=("hand",)),
        on_trunk=TrunkGlove(),
    )


def _readout(made: Simulated, **change: object) -> HandPositionReadout:
    """A glove's blocks of 0.1 s, a tick after each."""
    readout = HandPositionReadout(PlaceParams())
    assert made.plate is not None
    plate = replace(made.plate, **change)  # type: ignore[arg-type]
    for k in range(40):
        readout.feed(
            [b.between(0.1 * k - 1e-6, 0.1 * (k + 1) - 1e-6) for b in made.samples.values()]
        )
        readout.advance(plate, made.streams, made.mounting)
    return readout


def test_a_resting_hand_is_told_where_it_is_with_how_sure_that_is(made: Simulated) -> None:
    payload = _readout(made).to_json()
    assert payload is not None and made.truth.place is not None
    true = 1e3 * made.truth.place[-10]
    np.testing.assert_allclose(payload["mm"], true, atol=15)
    assert payload["distance_mm"] == pytest.approx(np.linalg.norm(true), abs=15)
    assert 1 <= payload["sd_mm"] <= 15
    assert payload["doubts"] == [] and payload["reason"] == ""


def test_places_in_another_unit_are_said_and_nothing_is_told(made: Simulated) -> None:
    assert made.plate is not None
    payload = _readout(
        made,
        places={name: (1e3 * x, 1e3 * y, 1e3 * z) for name, (x, y, z) in made.plate.places.items()},
    ).to_json()
    assert (
        payload is not None
        and "were these millimetres or centimetres" in payload["reason"]
        and "mm" not in payload
    )


def test_a_glove_without_a_trunk_tells_nothing() -> None:
    readout = HandPositionReadout()
    readout.advance(None, (), {"hand": quat.IDENTITY})
    assert readout.to_json() is None
