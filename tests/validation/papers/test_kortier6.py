"""Kortier's chapter 6 again: ours is measured, the thesis' stands beside it."""

import numpy as np

from handscope.validation.papers import kortier6, published
from handscope.validation.papers.kortier6 import OBJECTS, RATES, Trial
from handscope.validation.reproduce import Wanted


def test_a_trial_tells_how_far_off_it_is_and_how_sure() -> None:
    found = kortier6.measure(Trial("0.28 kg", 3))
    assert set(found) == set(RATES)
    assert all(
        0 <= one["error"] < 15 and np.isfinite(one["honesty"]) and one["force"] < 1.0
        for one in found.values()
    )


def test_the_thesis_stands_beside_ours() -> None:
    trials = kortier6.trials(Wanted(seeds=8))
    assert len(trials) == len(OBJECTS) * 8
    figures = {"error": 4.0, "honesty": 1.0, "force": 0.1}
    found = kortier6.finding(Wanted(seeds=8), [(t, dict.fromkeys(RATES, figures)) for t in trials])
    assert {row.name: row.theirs["12 Hz"] for row in found.tables[0].rows} == {
        held: mean for held, (mean, _) in published.KORTIER_OBJECTS.items()
    }
    assert [v.met for v in found.verdicts] == [True] * 6
