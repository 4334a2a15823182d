"""Kortier's chapter 5: one trial gives all figures, the thesis' stand beside ours with four magnetometers only."""

import math

import pytest

from handscope.validation.papers import kortier5, published
from handscope.validation.papers.kortier5 import (
    LIMITS,
    MAGNETOMETERS,
    MOVEMENTS,
    SMOOTHED,
    WHAT,
    Trial,
)
from handscope.validation.reproduce import Wanted


@pytest.mark.slow
def test_one_trial_gives_every_figure_with_four_and_with_one() -> None:
    found = kortier5.measure(Trial("both", 0))
    assert set(found) == set(MAGNETOMETERS)
    assert all(math.isfinite(v) for figures in found.values() for v in figures.values())
    assert (
        found["four"][f"position{SMOOTHED}"] < found["four"]["position"] < 25.0
        and found["four"]["doubtful"] == 0.0
    )
    assert found["one"]["doubtful"] == 100.0


def test_the_thesis_stands_beside_ours() -> None:
    figures = {
        "position": 10.0,
        "relative": 3.0,
        "trunk": 5.0,
        "far": 10.0,
        "quiet": 10.0,
        "doubtful": 0.0,
        "back": 30.0,
    }
    figures |= {f"{what}{SMOOTHED}": 2.0 for what in LIMITS}
    figures |= {f"{what}{told}": 1.0 for what in WHAT for told in ("", SMOOTHED, ", as simulated")}
    trials = kortier5.trials(Wanted(seeds=2))
    found = kortier5.finding(
        Wanted(seeds=2), [(t, dict.fromkeys(MAGNETOMETERS, figures)) for t in trials]
    )
    assert len(trials) == 2 * len(MOVEMENTS)
    rows = {row.name: row for row in found.tables[0].rows}
    told = rows["both moving"]
    assert (told.theirs["four"], told.theirs_sd["four"]) == published.KORTIER_MAGNET["both"][
        "position"
    ]
    assert [v.met for v in found.verdicts] == [
        *(figures[name] <= limit for name, limit in LIMITS.items()),
        False,
    ]
