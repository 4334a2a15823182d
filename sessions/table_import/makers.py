"""Makers whose exported tables have names of their own: units, times and sides that the names do not say (makers.json)."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path


@dataclass(frozen=True)
class Maker:
    """What a maker's documentation, or who reads its tables, says of them."""

    name: str
    header: tuple[str, ...]  # patterns, each of which a column's name matches
    time: str  # pattern of the column of times
    time_unit: str
    units: Mapping[str, str]  # by quantity
    source: str
    sides: Mapping[str, str] = field(default_factory=dict)  # pattern of each hand, if not its word

    def is_time(self, name: str) -> bool:
        """Whether a column of this name holds the times."""
        return re.search(self.time, name) is not None


def maker_of(names: Sequence[str]) -> Maker | None:
    """The maker whose header this is."""
    return next(
        (m for m in _makers() if all(any(re.search(p, n) for n in names) for p in m.header)), None
    )


@cache
def _makers() -> tuple[Maker, ...]:
    entries = json.loads(Path(__file__).with_name("makers.json").read_text("utf-8"))
    return tuple(Maker(**{**e, "header": tuple(e["header"])}) for e in entries)
