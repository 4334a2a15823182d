"""How sure an estimate says it is against how far it is off."""

import pytest

from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.experiments import Trial
from handscope.validation.studies import honesty


@pytest.mark.parametrize(
    ("squares", "said"),
    [
        ((0.80, 0.82, 0.81, 0.79), "0.81 ± 0.01 (95 %), standard deviations 11% too large"),
        ((1.55, 1.60, 1.50, 1.59), "1.56 ± 0.04 (95 %), standard deviations 20% too small"),
        (
            (0.70, 1.30, 0.80, 1.10),
            "0.97 ± 0.27 (95 %), standard deviations as large as the errors",
        ),
    ],
)
def test_squared_errors_over_variances_are_told_with_their_bounds(
    squares: tuple[float, ...], said: str
) -> None:
    results = [
        (Trial("free", seed), dict.fromkeys(honesty.COLUMNS, value))
        for seed, value in enumerate(squares)
    ]
    others = [
        (Trial(name, seed), found)
        for name in ("AF-F2", "tapping")
        for (_, found), seed in zip(results, range(4))
    ]
    finding = honesty.finding(Wanted(seeds=4), results + others)
    assert said.split(",")[1] in finding.remarks[0]
    (row,) = (row for row in finding.tables[0].rows if row.name == "free")
    assert honesty.bounds(row.ours[honesty.COLUMNS[0]]) == said


def test_a_trial_tells_every_column() -> None:
    found = honesty.measure(Trial("free", 3))
    assert set(found) == set(honesty.COLUMNS)
    assert (
        found["angles, as simulated"] > found["angles, exact hinges"]
    )  # smaller sizes, smaller standard deviations
