"""What a reproduction found: our figures beside the paper's with their spread over the seeds, and whether ours are at or below theirs."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Spread:
    """A figure over the seeds; `worst` is the one farthest from zero."""

    mean: float
    sd: float  # of a sample; 0 of a single value
    worst: float
    count: int


@dataclass(frozen=True)
class Row:
    """Our figures by column, and what the paper has for the same columns, with its standard deviation over trials where it is printed."""

    name: str
    ours: Mapping[str, Spread]
    theirs: Mapping[str, float] = field(default_factory=dict)
    theirs_sd: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Table:
    """`judged` names the column of which every row says whether ours is at or below theirs."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    judged: str = ""
    head: str = ""  # of the first column
    digits: int = 2
    over: str = "seeds"  # what a spread is taken over


@dataclass(frozen=True)
class Sizes:
    """What the simulated experiments have in common: rows of words under a head."""

    name: str
    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Verdict:
    """A figure against what is to be reached."""

    what: str
    value: float
    limit: float
    unit: str
    source: str  # whose limit it is

    @property
    def met(self) -> bool:
        return self.value <= self.limit

    @property
    def words(self) -> str:
        verb = "at or below" if self.met else "ABOVE"
        return f"{self.what}: {self.value:.2f} {self.unit}, {verb} {self.limit:.2f} {self.unit} ({self.source})"


@dataclass(frozen=True)
class Finding:
    """All that one reproduction has to say; sentences are whole, figures are SVG by file name."""

    name: str
    title: str
    setting: tuple[str, ...]
    tables: tuple[Table, ...]
    verdicts: tuple[Verdict, ...] = ()
    remarks: tuple[str, ...] = ()
    figures: Mapping[str, str] = field(default_factory=dict)
    simulated: bool = True  # with the common error sizes


def spread(values: Iterable[float]) -> Spread:
    """Mean, standard deviation and the value farthest from zero; all must be finite."""
    x = np.fromiter(values, float)
    assert len(x) and np.isfinite(x).all(), "a figure without a value"
    return Spread(
        float(x.mean()),
        float(x.std(ddof=1)) if len(x) > 1 else 0.0,
        float(x[np.abs(x).argmax()]),
        len(x),
    )


def at_or_below(row: Row, column: str) -> bool | None:
    """Whether our mean is at or below the paper's figure; None where the paper has none."""
    theirs = row.theirs.get(column)
    return None if theirs is None or column not in row.ours else row.ours[column].mean <= theirs


def standing(table: Table, what: str) -> str:
    """One sentence: in how many rows ours is at or below theirs, and in which it is not."""
    judged = {row.name: at_or_below(row, table.judged) for row in table.rows}
    above = [
        f"{row.name} ({_against(row, table.judged)})"
        for row in table.rows
        if judged[row.name] is False
    ]
    verb = f"{what} at or below the paper's in {sum(m is True for m in judged.values())} of {sum(m is not None for m in judged.values())} rows"
    return f"{verb}; above it in {', '.join(above)}." if above else f"{verb}."


def _against(row: Row, column: str) -> str:
    return f"{row.ours[column].mean:.3f} against {row.theirs[column]:g}"


def as_json(finding: Finding) -> dict[str, Any]:
    """Plain values of everything but the drawings."""
    plain = asdict(finding)
    plain["figures"] = sorted(finding.figures)
    for verdict, value in zip(finding.verdicts, plain["verdicts"]):
        value["met"] = verdict.met
    for table, value in zip(finding.tables, plain["tables"]):
        for row, fields in zip(table.rows, value["rows"]):
            fields["at_or_below"] = at_or_below(row, table.judged)
    assert all(math.isfinite(v.value) for v in finding.verdicts)
    return plain
