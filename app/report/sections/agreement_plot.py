"""Bland-Altman plots: the difference of two recordings against their mean, a panel a quantity, with bias and limits of agreement."""

import io
from collections.abc import Sequence
from typing import Literal

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from handscope.app.report.sections.plots import ACCENT, GREY, HAIR, INK, SETTINGS
from handscope.app.report.units import READABLE
from handscope.estimators.measures.comparison import Agreement, Pair

Form = Literal["svg", "png", "pdf"]
POINTS = 600  # at most in a panel: more would cover each other
ACROSS, WIDTH, HEIGHT = 3, 172.0, 118.0  # panels in a row; pt of a panel
MARGIN = 16.0  # pt below for the words about all panels


def agreement_chart(
    pairs: Sequence[Pair], agreements: Sequence[Agreement], form: Form, words: str = ""
) -> bytes:
    """The figure as a file. `agreements` are those of the whole recording, one a pair at most; `words` say what A and B are."""
    found = {a.name: a for a in agreements}
    drawn = [p for p in pairs if p.name in found]
    columns = min(ACROSS, len(drawn)) or 1
    rows = -(-len(drawn) // columns) or 1
    with matplotlib.rc_context(SETTINGS):
        figure = Figure(figsize=(columns * WIDTH / 72, (rows * HEIGHT + 2 * MARGIN) / 72))
        width, height = columns * WIDTH, rows * HEIGHT + 2 * MARGIN
        for k, pair in enumerate(drawn):
            row, column = divmod(k, columns)
            left, bottom = column * WIDTH + 26, height - MARGIN - (row + 1) * HEIGHT + 14
            ax = figure.add_axes(
                (left / width, bottom / height, (WIDTH - 62) / width, (HEIGHT - 32) / height)
            )
            _draw_panel(ax, pair, found[pair.name])
        figure.text(8 / width, 1 - 10 / height, words, va="center")
        figure.text(
            8 / width,
            8 / height,
            "Across: mean of A and B. Up: B minus A. Solid: bias. Dashed: bias ± 1.96 SD.",
            va="center",
            color=GREY,
        )
        return _encode(figure, form)


def _draw_panel(ax: Axes, pair: Pair, agreement: Agreement) -> None:
    """Differences over means, bias and limits of agreement of one quantity."""
    unit, factor = READABLE[pair.unit]
    a, b = factor * pair.both
    every = max(1, len(a) // POINTS)
    ax.plot(
        ((a + b) / 2)[::every],
        (b - a)[::every],
        ls="",
        marker="o",
        ms=1.2,
        mec="none",
        mfc=ACCENT,
        alpha=0.35,
        rasterized=True,
    )
    ax.axhline(0, color=HAIR, lw=0.5, zorder=0)
    lines = (
        (factor * agreement.offset, "-"),
        *((factor * limit, (0, (4, 2))) for limit in agreement.limits),
    )
    half = max(
        1.15 * max(abs(v - lines[0][0]) for v, _ in lines),
        1.05 * np.abs(b - a - lines[0][0]).max(),
        0.5,
    )
    ax.set_ylim(lines[0][0] - half, lines[0][0] + half)
    shown: list[float] = []
    for value, style in lines:
        ax.axhline(value, color=INK, lw=0.7, ls=style)
        if all(
            abs(value - other) > 0.16 * half for other in shown
        ):  # numbers would lie on each other
            ax.annotate(
                f"{value:+.1f}".replace("-", "−"),
                (1, value),
                (5, 0),
                ("axes fraction", "data"),
                "offset points",
                va="center",
                annotation_clip=False,
            )
            shown.append(value)
    ax.spines[["top", "right"]].set_visible(False)
    ax.locator_params(nbins=4)
    ax.annotate(
        f"{pair.name.replace('_', ' ')}, {unit}",
        (0, 1),
        (0, 3),
        "axes fraction",
        "offset points",
        va="bottom",
    )


def _encode(figure: Figure, form: Form) -> bytes:
    """The figure as bytes without a date: the same figure gives the same bytes."""
    buffer = io.BytesIO()
    figure.savefig(
        buffer,
        format=form,
        dpi=200,
        metadata={"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": {}}[form],
    )
    return buffer.getvalue()
