"""Reference values of joint motion, read from the one data file that holds them and their sources."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

FILE = Path(__file__).with_name("reference_values.json")


@dataclass(frozen=True)
class Source:
    """Where a value comes from: the name printed on the page, the full reference."""

    name: str
    reference: str


@dataclass(frozen=True)
class Reference:
    """How far one end of a joint's range conventionally reaches."""

    joint: str
    angle: str  # of estimators.hand_anatomy.ANGLES
    end: Literal["largest", "smallest"]
    degrees: float  # signed as everywhere
    source: Source
    note: str = ""


@dataclass(frozen=True)
class SmallestChange:
    """What a change of a figure between sessions must exceed to be more than measurement error."""

    value: float  # deg; of a rate per s
    source: Source
    note: str


@cache
def references() -> tuple[Reference, ...]:
    """All reference values, one a joint, angle and end."""
    file = _file()
    return tuple(
        Reference(
            joint,
            v["angle"],
            v["end"],
            float(v["degrees"]),
            Source(**file["sources"][v["source"]]),
            v.get("note", ""),
        )
        for v in file["values"]
        for joint in v["joints"]
    )


@cache
def smallest_change() -> SmallestChange:
    """The default until a glove's own repeatability is known."""
    file = _file()
    value = file["smallest_change"]
    return SmallestChange(
        float(value["degrees"]), Source(**file["sources"][value["source"]]), value["note"]
    )


@cache
def smallest_change_of_rate() -> SmallestChange:
    """The same for the rate of tapping."""
    file = _file()
    value = file["smallest_change_of_rate"]
    return SmallestChange(
        float(value["per_second"]), Source(**file["sources"][value["source"]]), value["note"]
    )


def _file() -> dict[str, Any]:
    value: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return value
