"""How sure an estimate says it is against how far it is off, in many worlds."""

import numpy as np
import pytest

from handscope.validation.independent import worlds as independent_worlds
from handscope.validation.reproduce import Wanted
from handscope.validation.reproduce.finding import Row, spread
from handscope.validation.studies import honesty
from handscope.validation.studies.honesty import CLAIMED, COLUMNS, OTHER, Cell
from handscope.validation.studies.worlds import SOURCES, WORLDS


def test_a_cell_is_within_its_bounds_or_told_with_what_lies_outside() -> None:
    good = Row("well", {c: spread([95.0 if "95" in c else 1.0]) for c in COLUMNS})
    ours = {**good.ours, "NEES tips": spread([1.4, 1.7]), "tips within 95 %": spread([80.0])}
    said = honesty.standing((good, Row("badly", ours)), CLAIMED)
    assert said.endswith("in 1 of 2 worlds; outside: badly (NEES tips 1.55, tips within 95 % 80).")
    assert honesty.standing((good,), CLAIMED).endswith("in 1 of 1 worlds.")


def test_a_normal_error_is_covered_as_often_as_its_interval_says() -> None:
    error = np.random.default_rng(0).normal(size=(20_000, 2))
    sd = np.ones_like(error)
    sd[0], error[1] = np.nan, np.nan  # not known: not counted
    assert honesty.coverage(error, sd) == pytest.approx(95.0, abs=0.5)


def test_every_source_of_errors_is_halved_and_doubled_and_nothing_else_changes() -> None:
    usual = WORLDS["as believed"]
    for source, names in SOURCES.items():
        half, double = (WORLDS[f"{source} x {times}"].errors for times in ("0.5", "2"))
        for name in names:
            size = getattr(usual.errors, name)
            assert (getattr(half, name), getattr(double, name)) == (0.5 * size, 2 * size)
        changed = [
            n
            for n in usual.errors.__dataclass_fields__
            if getattr(half, n) != getattr(usual.errors, n)
        ]
        assert sorted(changed) == sorted(names)
    all_halved = WORLDS["all sources x 0.5"]
    assert all_halved.person.pose_deg == 1.0
    assert all_halved.person.anatomy.ratio == 0.5 * usual.person.anatomy.ratio


def test_worlds_that_are_named_are_the_only_ones() -> None:
    cells = honesty.trials(Wanted(seeds=2, experiments=("skin sticking", f"as believed, {OTHER}")))
    assert {c.name for c in cells} == {"skin sticking", f"as believed, {OTHER}"}
    assert len(cells) == 2 * len(honesty.EXPERIMENTS) + 2


@pytest.mark.parametrize(
    "cell", [Cell("skin delayed", "tapping", 3), Cell("as believed", OTHER, 3)]
)
def test_a_trial_tells_every_column_of_both_methods(cell: Cell) -> None:
    found = honesty.measure(cell)
    assert set(found) == {f"{m}, {c}" for m in honesty.JUDGED_METHODS for c in COLUMNS}
    assert found["m2, NEES angles"] != found["ekf, NEES angles"]
    finding = honesty.finding(Wanted(seeds=1), [(cell, found)])
    assert [t.title.split(",")[0] for t in finding.tables] == ["ekf", "m2"]


def test_another_simulators_angles_have_no_value_where_a_joint_has_no_freedom() -> None:
    judged = independent_worlds.recorded("as believed", 1)
    assert np.isfinite(judged.angles).all(axis=0).sum() == 23
    assert np.isfinite(judged.tips).all()
