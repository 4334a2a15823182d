"""Curves of measures in words and units for people: on pages and in reports, from a fresh result and from a kept one."""

import numpy as np

from handscope.app.language import ENGLISH, language
from handscope.app.report.sections.measure_plots import panel_chart
from handscope.app.report.sections.shown_panels import panels, shown_of
from handscope.app.results.make import _shown
from handscope.estimators.measures.plot_data import Curve, PlotData

T = 100.0 + 0.01 * np.arange(4000)
GRIP = np.where(T < 120, 5.0, np.nan)
SHOWN = PlotData(
    (
        Curve("grip_force", "N", T, GRIP),
        Curve("load_force", "N", T, 0.5 * GRIP),
        Curve("squeeze_distance", "m", T, np.full(4000, 0.04)),
        Curve(
            "force_over_distance",
            "N",
            np.array([0.03, 0.035, 0.04]),
            np.array([6.0, 3.1, 0.0]),
            "m",
        ),
        Curve("fitted_spring", "N", np.array([0.03, 0.035, 0.04]), np.array([6.0, 3.0, 0.0]), "m"),
        Curve("squeeze_response", "m/N", np.array([0.5, 1.0]), np.array([1e-3, 1e-3]), "Hz"),
    ),
    {"lift_off": np.array([102.5]), "slip": np.array([101.25])},
)


def test_curves_that_belong_together_share_a_panel_in_units_for_people() -> None:
    told = {p.name: p for p in panels(SHOWN, 100.0, ENGLISH)}
    assert set(told) == {
        "grip_and_load",
        "squeeze_distance",
        "force_over_distance",
        "squeeze_response",
    }
    both = told["grip_and_load"]
    assert [line.name for line in both.lines] == ["grip", "load"]
    assert both.title == "Grip and load force, N"
    assert (both.x[0], both.x_unit, both.marks) == (0.0, "s", (1.25, 2.5))
    assert len(both.x) <= 600
    assert both.lines[0].y[0] == 5.0 and both.lines[1].y[0] == 2.5 and both.lines[0].y[-1] is None
    assert set(told["squeeze_distance"].lines[0].y) == {40.0}
    spring = told["force_over_distance"]
    assert (spring.x, spring.x_unit, spring.marks) == ((30.0, 35.0, 40.0), "mm", ())
    answer = told["squeeze_response"]
    assert (answer.x, answer.x_unit, answer.lines[0].y) == ((0.5, 1.0), "Hz", (1.0, 1.0))  # mm/N
    assert panels(SHOWN, 100.0, language("de"))[0].title == "Griff- und Lastkraft, N"


def test_a_kept_result_draws_the_same_curves() -> None:
    kept = panels(shown_of(_shown(SHOWN)), 100.0, ENGLISH)
    assert [p.name for p in kept] == [p.name for p in panels(SHOWN, 100.0, ENGLISH)]
    assert [line.name for line in kept[0].lines] == ["grip", "load"]
    assert kept[2] == panels(SHOWN, 100.0, ENGLISH)[2]
    assert panels(shown_of(None), 0.0, ENGLISH) == []


def test_a_peak_of_one_curve_stays_for_the_others_too() -> None:
    peak = np.full(4000, 1.0)
    peak[1777] = 9.0
    (both,) = panels(
        PlotData((Curve("grip_force", "N", T, peak), Curve("load_force", "N", T, np.ones(4000)))),
        100.0,
        ENGLISH,
    )
    assert max(v for v in both.lines[0].y if v is not None) == 9.0
    assert len(both.lines[0].y) == len(both.lines[1].y) == len(both.x)


def test_a_panel_of_a_report_is_drawn_with_its_numbers_as_text() -> None:
    svg = panel_chart(panels(SHOWN, 100.0, ENGLISH)[0], ENGLISH)
    assert "solid: grip, dashed: load" in svg
    assert ">s<" in svg
