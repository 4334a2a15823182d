"""Stretches at rest in a sensor's samples, the positions they are in, and the turns between them.

In      samples of one sensor (n, ...) at instants t; NaN is missing
Out     Rest: means and noise of every stretch; Turn: the samples from one stretch to the next
Source  Tedaldi, Pretto & Menegatti 2014, ICRA, III.C: a static interval is one whose variance over
        a window stays low
Limits  a slow steady turn about the vertical looks like rest: one whose mean rate stands out from
        the others is dropped
"""

from dataclasses import dataclass

import numpy as np

from handscope.estimators.data.options import option
from handscope.estimators.numerics.intervals import find_runs
from handscope.estimators.numerics.typing import Array

NEIGHBOUR = np.radians(20.0)  # positions closer than this count as one
# rad/s that the mean rate of a stretch may differ from the median of all
ODD_RATE = np.radians(2.0)


@dataclass(frozen=True, kw_only=True)
class RestParams:
    """What counts as rest; s, rad/s, m/s^2."""

    window: float = option(
        0.5,
        "s",
        "window over which the samples' spread is looked at",
        "ours; 1 s in Tedaldi et al. 2014",
    )
    rest_time: float = option(
        1.0, "s", "shortest stretch at rest", "1-4 s in Tedaldi et al. 2014, IV"
    )
    rest_gyr: float = option(
        1.0,
        "deg/s",
        "largest spread of the angular rate at rest",
        "half of VQF's rest threshold (Laidig & Seel 2023)",
    )
    rest_acc: float = option(
        0.25,
        "m/s^2",
        "largest spread of the acceleration at rest",
        "half of VQF's rest threshold (Laidig & Seel 2023)",
    )
    longest_turn: float = option(
        30.0,
        "s",
        "longest way from one position to the next that is integrated",
        "ours: bias drift of MEMS gyroscopes",
    )


@dataclass(frozen=True)
class Rest:
    """One stretch at rest."""

    first: int
    last: int  # index behind its last sample
    gyr: Array  # (3,) mean, rad/s
    acc: Array  # (3,) mean, m/s^2
    gyr_noise: float  # standard deviation of a sample's axis
    acc_noise: float

    def __len__(self) -> int:
        return self.last - self.first

    @property
    def up(self) -> Array:
        """Direction of the reading."""
        return np.asarray(self.acc / np.linalg.norm(self.acc))


def find_rests(params: RestParams, t: Array, gyr: Array, acc: Array) -> list[Rest]:
    """Stretches at rest in order of time."""
    rate = (len(t) - 1) / (t[-1] - t[0])
    window = max(3, round(params.window * rate))
    if len(t) < 2 * window:
        return []
    quiet = (_spread(gyr, window) < np.radians(params.rest_gyr)) & (
        _spread(acc, window) < params.rest_acc
    )
    runs = [
        (a + window // 2, b + window // 2)
        for a, b in find_runs(quiet)
        if b - a >= params.rest_time * rate
    ]
    found = [_rest(gyr, acc, a, b) for a, b in runs]
    middle = np.median([r.gyr for r in found], axis=0) if found else np.zeros(3)
    return [r for r in found if np.linalg.norm(r.gyr - middle) < ODD_RATE]


def distinct_positions(rests: list[Rest]) -> list[Array]:
    """Distinct directions (3,) of the reading at rest."""
    kept: list[Array] = []
    for rest in rests:
        if all(rest.up @ other < np.cos(NEIGHBOUR) for other in kept):
            kept.append(rest.up)
    return kept


def missing_positions(found: list[Array]) -> list[str]:
    """Sensor axes, with sign, that no position turns upwards within 60 deg; an octahedron in any
    direction misses none."""
    wanted = {
        f"{sign}{name}": s * np.eye(3)[k]
        for k, name in enumerate("xyz")
        for sign, s in (("+", 1.0), ("-", -1.0))
    }
    return [name for name, axis in wanted.items() if not any(axis @ up > 0.5 for up in found)]


def find_turns(
    params: RestParams, t: Array, gyr: Array, rests: list[Rest]
) -> list[tuple[int, int]]:
    """Pairs (k, k + 1) of stretches with an unbroken and not too long way between them that changes
    the position."""
    step = float(np.median(np.diff(t)))
    kept = []
    for k, (a, b) in enumerate(zip(rests, rests[1:])):
        between = slice(a.last - 1, b.first + 1)
        whole = np.isfinite(gyr[between]).all() and np.diff(t[between]).max() < 3 * step
        if (
            whole
            and t[b.first] - t[a.last - 1] <= params.longest_turn
            and a.up @ b.up < np.cos(NEIGHBOUR)
        ):
            kept.append((k, k + 1))
    return kept


def _rest(gyr: Array, acc: Array, first: int, last: int) -> Rest:
    noise = [float(np.sqrt(x[first:last].var(axis=0, ddof=1).mean())) for x in (gyr, acc)]
    return Rest(first, last, gyr[first:last].mean(axis=0), acc[first:last].mean(axis=0), *noise)


def _spread(x: Array, window: int) -> Array:
    """Standard deviation (n - window + 1,) over a sliding window, of the axis that varies most;
    infinite where a sample is missing."""
    whole = np.asarray(np.isfinite(x).all(axis=1))
    y = (
        np.where(whole[:, None], x - x[whole].mean(axis=0), 0.0)
        if whole.any()
        else np.zeros_like(x)
    )
    sums = [
        np.concatenate([np.zeros((1, s.shape[1])), np.cumsum(s, axis=0)])
        for s in (y, y**2, ~whole[:, None] * np.ones(3))
    ]
    mean, square, broken = ((s[window:] - s[:-window]) / window for s in sums)
    return np.asarray(
        np.where(
            broken[:, 0] > 1e-9, np.inf, np.sqrt(np.maximum(square - mean**2, 0.0).max(axis=1))
        )
    )
