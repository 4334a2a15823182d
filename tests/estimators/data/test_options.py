"""An option is declared once, with everything a person needs to know."""

from dataclasses import dataclass

import pytest

from handscope.estimators.data.options import describe, option


@dataclass(frozen=True, kw_only=True)
class Params:
    window: float = option(0.2, "s", "length of the window", "ours")
    side: str = option("left", "", "which side", "ours", ("left", "right"))


def test_options_are_described_in_the_order_of_declaration() -> None:
    window, side = describe(Params)
    assert (
        window.name,
        window.default,
        window.kind,
        window.unit,
        window.meaning,
        window.source,
    ) == (
        "window",
        0.2,
        "float",
        "s",
        "length of the window",
        "ours",
    )
    assert side.choices == ("left", "right")
    assert Params().window == 0.2


def test_a_field_that_is_no_option_is_a_mistake_of_the_programmer() -> None:
    @dataclass(frozen=True)
    class Bad:
        window: float = 0.2

    with pytest.raises(AssertionError, match="window"):
        describe(Bad)
