"""Kortier's chapter 4: the thesis' figures stand beside ours, and what is to be reached is judged."""

from handscope.validation.papers import kortier4, published
from handscope.validation.papers.kortier4 import CONDITIONS, PLACES, Found, Trial
from handscope.validation.reproduce import Wanted

NAMES = (*(f"distance, {p}" for p in PLACES), "length, proximal", "length, middle")


def found(percent: float, converged: bool = True) -> Found:
    bound = {"proximal": 0.1, "middle": 0.2}
    return Found(
        converged,
        dict.fromkeys(NAMES, percent),
        {"proximal": 1.0, "middle": -1.0},
        bound,
        3.0,
        2.0,
        0.5,
        0.4,
        9.0,
    )


def test_fifteen_trials_of_each_kind_at_most() -> None:
    assert len(kortier4.trials(Wanted(seeds=20))) == 15 * len(CONDITIONS)
    assert len(kortier4.trials(Wanted(seeds=2))) == 2 * len(CONDITIONS)


def test_the_thesis_stands_beside_ours_and_targets_are_judged() -> None:
    results = [
        (Trial(c, seed), found(-0.3 if c == "white noise" else 1.5, seed == 0))
        for c in CONDITIONS
        for seed in (0, 1)
    ]
    told = kortier4.finding(Wanted(seeds=2), results)
    rows = {row.name: row for row in told.tables[0].rows}
    assert (
        rows["distance, proximal"].theirs["skin motion"]
        == published.KORTIER_FINGER["distance, proximal"][0]
    )
    assert (
        rows["distance, proximal"].theirs_sd["skin motion"]
        == published.KORTIER_FINGER["distance, proximal"][1]
    )
    assert rows["length, middle"].ours["white noise"].mean == -0.3
    met = {v.what: v.met for v in told.verdicts}
    assert not met["white noise: largest error of a length"]
    assert met["skin motion: largest mean error of a distance or length"]
    assert "white noise: 1 of 2 trials converged from a cold start." in told.remarks
    assert any(
        s.startswith("skin motion: errors of lengths are 1.0 of their standard deviations")
        for s in told.remarks
    )
    assert any(
        "proximal phalanx is 0.10 %" in s
        and "our error 0.30 %" in s
        and "within 0.2 % in 95 % of trials, ours was in 0 %" in s
        for s in told.remarks
    )
    assert any("probability of about 42 %" in s for s in told.remarks), (
        "0.954 and 0.683, each twice"
    )
