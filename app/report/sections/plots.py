"""The figures of a report as SVG: ranges of motion, flexion over time, tapping. Readable in black and white; text stays text.

Sizes are in points, so that a figure's rows can stand beside a table's. The grade of a bar shows in its filling: solid is good, light is
fair, hatched is poor. Text is set in the serif of the document that shows the figure.
"""

import io
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime

import matplotlib
import numpy as np
from babel.numbers import get_decimal_symbol
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from handscope.app.language import Language
from handscope.app.report.content import Curve
from handscope.app.report.references import Reference
from handscope.app.report.sections.range_rows import RangeRow
from handscope.app.report.units import DEG
from handscope.estimators.hand.anatomy import FINGER_JOINTS, FINGERS
from handscope.estimators.measures.range_of_motion import Range
from handscope.estimators.measures.tapping import Tapping
from handscope.estimators.numerics.typing import Array

ROW, GROUP_GAP, HEAD = (
    10.4,
    3.0,
    22.0,
)  # pt: a row, the extra space before a group, the heading above the rows
INK, GREY, HAIR, ACCENT = "#1a1a1a", "#6b6b6b", "#c9c9c9", "#2f5d6e"
BAND = "#e7ecee"
UNKNOWN = 0.1  # part of a value that its axis spans either way where no measurement error is known
FILL = {"good": ("#7fa0ad", None), "fair": ("#d9e4e8", None), "poor": ("white", "/////")}
LINES = (
    ("-", INK),
    ((0, (4, 1.5)), ACCENT),
    ((0, (1, 1)), GREY),
)  # first, second, last joint of a finger
PANEL_GAP, ROOM, NUMBER = (
    4.0,
    15.0,
    10.0,
)  # pt: between the panels; beside the longest bar; taken by the degrees at a bar's end
PANELS = (  # share of the width, which range of a row, least limits (deg), keys of the words of the two directions
    (0.66, "bend", (-75.0, 105.0), ("extension", "flexion")),
    (0.34, "side", (-40.0, 40.0), ("radial", "ulnar")),
)
SETTINGS = {
    "svg.fonttype": "none",
    "svg.hashsalt": "handscope",  # the same figure gives the same bytes
    "font.family": "serif",
    "font.size": 7.0,
    "hatch.linewidth": 0.5,
    "path.simplify_threshold": 0.3,
    "axes.linewidth": 0.5,
    "axes.edgecolor": GREY,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "xtick.major.size": 2.2,
    "ytick.major.size": 2.2,
    "xtick.major.pad": 1.8,
    "ytick.major.pad": 1.8,
}
_MATPLOTLIB = threading.Lock()  # matplotlib's settings belong to the process: one figure at a time


def range_chart(
    rows: Sequence[RangeRow],
    references: Sequence[Reference],
    width: float,
    language: Language,
    labels: bool = True,
) -> str:
    """A bar from the smallest to the largest angle of every joint (one at least), flexion left, deviation right; `labels` names the joints."""
    with drawing():
        places, height = row_places(rows)
        figure = Figure(figsize=(width / 72, (height + HEAD) / 72))
        left = 56.0 if labels else 2.0
        inner = width - left - PANEL_GAP
        for k, (share, angle, least, words) in enumerate(PANELS):
            ax = axes_at(
                figure,
                left + k * (0.66 * inner + PANEL_GAP),
                0,
                share * inner,
                height,
                width,
                height + HEAD,
            )
            bars = [
                _Bar(y, r, _ticks(r, references))
                for y, row in zip(places, rows)
                if (r := getattr(row, angle))
            ]
            number = NUMBER * _scale(ax, bars, least, share * inner, height)
            _head(ax, *(language.say(f"way.{word}") for word in words))
            for bar in bars:
                _bar(ax, bar, number)
            if labels and k == 0:
                for row, y in zip(rows, places):
                    ax.annotate(
                        f"{row.group} {row.joint}",
                        (0, y),
                        (-left + 1, 0),
                        ("axes fraction", "data"),
                        "offset points",
                        va="center",
                    )
        return svg_of(figure)


def row_places(rows: Sequence[RangeRow]) -> tuple[Array, float]:
    """Middle of each row from the top of the rows, and the height of all, pt."""
    gaps = (
        np.cumsum([k > 0 and row.group != rows[k - 1].group for k, row in enumerate(rows)])
        * GROUP_GAP
    )
    return np.arange(len(rows)) * ROW + ROW / 2 + gaps, len(rows) * ROW + (
        float(gaps[-1]) if len(rows) else 0.0
    )


def flexion_curves(curves: Sequence[Curve], width: float, height: float, language: Language) -> str:
    """Flexion over time, a panel a finger: first joint solid, middle joint dashed, end joint dotted."""
    with drawing():
        figure = Figure(figsize=(width / 72, height / 72))
        panels = {f: [c for c in curves if c.joint.startswith(f)] for f in ("wrist", *FINGERS)}
        drawn = {finger: joints for finger, joints in panels.items() if joints}
        angles = DEG * np.concatenate([[0.0], *(c.angle[np.isfinite(c.angle)] for c in curves)])
        share = (width - 14) / max(len(drawn), 1)
        for k, (finger, joints) in enumerate(drawn.items()):
            ax = axes_at(figure, 14 + k * share, 11, share - 10, height - 21, width, height)
            for curve in joints:
                dashes, colour = LINES[
                    FINGER_JOINTS[finger].index(curve.joint) if finger in FINGERS else 0
                ]
                ax.plot(curve.t, DEG * curve.angle, ls=dashes, lw=0.7, color=colour)
            ax.axhline(0, color=HAIR, lw=0.5, zorder=0)
            ax.set(
                ylim=(min(-30, angles.min()) - 5, max(90, angles.max()) + 5),
                xlim=(0, joints[0].t[-1]),
                yticks=(0, 45, 90),
            )
            ax.yaxis.set_tick_params(labelleft=k == 0)
            ax.locator_params(axis="x", nbins=3, prune="upper")
            named(ax, language.say(f"finger.{finger}"))
        return svg_of(figure)


def tapping_chart(tapping: Tapping, width: float, height: float, language: Language) -> str:
    """Distance over time with the closings marked, and below it each tap's amplitude with its regression line."""
    with drawing():
        figure = Figure(figsize=(width / 72, height / 72))
        inner = (height - 48) / 2
        _distance(
            axes_at(figure, 15, height - 12 - inner, width - 19, inner, width, height),
            tapping,
            language,
        )
        _amplitudes(axes_at(figure, 15, 12, width - 19, inner, width, height), tapping, language)
        return svg_of(figure)


def trend_chart(
    moments: Sequence[datetime],
    values: Sequence[float],
    mdc95: float | None,
    width: float,
    height: float,
    language: Language,
    falls: bool = False,
) -> str:
    """One figure over the sessions, a dot each, with the band of the minimal detectable change about the first; `falls`: less of the value is more of what the figure is called (extension), and further up."""
    with drawing():
        figure = Figure(figsize=(width / 72, height / 72))
        ax = axes_at(figure, 22, 13, width - 28, height - 18, width, height)
        days = [(m - moments[0]).total_seconds() / 86400 for m in moments]
        if mdc95 is not None:
            ax.axhspan(values[0] - mdc95, values[0] + mdc95, color=BAND, lw=0, zorder=0)
            ax.axhline(values[0], color=GREY, lw=0.4, zorder=0.5)
        ax.plot(days, values, lw=0.8, color=ACCENT, marker="o", ms=2.6, mfc="white", mew=0.8)
        ax.plot(days[-1:], values[-1:], ls="", marker="o", ms=3.6, color=INK)
        half = UNKNOWN * abs(values[0]) if mdc95 is None else mdc95
        low, high = min(values[0] - half, *values), max(values[0] + half, *values)
        air = max(0.06 * (high - low), 1e-9)
        ax.set_ylim(low - air, high + air)
        ax.yaxis.set_inverted(falls)
        last = max(days[-1], 1e-9)
        ax.set_xlim(-0.04 * last, 1.06 * last)
        label_days(ax, last, (moments[0], moments[-1]), language)
        return svg_of(figure)


def label_days(ax: Axes, last: float, ends: tuple[datetime, datetime], language: Language) -> None:
    """The first and the last day below a course whose days count from the first; its values without a sign, the direction stands in the figure's name."""
    ax.set(xticks=[0, last], xticklabels=[language.short_day(m) for m in ends])
    ax.locator_params(axis="y", nbins=4)
    number_axis(ax.yaxis, language, signed=False)
    for label, side in zip(ax.get_xticklabels(), ("left", "right")):
        label.set(ha=side)


def number_axis(axis: Axis, language: Language, signed: bool = True) -> None:
    """An axis whose numbers have the reader's decimal point and a true minus; else their sizes alone."""
    point = get_decimal_symbol(language.locale)
    axis.set_major_formatter(
        lambda value, _: f"{value if signed else abs(value):g}".replace("-", "\u2212").replace(
            ".", point
        )
    )


@contextmanager
def drawing() -> Iterator[None]:
    """matplotlib with the report's settings, for one thread at a time."""
    with _MATPLOTLIB, matplotlib.rc_context(SETTINGS):
        yield


def _distance(ax: Axes, tapping: Tapping, language: Language) -> None:
    start = tapping.t[0]
    ax.plot(tapping.t - start, 1e3 * tapping.distance, lw=0.6, color=INK)
    known = np.isfinite(tapping.distance)
    closings = tapping.closings[tapping.closings >= start]  # the first may lie before the trial
    at = (
        np.interp(closings, tapping.t[known], tapping.distance[known])
        if known.any()
        else np.zeros(0)
    )
    ax.plot(
        closings - start,
        1e3 * at,
        ls="",
        marker="^",
        ms=2.6,
        mfc="white",
        mec=ACCENT,
        mew=0.6,
        clip_on=False,
    )
    ax.set(xlim=(0, tapping.t[-1] - start), ylim=(0, None))
    number_axis(ax.xaxis, language)
    named(ax, language.say("tapping.distance"))


def _amplitudes(ax: Axes, tapping: Tapping, language: Language) -> None:
    number = np.arange(1, tapping.count + 1)
    ax.vlines(number, 0, 1e3 * tapping.amplitudes, lw=0.5, color=HAIR)
    ax.plot(number, 1e3 * tapping.amplitudes, ls="", marker="o", ms=2.4, color=ACCENT)
    if tapping.count >= 2:
        slope, level = np.polyfit(number, 1e3 * tapping.amplitudes, 1)
        ax.plot(number[[0, -1]], level + slope * number[[0, -1]], lw=0.9, color=INK, ls=(0, (5, 2)))
    ax.set(xlim=(0.2, max(tapping.count, 1) + 0.8), ylim=(0, None))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    named(ax, language.say("tapping.amplitudes"))


def named(ax: Axes, words: str) -> None:
    """What the axes show, written level above them."""
    ax.annotate(words, (0, 1), (0, 3), "axes fraction", "offset points", va="bottom")


@dataclass(frozen=True)
class _Bar:
    y: float  # pt from the top
    range: Range
    ticks: tuple[float, ...]  # deg, reference values

    @property
    def low(self) -> float:
        return DEG * self.range.smallest

    @property
    def high(self) -> float:
        return DEG * self.range.largest


def _ticks(r: Range, references: Sequence[Reference]) -> tuple[float, ...]:
    """Reference values of a range; those of 0 need none, the zero line is there."""
    return tuple(
        f.judged.degrees
        for f in references
        if (f.joint, f.angle) == (r.joint, r.angle) and f.degrees
    )


def _scale(
    ax: Axes, bars: Sequence[_Bar], least: tuple[float, float], width: float, height: float
) -> float:
    """Degrees across with room for the numbers at both ends, points from the top downwards; returns degrees a point."""
    low = min([least[0], *(v for b in bars for v in (b.low, *b.ticks))])
    high = max([least[1], *(v for b in bars for v in (b.high, *b.ticks))])
    degrees = (high - low) / (width - 2 * ROOM)
    ax.set(
        xlim=(low - ROOM * degrees, high + ROOM * degrees), ylim=(height, 0), xticks=[], yticks=[]
    )
    ax.set_frame_on(False)
    for tick in range(30 * int(np.ceil(low / 30)), int(high) + 1, 30):
        ax.axvline(
            tick,
            color=GREY if tick == 0 else HAIR,
            lw=0.7 if tick == 0 else 0.35,
            zorder=2.5 if tick == 0 else 0,
        )
        ax.annotate(
            f"{abs(tick)}",
            (tick, 1),
            (0, 2),
            ("data", "axes fraction"),
            "offset points",
            ha="center",
            va="bottom",
            color=GREY,
        )
    return degrees


def _head(ax: Axes, below: str, above: str) -> None:
    for word, align, shift in ((below, "right", -3), (above, "left", 3)):
        ax.annotate(
            word,
            (0, 1),
            (shift, 10.5),
            ("data", "axes fraction"),
            "offset points",
            ha=align,
            va="bottom",
            style="italic",
        )


def _bar(ax: Axes, bar: _Bar, number: float) -> None:
    """Filling, reference ticks with a white edge, and the degrees at both ends, beyond a tick within the `number`'s width (deg)."""
    colour, hatch = FILL[bar.range.grade]
    ax.barh(
        bar.y,
        bar.high - bar.low,
        5.6,
        bar.low,
        facecolor=colour,
        edgecolor=ACCENT,
        hatch=hatch,
        lw=0.4,
        zorder=2,
    )
    for tick in bar.ticks:
        for paint, lw in (("white", 2.2), (INK, 0.8)):
            ax.plot(
                [tick, tick],
                [bar.y - 4.4, bar.y + 4.4],
                color=paint,
                lw=lw,
                zorder=3,
                solid_capstyle="butt",
            )
    words = _ends(round(bar.low), round(bar.high))
    before, beyond = (number * max(1.0, 0.4 * len(w)) for w in words)  # "1–92" takes more than "92"
    start = min([bar.low, *(t for t in bar.ticks if -before < t - bar.low < 0)])
    end = max([bar.high, *(t for t in bar.ticks if 0 < t - bar.high < beyond)])
    for place, word, shift, align in zip((start, end), words, (-2.2, 2.2), ("right", "left")):
        ax.annotate(
            word, (place, bar.y), (shift, -0.2), "data", "offset points", ha=align, va="center"
        )


def _ends(low: int, high: int) -> tuple[str, str]:
    """Numbers at the two ends; of a range on one side of zero both stand on that side, so that none can be read as the other's."""
    if low > 0:
        return "", f"{low}–{high}" if low < high else str(high)
    if high < 0:
        return f"{-low}–{-high}" if low < high else str(-low), ""
    return str(-low), str(high)


def axes_at(
    figure: Figure, left: float, bottom: float, w: float, h: float, width: float, height: float
) -> Axes:
    """Axes placed in points."""
    ax = figure.add_axes((left / width, bottom / height, w / width, h / height))
    ax.spines[["top", "right"]].set_visible(False)
    return ax


def svg_of(figure: Figure) -> str:
    """A figure as SVG."""
    buffer = io.BytesIO()
    FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None})
    return buffer.getvalue().decode()
