"""A result against both hands' histories of its patient: does it look like the other hand's? A question, never a fault.

Rule      of at least FEWEST ranges of joints whose minimal detectable change is known, most have become smaller than the same hand's were by more than that
          change, and most are what the other hand's were
Limits    a hand that grows to what the other reaches recovers, and is not asked; without an earlier session of either hand nothing is
"""

from collections.abc import Sequence
from dataclasses import replace
from statistics import median

from handscope.app.report.changes import Changes
from handscope.app.report.units import reading
from handscope.estimators.measures.figure import Figure
from handscope.sessions.clinic.references import Compared

FEWEST = 6  # joints
LESS = 1.0  # times the minimal detectable change, by which the middle one has become smaller
SAME = 0.5  # times it, within which the middle one is the other hand's: repeated measurements differ by 0.34 in the middle


def resembles_other_hand(
    rows: Sequence[tuple[str, str, Figure]], changes: Changes | None, other: Compared | None
) -> bool:
    """Whether ranges of joints are no longer this hand's but the other's.

    Parameters
    ----------
    rows : sequence
        Task, measure and figure of a result.
    changes : Changes or None
        Since the session before of the same hand.
    other : Compared or None
        The other hand's session that the result is compared with.
    """
    if changes is None or other is None:
        return False
    grown, distances = [], []
    for task, measure, figure in rows:
        change, values = changes.of(task, figure.name), other.values
        known = values.get((measure, task, figure.name))
        if figure.unit != "rad" or change is None or not change.mdc95 or known is None:
            continue
        there = replace(figure, value=known[0])
        grown.append(change.value / change.mdc95)
        distances.append(abs(reading(figure).value - reading(there).value) / change.mdc95)
    return len(grown) >= FEWEST and median(grown) < -LESS and median(distances) < SAME
