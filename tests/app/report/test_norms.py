"""Norms: every one has a source, a figure that it belongs to and that figure's unit."""

import pytest

from handscope.app.report.norms import norm_of, norms, published_changes
from handscope.app.report.references import smallest_change, smallest_change_of_rate
from handscope.app.report.units import reading
from handscope.estimators.measures import MEASURES
from handscope.estimators.measures.figure import Kind

KINDS: dict[str, list[Kind]] = {}
for _module in MEASURES.values():
    for _what, _kind in _module.KINDS.items():
        KINDS.setdefault(_what, []).append(_kind)


def test_every_norm_belongs_to_a_figure_is_in_its_unit_and_names_its_source() -> None:
    for n in [*norms(), *published_changes().values()]:
        assert n.source.name
        assert len(n.source.reference) > 20
        assert n.unit in {reading(k.of(1.0)).unit for k in KINDS[n.what]}, n


def test_a_mean_lies_between_its_bounds() -> None:
    for n in norms():
        assert (n.low is None or n.low <= n.mean) and (n.high is None or n.mean <= n.high), n


def test_a_norm_is_found_by_figure_part_and_task() -> None:
    spread = norm_of("spread", "ring_little")
    assert spread is not None
    assert (spread.mean, spread.sd, spread.source.name) == (32.1, 7.0, "Chatzioglou 2024")
    assert norm_of("spread", "thumb_index") is None
    assert norm_of("contact_error_rmse", "thumb_middle", "selfcheck_p4").mean == 12  # type: ignore[union-attr]
    assert norm_of("contact_error_rmse", "thumb_middle", "another") is None
    assert norm_of("pronation", "thumb_cmc") is None  # that of the forearm is another pronation


def test_published_changes_agree_with_those_that_stand_alone() -> None:
    assert published_changes()["tapping_rate"].value == smallest_change_of_rate().value  # type: ignore[union-attr]
    assert published_changes()["tam"].value == pytest.approx(
        3**0.5 * smallest_change().value, abs=0.5
    )  # type: ignore[union-attr]


def test_no_norm_and_no_category_is_a_score_of_the_updrs() -> None:
    assert not [
        what
        for what in KINDS
        if "updrs" in what.lower() or (what.endswith("_score") and what != "kapandji_score")
    ]
