"""What a recording's movement is too little to test: said of a hand that lies still, of none that moves."""

from dataclasses import replace

import numpy as np

from handscope.estimators.data.samples import Block
from handscope.estimators.fault_detection.coverage import untested
from handscope.estimators.fault_detection.finding import Untested
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.simulation.scenario import Simulated
from tests.estimators.fault_detection.joint_recordings import amplified, delayed, freely_moved


def _asked(blocks: list[Block], **named: tuple[str, ...]) -> Untested:
    recording: Simulated = freely_moved()
    return untested(blocks, recording, (), named.get("named", ()))


def _at_rest() -> list[Block]:
    """The first reading again and again, with noise."""
    rng = np.random.default_rng(5)
    return [
        replace(b, values=b.values[:1] + 2e-3 * rng.standard_normal(b.values.shape))
        for b in freely_moved().blocks()
    ]


LAST = tuple(chain[-1] for chain in CHAINS.values())  # one joint tells of them, which lies near


def test_everything_is_tested_where_hand_and_fingers_move_but_turns_of_last_sensors() -> None:
    found = _asked(list(freely_moved().blocks()))
    assert replace(found, turns=()) == Untested()
    assert set(LAST) <= set(found.turns)
    assert not {chain[0] for chain in CHAINS.values()} & set(found.turns)


def test_a_gyroscope_that_has_the_gain_does_not_count_as_tested() -> None:
    found = _asked(amplified(freely_moved(), "ring_middle", 1.3))
    assert "ring_middle" in found.gyroscopes


def test_a_strip_that_is_late_does_not_count_as_tested() -> None:
    assert "ring" in _asked(delayed(freely_moved(), CHAINS["ring"], 0.2)).strips


def test_little_is_tested_where_nothing_moves() -> None:
    found = _asked(_at_rest())
    assert set(found.strips) == set(CHAINS)
    assert {s for chain in CHAINS.values() for s in chain} <= set(found.gyroscopes)
    assert set(found.fingers) == {*CHAINS} - {"thumb"}
    assert set(LAST) <= set(found.turns)
    assert [m.severity for m in found.messages] == ["info"] * 4


def test_sensors_of_which_something_is_found_are_left_out() -> None:
    found = _asked(_at_rest(), named=CHAINS["ring"])
    assert "ring" not in found.strips + found.fingers
    assert not set(CHAINS["ring"]) & set(found.gyroscopes)


def test_a_trunk_s_sensor_that_rests_has_no_neighbour_to_be_compared_with() -> None:
    still = _at_rest()[0]
    of_trunk = replace(still.stream, name="trunk", sensors=("trunk",))
    blocks = [*freely_moved().blocks(), replace(still, stream=of_trunk, values=still.values[:, :1])]
    found = _asked(blocks)
    assert replace(found, turns=()) == Untested(("trunk",))
    assert "trunk" not in found.turns
