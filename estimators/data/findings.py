"""Fault of a sensor, with what to do about it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from handscope.estimators.data.samples import Block, join
from handscope.estimators.messages.sentence import phrase


@dataclass(frozen=True)
class Finding:
    """One fault of one sensor; `fault` means that its segment is not to be trusted, `warning` that
    it may be."""

    sensor: str
    kind: str  # "dead_axis", or the code of a message
    sentence: str  # what was found, beginning after the sensor's name
    fix: str  # what to do; "" where the sentence says it, and names the sensor itself
    severity: Literal["fault", "warning"]
    spans: tuple[tuple[float, float], ...] = ((-float("inf"), float("inf")),)  # s, when it holds

    @property
    def message(self) -> str:
        if not self.fix:
            return self.sentence
        return phrase("fault.with_fix", sensor=self.sensor, sentence=self.sentence, fix=self.fix)


def whole_streams(blocks: Sequence[Block]) -> list[Block]:
    """One block a stream, in order of the streams' first blocks."""
    parts: dict[str, list[Block]] = {}
    for block in blocks:
        parts.setdefault(block.stream.name, []).append(block)
    return [join(p) if len(p) > 1 else p[0] for p in parts.values()]
