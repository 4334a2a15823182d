"""One number that a clinician reads, with what is needed to trust it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from estimators.trajectory import FLAG_WORDS

Grade = Literal["good", "fair", "poor"]
TRUSTED = 0.02  # share of flagged samples up to which a figure counts as good
USABLE = 0.20  # and up to which as fair


@dataclass(frozen=True)
class Figure:
    """A measured value in SI units; NaN where it could not be measured, `reason` says why or what it rests on."""

    name: str  # e.g. index_mcp_flexion_max
    value: float
    unit: str  # rad, m, s, Hz, 1, ...
    source: str  # definition: a paper, or ours
    sd: float | None = None
    grade: Grade = "good"
    reason: str = ""


def grade_of(flags: NDArray[np.uint8]) -> tuple[Grade, str]:
    """Grade and reason from the flags (n, segments used) of the samples that a figure rests on."""
    if not flags.size:
        return "poor", "no samples"
    found = []
    for flag, words in FLAG_WORDS.items():
        share = float(((flags & flag) != 0).any(axis=1).mean())
        if share > 0:
            found.append((share, words))
    if not found:
        return "good", ""
    share, words = max(found)
    reason = f"{words} in {100 * share:.0f} % of the samples"
    return ("good" if share <= TRUSTED else "fair" if share <= USABLE else "poor"), reason
