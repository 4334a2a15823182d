"""Sensors and strips whose samples are stamped too late or too early against their neighbours'.

In      pairs of sensors (sensor_pairs.py)
Out     who is late, by how much, from when to when
Source  ours: the acceleration of a common joint seen from either side at the delay that leaves least; test: paired_test.py
Limits  within +-`FURTHEST` s; a finger that moves while the hand rests tells no delay between the two, and a joint that rests tells all
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours import paired_test
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.hand.anatomy import CHAINS
from handscope.estimators.numerics.typing import Array

FURTHEST, COARSE, FINE = 0.36, 0.04, 0.01  # s
FINER = 2  # steps of FINE beside the best coarse lag, between which a parabola has it
MOST = 3  # delays that are told of a recording
PARTS = 8  # of the recording, at whose edges a delay may begin or end
TOLERATED = 0.02  # s: clocks of strips and a sample at 50 Hz
MARGIN = 0.4  # of the mean log ratio of a joint: as much as skin may favour a delay; ours
LEAST_SURE = 0.01  # probability from which on a delay is looked at no further
EXPLAINED = 4.0  # times their noise that joints leave at the delay: of what leaves more, a delay is not the cause

Curves = dict[tuple[tuple[str, str], int], tuple[Array, Array]]  # by joint and sign of the lags


@dataclass(frozen=True)
class Delay:
    """Sensors that are late together, or early where it is negative."""

    sensors: tuple[str, ...]
    late: float  # s
    p_value: float
    gain: float  # log ratio of what is left over, all windows and joints
    span: tuple[float, float]  # s


def find(pairs: Pairs) -> list[Delay]:
    """Late sensors, most certain first; at most one for each joint that shows it."""
    lags, parts = _lags(), spans(*pairs.series.span)
    count = _count(pairs, parts)
    curves: Curves = {}
    return most_certain(
        [j for j in pairs.joints if pairs.is_poor(*j)],
        groups(pairs),
        lambda g: [_best(pairs, lags, g, s, curves) for s in parts],
        count,
    )


def p_value_of(pairs: Pairs, joint: tuple[str, str], late: float) -> float:
    """Probability that `find` would tell of a delay put into what is beyond a joint."""
    rest, noise = _curve(pairs, joint, np.array([0.0, late]), 1)
    known, (right, wrong) = np.isfinite(rest).all(axis=0), rest
    right, wrong, noise = right[known], wrong[known], noise[0][known]
    if np.count_nonzero(wrong > 1.5 * noise) < paired_test.FEWEST:
        return 1.0
    gain = paired_test.log_rest(wrong, noise) - paired_test.log_rest(right, noise)
    p = paired_test.p_value(gain, MARGIN, paired_test.weight(wrong, right, noise))
    parts = spans(*pairs.series.span)
    return min(1.0, p * _count(pairs, parts))


def _count(pairs: Pairs, parts: Sequence[tuple[float, float]]) -> int:
    """Delays that are looked for in parts of a recording."""
    return len(groups(pairs)) * (len(_lags()) + 2 * FINER) * len(parts)


def _lags() -> Array:
    steps = round(FURTHEST / COARSE)
    return np.asarray(np.arange(-steps, steps + 1) * COARSE, float)


def most_certain(
    doubted: Sequence[tuple[str, str]],
    every: Sequence[tuple[str, ...]],
    tried: Callable[[tuple[str, ...]], Sequence[Delay]],
    count: int,
) -> list[Delay]:
    """The delay that the doubted joints show best, then that of those which it does not explain: three at most, of `count` that were looked for.

    `every` group of sensors that may be late together; `tried` gives the delays of one.
    """
    found: list[Delay] = []
    while doubted and len(found) < MOST:
        suspects = [g for g in every if any((a in g) != (b in g) for a, b in doubted)]
        sure = [d for g in suspects for d in tried(g) if d.p_value * count < LEAST_SURE]
        if not sure:
            break
        best = max(sure, key=lambda d: d.gain)
        found.append(replace(best, p_value=best.p_value * count))
        doubted = [j for j in doubted if not any(s in j for s in best.sensors)]
    return found


def spans(begin: float, end: float) -> list[tuple[float, float]]:
    """The whole of a recording, and its parts from and up to the edges at which a delay may begin or end."""
    edges = [float(e) for e in np.linspace(begin, end, PARTS + 1)[1:-1]]
    return [(begin, end), *((e, end) for e in edges), *((begin, e) for e in edges)]


def groups(pairs: Pairs) -> list[tuple[str, ...]]:
    """Sensors that may be late together: each alone, the strip of a finger."""
    present = pairs.series.sensors
    strips = [tuple(s for s in chain if s in present) for chain in CHAINS.values()]
    return [*((s,) for s in present), *(strip for strip in strips if len(strip) > 1)]


def _curve(pairs: Pairs, joint: tuple[str, str], lags: Array, sign: int) -> tuple[Array, Array]:
    """What is left over (lags, K), and the noise in it, with the child's readings taken later by each lag, or earlier; NaN where there are no samples."""
    found = []
    for lag in np.round(sign * lags, 6):
        fitted, use = pairs.joint(*joint, joint, float(lag)), pairs.use(*joint, float(lag))
        use &= pairs.moves(joint[0]) & pairs.moves(joint[1])  # otherwise it is skin that tells
        found.append((np.where(use, fitted.rest, np.nan), fitted.noise))
    rest, noise = zip(*found)
    return np.array(rest), np.array(noise)


def _best(
    pairs: Pairs, lags: Array, group: tuple[str, ...], span: tuple[float, float], known: Curves
) -> Delay:
    """The delay of a group that explains its joints best within a span; `known` keeps what is left over of a joint."""
    t = pairs.windows(pairs.series.sensors[0]).t
    inside = (t >= span[0]) & (t < span[1])
    touched = [
        (j, 1 if j[1] in group else -1) for j in pairs.joints if (j[0] in group) != (j[1] in group)
    ]
    for key in touched:  # the parent late is the child early
        if key not in known:
            known[key] = _curve(pairs, key[0], lags, key[1])
    rest, noise, total = _together([known[key] for key in touched], inside)
    k, zero = int(np.argmin(total)), len(lags) // 2
    if abs(lags[k]) <= TOLERATED or k in (0, len(lags) - 1):
        return Delay(group, 0.0, 1.0, 0.0, span)
    before, noise, late = rest[:, zero], noise[:, 0], vertex(lags, total, k)
    fine = np.asarray(np.round(late / FINE + np.arange(-FINER, FINER + 1)) * FINE, float)
    nearer, _, by_fine = _together([_curve(pairs, j, fine, s) for j, s in touched], inside)
    after, late = (
        nearer[:, int(np.argmin(by_fine))],
        vertex(fine, by_fine, int(np.argmin(by_fine))),
    )
    is_known = np.isfinite(before + after)
    gain = np.where(
        is_known, paired_test.log_rest(before, noise) - paired_test.log_rest(after, noise), 0.0
    ).sum(axis=0)
    weight = np.where(
        is_known,
        paired_test.weight(np.where(is_known, before, 0.0), np.where(is_known, after, 0.0), noise),
        0.0,
    ).max(axis=0)
    if float(np.nansum(weight * after)) > EXPLAINED * float((weight * noise)[is_known].sum()):
        return Delay(group, 0.0, 1.0, 0.0, span)
    p = paired_test.p_value(gain / np.maximum(is_known.sum(axis=0), 1), MARGIN, weight)
    return Delay(group, late, p, float(gain @ (weight > 0)), span)


def _together(
    curves: list[tuple[Array, Array]], inside: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """What joints leave over (joints, lags, K), the noise in it, and the logarithm of all (lags,)."""
    rest, noise = (np.array([c[k] for c in curves])[:, :, inside] for k in (0, 1))
    noise = noise.max(axis=1, keepdims=True)
    return rest, noise, np.nansum(paired_test.log_rest(rest, noise), axis=(0, 2))


def vertex(lags: Array, total: Array, k: int) -> float:
    """The lag between those that were tried, by a parabola through the least and its neighbours."""
    if not 0 < k < len(lags) - 1:
        return float(lags[k])
    a, b, c = total[k - 1 : k + 2]
    return float(lags[k] + 0.5 * (a - c) / max(a - 2 * b + c, 1e-9) * (lags[1] - lags[0]))
