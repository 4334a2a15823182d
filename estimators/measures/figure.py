"""A figure: one number that a clinician reads, with standard deviation, grade and reason."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.data.trajectory import FLAG_WORDS, Flag
from handscope.estimators.messages.sentence import join, phrase

Grade = Literal["good", "fair", "poor"]
GRADES: tuple[Grade, ...] = ("good", "fair", "poor")
TRUSTED = 0.02  # share of flagged samples up to which a figure counts as good
USABLE = 0.20  # and up to which as fair
ONE_PERCENT = 0.01  # a smaller share is said to be less
# rad, standard deviation of an angle that is not good any more, and that is poor
WIDE, TOO_WIDE = np.radians([10.0, 20.0])
WRONG = np.uint8(Flag.FAULTY | Flag.DOUBTFUL)  # never good, however short


@dataclass(frozen=True)
class Figure:
    """A measured value in SI units; NaN where it could not be measured, `reason` says why or what it rests on."""

    name: str  # e.g. index_mcp_flexion_max: `part` and `what`; unique within a task's measure
    value: float
    unit: str  # rad, m, s, Hz, 1, ...
    source: str  # definition: a paper, or ours
    # of the value's error: instrument and calibration, and sampling where it sums up repetitions;
    # None: not known
    sd: float | None = None
    grade: Grade = "good"
    reason: str = ""
    part: str = ""  # finger, joint or pair of fingers that it is about, "" = the whole task
    what: str = ""  # key of its words: flexion_max, tapping_rate, ...
    meaning: str = ""  # the definition in one sentence
    # what the scheme that `source` names calls such a value: "good"; "" without a scheme
    category: str = ""
    detail: bool = False  # one of many that a page leaves to its tables


@dataclass(frozen=True)
class Kind:
    """What all figures of one kind have in common, declared once by its measure."""

    what: str
    unit: str
    meaning: str
    source: str
    detail: bool = False  # one of many that a page leaves to its tables

    def of(
        self,
        value: float,
        sd: float | None = None,
        grade: Grade = "good",
        reason: str = "",
        part: str = "",
        category: str = "",
    ) -> Figure:
        """A figure of this kind; what is not measured has no standard deviation, and its grade is poor. An angle's is no better than its standard deviation."""
        if not np.isfinite(value):
            sd, grade, category = None, "poor", ""
        known = None if sd is None or not np.isfinite(sd) else float(sd)
        if known is not None and self.unit == "rad" and known > WIDE:
            of_sd: Grade = "poor" if known > TOO_WIDE else "fair"
            wide = phrase("measure.wide_sd", sd_deg=np.degrees(known))
            grade, reason = worse((grade, reason), (of_sd, wide))
        name = f"{part}_{self.what}" if part else self.what
        return Figure(
            name,
            float(value),
            self.unit,
            self.source,
            known,
            grade,
            reason,
            part,
            self.what,
            self.meaning,
            category,
            self.detail,
        )


def kinds(*each: Kind) -> Mapping[str, Kind]:
    """Kinds by their key."""
    found = {k.what: k for k in each}
    assert len(found) == len(each), "two kinds of figures with one key"
    return found


def grade_of(flags: NDArray[np.uint8]) -> tuple[Grade, str]:
    """Grade and reason from the flags (n, segments used) of the samples that a figure rests on."""
    if not flags.size:
        return "poor", phrase("measure.no_samples")
    found = []
    for flag, words in FLAG_WORDS.items():
        share = float(((flags & flag) != 0).any(axis=1).mean())
        if share > 0:
            found.append((share, words))
    if not found:
        return "good", ""
    share, words = max(found)
    reason = (
        phrase("measure.share_of_samples", what=words, share=100 * share)
        if share >= ONE_PERCENT
        else phrase("measure.few_of_samples", what=words)
    )
    trusted = share <= TRUSTED and not (flags & WRONG).any()
    return ("good" if trusted else "fair" if share <= USABLE else "poor"), reason


def worse(*graded: tuple[Grade, str]) -> tuple[Grade, str]:
    """The worst grade, with all reasons."""
    return max((g for g, _ in graded), key=GRADES.index), join(r for _, r in graded)
