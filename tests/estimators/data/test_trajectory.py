"""Pieces of a trajectory: cut, turned round and joined again."""

import numpy as np

from handscope.estimators.data import trajectory
from handscope.estimators.simulation.scenario import Simulated
from tests.simulated import assert_same


def test_pieces_join_to_the_whole(simulated: Simulated) -> None:
    truth = simulated.truth
    pieces = [
        truth.between(-np.inf, 3.0),
        trajectory.empty(truth.hand),
        truth.between(3.0, 3.0),
        truth.between(3.0, np.inf),
    ]
    assert len(pieces[0]) == np.searchsorted(truth.t, 3.0)
    assert_same(trajectory.join(pieces, truth.hand), truth)


def test_turned_round_twice_is_the_same(simulated: Simulated) -> None:
    assert_same(simulated.truth.reversed().reversed(), simulated.truth)
    assert simulated.truth.reversed().t[0] == simulated.truth.t[-1]


def test_nothing_joined_is_empty() -> None:
    nothing = trajectory.join([], "right")
    assert len(nothing) == 0
    assert nothing.hand == "right"
    assert_same(nothing.between(0, 1), trajectory.empty("right"))


def test_standard_deviations_survive_only_where_every_piece_has_them(simulated: Simulated) -> None:
    known = trajectory.Trajectory(
        **{**vars(simulated.truth), "tips_sd": np.ones_like(simulated.truth.tips)}
    )
    assert trajectory.join([known, known], known.hand).tips_sd is not None
    assert trajectory.join([known, simulated.truth], known.hand).tips_sd is None
    part = known.between(0, 1)
    assert part.tips_sd is not None
    assert len(part.tips_sd) == len(part)
