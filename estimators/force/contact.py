"""Detection of grasp and release by a threshold on the sum of the fingertips' forces.

In      sizes of the forces (n, S) N at times t (n,), NaN where not known
Out     Grasps: onset and end
Source  Kortier, thesis 6.3: a threshold detector acting on the sum of measured forces; two thresholds, so that it does not chatter: ours.
        Ours as well: where thumb and others push at once the weaker side counts twice, which in a pinch is the sum; a sensor whose zero has jumped
        goes on pushing alone, and holds nothing
Limits  with one force sensor, or where one side is never measured, a push at the table looks like a grasp
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.numerics.intervals import find_runs
from handscope.estimators.numerics.typing import Array, Bools


@dataclass(frozen=True, kw_only=True)
class ContactParams:
    """Thresholds of touch and release in N, times in s."""

    grasp: float = option(
        0.6,
        "N",
        "sum of the forces above which something is held",
        "ours: six times the noise of two sensors",
        least=0.05,
    )
    release: float = option(0.35, "N", "and below which it is let go", "ours", least=0.02)
    shortest: float = option(
        0.3, "s", "a shorter touch is none", "ours: four samples at 12 Hz", least=0.0
    )
    pause: float = option(0.2, "s", "a shorter pause is none", "ours", least=0.0)


@dataclass(frozen=True)
class Grasp:
    """A stretch in which something is held."""

    onset: float  # s
    end: float  # s


def find_grasps(
    params: ContactParams, t: Array, sizes: Array, thumb: int | None = None
) -> list[Grasp]:
    """Every stretch in which the fingertips hold something, in order; `thumb` is the column of the finger against which the others push."""
    total = np.nansum(sizes, axis=1)
    stretches = _find_stretches(params, t, total)
    if thumb is not None and sizes.shape[1] > 1:
        opposed = _find_stretches(
            params,
            t,
            2
            * np.minimum(
                np.nan_to_num(sizes[:, thumb]), np.nansum(np.delete(sizes, thumb, axis=1), axis=1)
            ),
        )
        alone = [
            g for g in stretches if not any(o.onset < g.end and g.onset < o.end for o in opposed)
        ]
        stretches = sorted([*opposed, *alone], key=lambda g: g.onset)
    return [g for g in stretches if g.end - g.onset >= params.shortest]


def _find_stretches(params: ContactParams, t: Array, total: Array) -> list[Grasp]:
    """Stretches of any length in which the signal is above the thresholds; short pauses are bridged."""
    found: list[Grasp] = []
    for first, stop in find_runs(_with_hysteresis(total, params.grasp, params.release)):
        onset, end = (
            _crossing_time(t, total, first, params.release),
            _crossing_time(t, total, stop, params.release),
        )
        if found and onset - found[-1].end < params.pause:
            onset = found.pop().onset
        found.append(Grasp(onset, end))
    return found


def thumb_column(fingers: Sequence[str]) -> int | None:
    """The column of the thumb, None where it has no sensor."""
    return fingers.index("thumb") if "thumb" in fingers else None


def is_inside(t: Array, found: list[Grasp]) -> Bools:
    """Which instants (n,) lie within a grasp."""
    return (
        np.asarray(np.any([(t >= g.onset) & (t <= g.end) for g in found], axis=0))
        if found
        else np.zeros(len(t), bool)
    )


def _with_hysteresis(total: Array, high: float, low: float) -> Bools:
    """True from where the signal exceeds `high`, back and on as long as it stays above `low`."""
    held = np.zeros(len(total), bool)
    for first, stop in find_runs(total > low):
        held[first:stop] = total[first:stop].max() > high
    return held


def _crossing_time(t: Array, total: Array, k: int, level: float) -> float:
    """The time between samples k - 1 and k at which the signal crosses the level."""
    if not 0 < k < len(t) or total[k] == total[k - 1]:
        return float(t[min(max(k, 0), len(t) - 1)])
    return float(
        t[k - 1]
        + np.clip((level - total[k - 1]) / (total[k] - total[k - 1]), 0.0, 1.0) * (t[k] - t[k - 1])
    )
