"""Reference values and published MDCs with their sources: the newest edition from the one data file that holds them, an older one from what a result stored."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal

from handscope.estimators.messages.sentence import with_code

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
    angle: str  # of estimators.hand.anatomy.ANGLES
    end: Literal["largest", "smallest"]
    degrees: float  # signed as everywhere
    source: Source
    note: str = ""
    also: "Reference | None" = None  # what another source says

    @property
    def judged(self) -> "Reference":
        """What an end is judged by: of two sources the one that asks for less, so that a joint is behind only where it is behind both."""
        each = [self, self.also] if self.also else [self]
        return min(each, key=lambda r: r.degrees if self.end == "largest" else -r.degrees)

    @property
    def other(self) -> "Reference | None":
        """What the source says that an end is not judged by."""
        return self.also if self.judged is self else self


@dataclass(frozen=True)
class SmallestChange:
    """What a change of a figure between sessions must exceed to be more than measurement error."""

    value: float  # deg; of a rate per s
    source: Source
    note: str


@dataclass(frozen=True, eq=False)
class Edition:
    """The reference values of one edition, `data` as in FILE."""

    data: Mapping[str, Any]

    @property
    def number(self) -> int:
        """Counts the editions of the file."""
        return int(self.data["version"])

    @cached_property
    def references(self) -> tuple[Reference, ...]:
        """All reference values of joint motion, one a joint, angle and end."""
        return tuple(
            self._reference(v, joint) for v in self.data["values"] for joint in v["joints"]
        )

    @cached_property
    def smallest_change(self) -> SmallestChange:
        """Of a joint's angle, deg: the default until a glove's own repeatability is known."""
        value = self.data["smallest_change"]
        return SmallestChange(float(value["degrees"]), self.source(value["source"]), value["note"])

    @cached_property
    def smallest_change_of_rate(self) -> SmallestChange:
        """Of the rate of tapping, per s."""
        value = self.data["smallest_change_of_rate"]
        return SmallestChange(
            float(value["per_second"]), self.source(value["source"]), value["note"]
        )

    def _reference(self, v: Mapping[str, Any], joint: str) -> Reference:
        note = with_code(
            f"reference_note.{v['joints'][0]}_{v['angle']}_{v['end']}", v.get("note", "")
        )
        of = joint, v["angle"], v["end"]
        second = v.get("also")
        also = (
            Reference(*of, float(second["degrees"]), self.source(second["source"]))
            if second
            else None
        )
        return Reference(*of, float(v["degrees"]), self.source(v["source"]), note, also)

    def source(self, key: str) -> Source:
        found = self.data["sources"][key]
        return Source(
            with_code(f"norm_name.{key}", found["name"]),
            with_code(f"norm_reference.{key}", found["reference"]),
        )


@cache
def newest() -> Edition:
    """The edition that new results are compared with."""
    return Edition(json.loads(FILE.read_text(encoding="utf-8")))


def edition_of(data: Mapping[str, Any]) -> Edition:
    """The edition with this content."""
    return newest() if data == newest().data else Edition(data)


def references() -> tuple[Reference, ...]:
    """All reference values of the newest edition."""
    return newest().references


def smallest_change() -> SmallestChange:
    """That of the newest edition."""
    return newest().smallest_change


def smallest_change_of_rate() -> SmallestChange:
    """That of the newest edition."""
    return newest().smallest_change_of_rate
