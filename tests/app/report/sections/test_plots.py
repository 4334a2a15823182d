"""The figures show what was measured, also in black and white."""

import io
import math
import re
from dataclasses import replace
from datetime import UTC, datetime

import matplotlib.image
import numpy as np
import pytest
import typst

from handscope.app.language import ENGLISH, languages
from handscope.app.report.content import Curve
from handscope.app.report.progress.chart import Shown, course_chart
from handscope.app.report.references import references
from handscope.app.report.sections import plots
from handscope.app.report.sections.range_rows import range_rows
from handscope.estimators.measures.figure import Grade
from handscope.estimators.measures.range_of_motion import Range
from handscope.estimators.measures.tapping import Tapping
from handscope.estimators.numerics.typing import Array
from tests.app.report.simulated_sessions import report

pytestmark = pytest.mark.usefixtures("drawn_anew")
SOURCE = b'#set page(width: auto, height: auto, margin: 0pt)\n#image(bytes(sys.inputs.svg), format: "svg")'
GOOD = np.array([0x7F, 0xA0, 0xAD]) / 255


def pixels(svg: str) -> Array:
    """The figure as it is set, (rows, columns, 3), 4 pixels a point."""
    png = typst.compile(
        SOURCE, format="png", ppi=288, sys_inputs={"svg": svg}, ignore_system_fonts=True
    )
    image: Array = matplotlib.image.imread(io.BytesIO(png))[..., :3]
    return image


def ink(svg: str) -> float:
    """Share of pixels that are not white."""
    return float((pixels(svg).min(axis=-1) < 0.9).mean())


def one(smallest: float, largest: float, grade: Grade = "good", joint: str = "index_pip") -> str:
    r = Range(joint, "flexion", math.radians(largest), math.radians(smallest), 0.0, 0.0, grade, "")
    return plots.range_chart(
        range_rows([r], full=True, language=ENGLISH), (), 200.0, ENGLISH, labels=False
    )


def bar_length(svg: str) -> int:
    """Pixels along the longest run of the good filling."""
    like = np.abs(pixels(svg) - GOOD).max(axis=-1) < 0.02
    return int(like.sum(axis=1).max())


def trial(amplitudes: Array) -> Tapping:
    t = np.arange(0.0, len(amplitudes) / 2 + 0.01, 0.01)
    distance = 0.01 + 0.06 * np.sin(2 * np.pi * t) ** 2
    closings = np.arange(len(amplitudes) + 1) / 2
    speeds = np.ones(len(amplitudes))
    return Tapping(t, distance, closings, amplitudes, speeds, speeds, 0.0, 0.0, "good", "")


def test_every_figure_of_a_session_has_ink() -> None:
    tasks = report().tasks
    rows = range_rows(tasks[0].result.details, full=True, language=ENGLISH)
    for svg in (
        plots.range_chart(rows, references(), 206.0, ENGLISH, labels=False),
        plots.range_chart(rows, references(), 300.0, ENGLISH),
        plots.flexion_curves(tasks[0].curves, 516.0, 54.0, ENGLISH),
        plots.tapping_chart(tasks[-1].result.details, 340.0, 118.0, ENGLISH),
    ):
        assert ink(svg) > 0.02
    assert ink(one(0, 0.4)) < 0.5 * ink(one(0, 90))


def test_a_bar_is_as_long_as_its_range() -> None:
    short, long = bar_length(one(10, 40)), bar_length(one(10, 70))
    assert long / short == pytest.approx(2.0, abs=0.06)  # edges of the bar take a pixel


def test_degrees_stand_at_the_ends_without_a_sign() -> None:
    svg = one(-12, 87)
    assert ">12</text>" in svg
    assert ">87</text>" in svg
    assert ">22–87</text>" in one(
        22, 87
    )  # both on the side of flexion, where 22 cannot be read as extension
    assert ">22</text>" in one(22, 22.3)
    assert not any(sign in svg[svg.index("<text") :] for sign in (">-", ">−", ">+"))


def test_grades_can_be_told_apart_without_colour() -> None:
    grey = []
    for grade in ("good", "fair", "poor"):
        row = pixels(one(0, 90, grade)).mean(axis=-1)[
            int(4 * plots.HEAD) : int(4 * (plots.HEAD + plots.ROW))
        ]  # type: ignore[arg-type]
        grey.append(float(row[16:29, 330:420].mean()))  # within the bar
    assert grey[0] + 0.15 < grey[1] < grey[2] + 0.15
    assert (
        pixels(one(0, 90, "poor"))[
            int(4 * plots.HEAD) + 16 : int(4 * plots.HEAD) + 29, 330:420
        ].std()
        > 0.1
    )  # hatched
    assert (
        pixels(one(0, 90, "fair"))[
            int(4 * plots.HEAD) + 16 : int(4 * plots.HEAD) + 29, 330:420
        ].std()
        < 0.05
    )  # plain


def test_reference_values_are_drawn_as_ticks_but_not_at_zero() -> None:
    r = Range("thumb_ip", "flexion", 1.0, 0.0, 0.0, 0.0, "good", "")
    rows = range_rows([r], full=True, language=ENGLISH)
    ticks = [
        plots.range_chart(rows, given, 200.0, ENGLISH).count("stroke-width: 0.8")
        for given in ((), references())
    ]
    assert ticks == [0, 2]  # 88 and -12
    finger = Range("index_pip", "flexion", 1.0, 0.0, 0.0, 0.0, "good", "")
    assert (
        plots.range_chart(
            range_rows([finger], full=True, language=ENGLISH), references(), 200.0, ENGLISH
        ).count("stroke-width: 0.8")
        == 1
    )  # 100, not 0


@pytest.mark.parametrize(("smallest", "beyond"), [(-1, False), (1, True)])
def test_degrees_stand_beyond_a_reference_tick_that_they_would_lie_on(
    smallest: int, beyond: bool
) -> None:
    """92 is 8 short of the reference value: "92" has room before its tick, "1–92" has none."""
    ends = math.radians(92), math.radians(smallest)
    rows = range_rows(
        [Range("index_pip", "flexion", *ends, 0.0, 0.0, "good", "")], full=True, language=ENGLISH
    )
    svg = plots.range_chart(rows, references(), 516.0, ENGLISH)
    (tick,) = re.findall(r'd="M ([\d.]+) [^"]*" [^>]*stroke-width: 0.8', svg)
    (number,) = re.findall(r'x="([\d.]+)"[^>]*>(?:1–)?92</text>', svg)
    assert (float(number) > float(tick)) is beyond


def test_a_joint_of_the_finger_keeps_its_line_where_another_is_not_measured() -> None:
    t = np.linspace(0, 5, 50)
    whole = plots.flexion_curves(
        [Curve(f"index_{j}", t, np.sin(t)) for j in ("mcp", "pip", "dip")], 200.0, 54.0, ENGLISH
    )
    alone = plots.flexion_curves([Curve("index_dip", t, np.sin(t))], 200.0, 54.0, ENGLISH)
    dotted = next(line for line in alone.splitlines() if "stroke-dasharray" in line)
    assert whole.count("stroke-dasharray") == 2
    assert (
        dotted.split("stroke-dasharray")[1][:12]
        == [x for x in whole.splitlines() if "stroke-dasharray" in x][1].split("stroke-dasharray")[
            1
        ][:12]
    )


def test_each_tap_and_each_closing_is_marked() -> None:
    few, many = (
        plots.tapping_chart(trial(np.full(n, 0.06)), 340.0, 118.0, ENGLISH) for n in (10, 12)
    )
    marks = [
        svg.count("<use") - svg.count("<text") for svg in (few, many)
    ]  # tick marks come with a number each
    assert marks == [
        10 + 11 - 2,
        12 + 13 - 2,
    ]  # the two names of the axes are numbers without a mark


def test_a_closing_before_the_trial_is_not_drawn_beside_its_axis() -> None:
    whole = trial(np.full(10, 0.06))
    early = replace(whole, closings=np.concatenate([[-0.4], whole.closings[1:]]))
    drawn, left_out = (
        plots.tapping_chart(one, 340.0, 118.0, ENGLISH).count("<use") for one in (whole, early)
    )
    assert drawn - left_out == 1


@pytest.mark.parametrize("taps", [9, 21])
def test_taps_are_counted_in_whole_numbers_and_seconds_have_the_readers_decimal_point(
    taps: int,
) -> None:
    svg = plots.tapping_chart(trial(np.full(taps, 0.06)), 340.0, 118.0, languages()["fr"])
    distance, amplitudes = svg.split("Distance en mm")
    numbers = [re.findall(r">(\d[\d.,]*)</text>", part) for part in (distance, amplitudes)]
    assert all(len(each) > 2 for each in numbers)
    assert "." not in "".join(numbers[0]) and not re.search("[.,]", "".join(numbers[1]))


def test_the_regression_line_follows_the_amplitudes() -> None:
    falling, flat = (
        pixels(plots.tapping_chart(trial(a), 340.0, 118.0, ENGLISH))
        for a in (np.linspace(0.06, 0.01, 20), np.full(20, 0.06))
    )
    lower_right = np.s_[-140:-60, 1150:1300]  # of the amplitudes; dots are lighter than the line
    black = [float((image[lower_right].max(axis=-1) < 0.2).mean()) for image in (falling, flat)]
    assert black[0] > 0.005
    assert black[1] == 0.0


def test_the_same_figure_gives_the_same_bytes() -> None:
    assert one(0, 90) == one(0, 90)


@pytest.mark.parametrize(("code", "point"), [("en", "."), ("fr", ",")])
def test_a_course_without_a_known_error_has_few_digits_at_its_axis(code: str, point: str) -> None:
    days = [datetime(2026, 11, day, 9, 0, tzinfo=UTC) for day in (7, 14, 21)]
    svg = plots.trend_chart(days, [2.497194, 2.497196, 2.4972], None, 168, 62, languages()[code])
    ticks = re.findall(r">(\d[\d.,]*)</text>", svg)
    assert len(ticks) >= 2 and len(set(ticks)) == len(ticks)
    assert all(len(tick) <= 4 for tick in ticks) and any(point in tick for tick in ticks)


def _ticks_from_above(svg: str) -> list[float]:
    found = re.findall(r'<text[^>]*? y="([\d.]+)"[^>]*>(\d[\d.,]*)</text>', svg)
    return [float(words) for _, words in sorted(found, key=lambda one: float(one[0]))]


@pytest.mark.parametrize(("course", "falls"), [((-29.0, -42.0), True), ((29.0, 42.0), False)])
def test_of_a_course_the_larger_size_is_further_up(
    course: tuple[float, float], falls: bool
) -> None:
    """Extension is negative in the angle, but its sizes are what is read."""
    days = [datetime(2026, 11, day, 9, 0, tzinfo=UTC) for day in (7, 14)]
    english = languages()["en"]
    shown = Shown(list(zip(days, course)), (), 12.0, None, {}, falls)
    for svg in (
        plots.trend_chart(days, course, 12.0, 168, 62, english, falls),
        course_chart(shown, english),
    ):
        sizes = _ticks_from_above(svg)
        assert len(sizes) >= 2 and sizes == sorted(sizes, reverse=True)
