"""Ours beside theirs: who is below whom, and how it is written down."""

import json

import pytest

from handscope.validation.reproduce.finding import (
    Finding,
    Row,
    Spread,
    Table,
    Verdict,
    as_json,
    at_or_below,
    spread,
    standing,
)
from handscope.validation.reproduce.layout import as_markdown, as_page, as_text

TABLE = Table(
    "RMSE, cm",
    ("m1", "m2"),
    (
        Row("A", {"m1": spread([3.0, 5.0]), "m2": spread([0.5, 0.7])}, {"m1": 2.2, "m2": 0.6}),
        Row("B", {"m2": spread([1.0, 1.2])}, {"m2": 1.0}),
        Row("C", {"m1": spread([1.0]), "m2": spread([9.0])}),
    ),
    "m2",
    "experiment",
)
MISSED = Verdict("tip", 0.9, 0.8, "cm", "our target")
FINDING = Finding(
    "table", "A table", ("As it was.",), (TABLE,), (MISSED,), ("So it is.",), {"a.svg": "<svg/>"}
)


def test_a_spread_is_mean_standard_deviation_and_largest() -> None:
    found = spread([1.0, 2.0, 6.0])
    assert (found.mean, found.worst, found.count) == (3.0, 6.0, 3)
    assert found.sd == pytest.approx(2.6457513)
    assert spread([2.0]) == Spread(2.0, 0.0, 2.0, 1)
    assert spread([-3.0, 1.0]).worst == -3.0  # an error may have a sign
    with pytest.raises(AssertionError):
        spread([1.0, float("nan")])


def test_a_mean_above_the_papers_is_said_to_be_above() -> None:
    assert [at_or_below(row, "m2") for row in TABLE.rows] == [True, False, None]
    assert (
        standing(TABLE, "our mean is")
        == "our mean is at or below the paper's in 1 of 2 rows; above it in B (1.100 against 1)."
    )
    assert "ABOVE" in MISSED.words


def test_text_has_every_figure_with_the_papers_beside_it() -> None:
    text = as_text(FINDING)
    row = next(line for line in text.splitlines() if line.startswith("A  "))
    assert row.split()[1:] == [
        "4.00",
        "±",
        "1.41",
        "(5.00)",
        "2.2",
        "0.60",
        "±",
        "0.14",
        "(0.70)",
        "0.6",
        "yes",
    ]
    assert next(line for line in text.splitlines() if line.startswith("B  ")).endswith("NO")
    assert "tip: 0.90 cm, ABOVE 0.80 cm (our target)" in text


def test_a_page_has_its_title_who_wrote_it_and_its_tables() -> None:
    page = as_page(as_markdown(FINDING, "images"), "Written by somebody.")
    assert page.startswith("# A table\n\n*Written by somebody.*\n\n")
    assert "![A table](images/a.svg)" in page
    assert ".svg" not in as_markdown(FINDING, None)
    assert "| A | 4.00 ± 1.41 (5.00) | 2.2 |" in page


def test_the_figures_as_json_say_what_is_met() -> None:
    plain = json.loads(json.dumps(as_json(FINDING)))
    assert plain["verdicts"][0]["met"] is False
    assert [row["at_or_below"] for row in plain["tables"][0]["rows"]] == [True, False, None]
    assert plain["tables"][0]["rows"][0]["ours"]["m1"]["worst"] == 5.0
    assert plain["figures"] == ["a.svg"]
