"""The figures of the reproductions as SVG: bars of an error budget, lines over time. White ground, text stays text."""

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from handscope.app.report.sections.plots import ACCENT, FILL, GREY, HAIR, INK, LINES, SETTINGS
from handscope.estimators.numerics.typing import Array

WIDTH, PANEL, ROW = 7.2, 2.4, 0.28  # inches: a figure, a panel of lines, a row of bars
KEY = "Standard deviation, in brackets the RMS error over the trials. The shade is the standard deviation's: dark a tenth of what is good enough or less, white ten times it or more"
READ_ON_A_PAGE = {"font.family": "sans-serif", "font.size": 9.0, "axes.linewidth": 0.6}


@dataclass(frozen=True)
class Bar:
    """One row: in every panel the value alone, and what is left without it."""

    name: str
    values: Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Line:
    """A curve, with a band around it where there is one."""

    name: str
    x: Array
    y: Array
    low: Array | None = None
    high: Array | None = None


@dataclass(frozen=True)
class Cells:
    """A field of cells, a row a name: standard deviations and errors, each (rows, columns)."""

    title: str
    rows: Sequence[str]
    sd: Array
    error: Array


def bars(rows: Sequence[Bar], everything: Sequence[float], titles: Sequence[str]) -> str:
    """A panel a title: filled bars are each row alone, the open mark is everything but it, the line is everything."""
    with _drawing():
        figure = Figure(
            figsize=(WIDTH, 1.1 + ROW * len(rows)), layout="constrained", facecolor="white"
        )
        panels = figure.subplots(1, len(titles), sharey=True, squeeze=False)[0]
        y = np.arange(len(rows))
        for k, (ax, title) in enumerate(zip(panels, titles)):
            ax.barh(
                y, [row.values[k][0] for row in rows], 0.5, color=FILL["good"][0], label="alone"
            )
            ax.plot(
                [row.values[k][1] for row in rows],
                y,
                ls="",
                marker="o",
                ms=5,
                mfc="white",
                mec=INK,
                label="all others, this one off",
            )
            ax.axvline(everything[k], color=INK, lw=0.8, ls=(0, (4, 2)), label="all")
            ax.set(
                yticks=y,
                yticklabels=[row.name for row in rows],
                ylim=(len(rows) - 0.4, -0.6),
                xlim=(0, None),
                title=title,
            )
            _plain(ax)
        figure.legend(
            *panels[0].get_legend_handles_labels(),
            loc="outside lower center",
            ncols=3,
            frameon=False,
        )
        return _svg(figure)


def lines(
    panels: Sequence[Sequence[Line]], titles: Sequence[str], limits: tuple[float, float | None]
) -> str:
    """A panel of curves a title, one below the other; a band where a line has one."""
    with _drawing():
        figure = Figure(
            figsize=(WIDTH, 0.4 + PANEL * len(panels)), layout="constrained", facecolor="white"
        )
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for ax, curves, title in zip(axes, panels, titles):
            for curve, (dashes, colour) in zip(curves, LINES):
                ax.plot(curve.x, curve.y, ls=dashes, lw=1.2, color=colour, label=curve.name)
                if curve.low is not None and curve.high is not None:
                    ax.fill_between(curve.x, curve.low, curve.high, color=colour, alpha=0.15, lw=0)
            low, high = limits
            ax.set(title=title, xlim=(0, curves[0].x[-1] + curves[0].x[0]))
            ax.set_ylim(bottom=low - 0.06 * (high or 0.0), top=None if high is None else 1.1 * high)
            _plain(ax)
        figure.legend(
            *axes[0].get_legend_handles_labels(),
            loc="outside lower center",
            ncols=len(panels[0]),
            frameon=False,
        )
        return _svg(figure)


def cells(fields: Sequence[Cells], columns: Sequence[str], good: Sequence[float]) -> str:
    """A field one below the other; a cell is the darker the surer, by its standard deviation against the column's good one; the error below it."""
    with _drawing():
        height = 1.1 + sum(0.5 + 0.36 * len(f.rows) for f in fields)
        figure = Figure(figsize=(1.3 * WIDTH, height), layout="constrained", facecolor="white")
        figure.supxlabel(KEY, fontsize=7.0, color=INK)
        axes = figure.subplots(len(fields), 1, sharex=True, squeeze=False)[:, 0]
        shades = LinearSegmentedColormap.from_list(
            "told", [ACCENT, FILL["good"][0], FILL["fair"][0], "white"]
        )
        for ax, field in zip(axes, fields):
            shade = np.clip(np.log10(field.sd / np.asarray(good)), -1.0, 1.0)
            ax.imshow(shade, cmap=shades, vmin=-1.0, vmax=1.0, aspect="auto")
            for (row, column), sd in np.ndenumerate(field.sd):
                label = f"{sd:.2g}\n({field.error[row, column]:.2g})"
                ax.text(
                    column,
                    row,
                    label,
                    ha="center",
                    va="center",
                    fontsize=6.5,
                    color="white" if shade[row, column] < -0.4 else INK,
                )
            ax.set(
                yticks=range(len(field.rows)),
                yticklabels=field.rows,
                xticks=range(len(columns)),
                xticklabels=columns,
                title=field.title,
            )
            ax.tick_params(length=0, labelcolor=INK, labelsize=7.0)
            ax.title.set(fontsize=9.0, color=ACCENT)
            ax.spines[:].set_visible(False)
            ax.set_xticks(np.arange(len(columns)) - 0.5, minor=True)
            ax.set_yticks(np.arange(len(field.rows)) - 0.5, minor=True)
            ax.grid(which="minor", color="white", lw=1.0)
            ax.tick_params(which="minor", length=0)
        return _svg(figure)


@contextmanager
def _drawing() -> Iterator[None]:
    with matplotlib.rc_context({**SETTINGS, **READ_ON_A_PAGE}):
        yield


def _plain(ax: Axes) -> None:
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(axis="x", color=HAIR, lw=0.4)
    ax.set_axisbelow(True)
    ax.tick_params(colors=GREY, labelcolor=INK)
    ax.title.set(fontsize=9.0, color=ACCENT)


def _svg(figure: Figure) -> str:
    buffer = io.BytesIO()
    FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None})
    return buffer.getvalue().decode()
