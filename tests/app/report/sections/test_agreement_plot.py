"""The Bland-Altman figure shows bias and limits where they are."""

import io

import matplotlib.image
import numpy as np
import pytest

from handscope.app.report.sections.agreement_plot import agreement_chart
from handscope.estimators.measures.comparison import WHOLE, Agreement, Pair, agreements
from tests.simulated import DEG

T = np.arange(0, 10, 0.01)


def pairs(names: int) -> tuple[list[Pair], list[Agreement]]:
    rng = np.random.default_rng(0)
    made = []
    for k in range(names):
        a = 40 * DEG * np.sin(T + k)
        made.append(
            Pair(f"joint{k}_flexion", "rad", T, a, a + 5 * DEG + 2 * DEG * rng.normal(size=len(T)))
        )
    return made, agreements(made, [(WHOLE, 0.0, 10.0)])


def test_bias_and_limits_are_written_in_degrees_with_their_signs() -> None:
    made, found = pairs(1)
    svg = agreement_chart(made, found, "svg", "A: one. B: other.").decode()
    bias, (low, high) = found[0].offset / DEG, (limit / DEG for limit in found[0].limits)
    for number in (bias, low, high):
        assert f">{number:+.1f}</text>" in svg
    assert abs(bias - 5.0) < 0.2
    assert abs(high - low - 2 * 1.96 * 2.0) < 0.4
    assert "A: one. B: other." in svg
    assert "joint0 flexion, deg" in svg


def test_a_negative_bias_has_a_minus_and_not_a_hyphen() -> None:
    made, _ = pairs(1)
    turned = [Pair(p.name, p.unit, p.t, p.b, p.a) for p in made]
    (found,) = agreements(turned, [(WHOLE, 0.0, 10.0)])
    svg = agreement_chart(turned, [found], "svg").decode()
    assert f">−{-found.offset / DEG:.1f}</text>" in svg
    assert ">-" not in svg[svg.index("<text") :]


@pytest.mark.slow
def test_every_quantity_has_a_panel_and_the_same_figure_the_same_bytes() -> None:
    made, found = pairs(4)
    svg = agreement_chart(made, found, "svg").decode()
    assert all(f"joint{k} flexion" in svg for k in range(4))
    for form in ("svg", "png", "pdf"):
        assert agreement_chart(made, found, form) == agreement_chart(made, found, form)
    image = matplotlib.image.imread(io.BytesIO(agreement_chart(made, found, "png")))
    few = matplotlib.image.imread(io.BytesIO(agreement_chart(made[:3], found[:3], "png")))
    assert image.shape[0] > 1.7 * few.shape[0]
    assert image.shape[1] == few.shape[1]
    assert 0.01 < (image[..., :3].min(axis=-1) < 0.9).mean() < 0.3
