"""Sensors that sit on each other's segments: two exchanged, or a whole finger's in another order.

In      pairs of sensors (sensor_pairs.py)
Out     the exchange under which neighbours meet at common joints clearly better than as declared
Source  ours; test: paired_test.py, over all exchanges of two sensors and all orders along a finger. Where joints do not move: how far apart along a finger its sensors sit, as a hand that
        turns or trembles shows it, by Student's t with the other fingers' errors (Student 1908, Biometrika 6:1)
Limits  a hand that neither turns nor moves its joints tells no order; whole fingers exchanged keep their order: joint_places.py
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handscope.estimators.fault_detection.neighbours import common_joint, paired_test
from handscope.estimators.fault_detection.neighbours.sensor_pairs import Pairs
from handscope.estimators.hand.anatomy import CHAINS, side_sign
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.tail_probabilities import student_sf
from handscope.estimators.numerics.typing import Array

MARGIN = 1.2  # of the log ratio of all joints together: skin alone lets another order leave up to a third at one joint; ours
EXPLAINED = 4.0  # times their noise that joints leave after the exchange: of what leaves more, it is not the cause
BEYOND = 8.0  # weight of a window that skin does not explain, even where sensors that change places turn alike
FALSE_ALARM = 1e-3  # of the distances along all fingers of one recording, as of finger_order.py; another order has to fit as well, as in one of ten intact hands
SPACING_SD = 0.004  # m, of the distance of neighbouring sensors from the declared; more where other fingers show it
LEAST_OTHERS = 4  # distances of other fingers that tell the errors
FITS = 0.01  # probability from which on an order is compatible with the distances
OTHERS = 0.01  # probability from which on a second exchange explains the readings as well as the best one

Order = Mapping[str, str]  # sensor that sits on a segment, by segment; those that stay are left out


@dataclass(frozen=True)
class Exchange:
    """Sensors that are probably on each other's segments."""

    order: Order
    p_value: float
    gain: float  # log ratio of what is left over, all windows and joints
    is_only: bool  # no other exchange explains the readings as well


def find(pairs: Pairs) -> Exchange | None:
    """The most probable exchange, with the probability of such evidence without any."""
    poor = [j for j in pairs.joints if pairs.is_poor(*j)]
    every = _orders(pairs)
    candidates = [o for o in every if _helps(pairs, [j for j in poor if set(j) & set(o)], o)]
    if not candidates:
        return None
    gains = [_gain(pairs, {}, order) for order in candidates]
    tests = [
        paired_test.p_value(gain, MARGIN / len(_touched(pairs, order)), weight) * len(every)
        if _explains(pairs, order)
        else 1.0
        for order, (gain, weight) in zip(candidates, gains)
    ]
    totals = [
        float(gain @ (weight > 0)) * len(_touched(pairs, order)) if p < OTHERS else -np.inf
        for order, (gain, weight), p in zip(candidates, gains, tests)
    ]
    best = int(np.argmax(totals))
    if not np.isfinite(totals[best]):
        return None
    rivals = [int(k) for k in np.argsort(totals)[::-1][1:8] if np.isfinite(totals[k])]
    as_good = [k for k in rivals if not _beats(pairs, candidates[best], candidates[k])]
    simplest = min(
        [best, *as_good], key=lambda k: len({s.partition("_")[0] for s in candidates[k]})
    )  # within a finger, where that explains as much
    return Exchange(candidates[simplest], tests[simplest], totals[simplest], not as_good)


def find_by_distances(pairs: Pairs) -> Exchange | None:
    """Sensors of one finger in another order, by how far apart along the finger they sit; where joints bend, and where they do not."""
    along = {f: d for f, chain in CHAINS.items() if (d := _distances(pairs, chain)) is not None}
    tests = [t for finger in along for t in _order_tests(along, finger)]
    fitting = [t for t in tests if t[1] > FITS]
    if not fitting:
        return None
    p_value, _, order = min(fitting, key=lambda t: t[0])
    p_value = min(1.0, p_value * len(tests))
    if p_value >= FALSE_ALARM:
        return None
    return Exchange(order, p_value, -float(np.log(max(p_value, 1e-300))), True)


@dataclass(frozen=True)
class _Distances:
    """From the first sensor of a finger to the second, and on to the third, along the finger."""

    found: Array  # (2,) m
    declared: Array  # (2,) m
    sd: Array  # (2,) m, by what differs from window to window


def _distances(pairs: Pairs, chain: Sequence[str]) -> _Distances | None:
    """None where a sensor is missing."""
    joints = list(zip(chain, chain[1:]))
    if not all(joint in pairs.joints for joint in joints):
        return None
    distal = side_sign(pairs.geometry.hand) * np.array([0.0, 1.0, 0.0])
    by = np.array(
        [
            [
                sign * quat.rotate(quat.conjugate(pairs.q_BS[s]), distal)
                for s, sign in zip(joint, (1, -1))
            ]
            for joint in joints
        ]
    ).reshape(len(joints), 6)
    fits = [pairs.joint(*joint) for joint in joints]
    covariance = common_joint.scattered(fits)
    return _Distances(
        np.array([b @ f.place for b, f in zip(by, fits)]),
        np.array([b @ pairs.expected(*j, j).centre for b, j in zip(by, joints)]),
        np.sqrt(np.einsum("ji,jik,jk->j", by, covariance, by)),
    )


def _order_tests(
    along: Mapping[str, _Distances], finger: str
) -> Iterator[tuple[float, float, Order]]:
    """Every other order along a finger: the probability of such distances in the declared order, and in this one."""
    mine, chain = along[finger], CHAINS[finger]
    others = [d for f, d in along.items() if f != finger]
    wrong = [(d.found - d.declared) / np.hypot(d.sd, SPACING_SD) for d in others]
    errors, sd = np.concatenate([np.zeros(0), *wrong]), np.hypot(mine.sd, SPACING_SD)
    if len(errors) < LEAST_OTHERS:
        return
    own = (mine.found - mine.declared) / sd
    middles = np.concatenate([[0.0], np.cumsum(mine.declared)])
    for order in list(itertools.permutations(range(3)))[1:]:
        towards = (np.diff(middles[list(order)]) - mine.declared) / sd
        whole = float(np.linalg.norm(towards))
        off = float(own @ towards) / whole
        aside = max(float(own @ own) - off**2, 0.0)
        freedom = len(errors) + 1
        size = max(1.0, float(np.sqrt((errors @ errors + aside) / freedom)))
        p_value, fits = student_sf(np.array([off, whole - off]) / size, freedom)
        sits = {on: chain[order.index(k)] for k, on in enumerate(chain) if order[k] != k}
        yield float(p_value), float(fits), sits


def _helps(pairs: Pairs, poor: list[tuple[str, str]], order: Order) -> bool:
    """Whether an order explains the joints better that the declared one does not explain: only then all its joints are asked."""
    if not poor:
        return False
    gain, weight = _compared(pairs, poor, {}, order)
    return float(gain @ weight) > 0


def _explains(pairs: Pairs, order: Order) -> bool:
    """Whether an order explains each of its joints, where they turn."""
    for joint in _touched(pairs, order):
        rest, noise, use = _rest(pairs, joint, order)
        use = use & pairs.turns(*(order.get(s, s) for s in joint))
        if rest[use].sum() > EXPLAINED * noise[use].sum():
            return False
    return True


def _orders(pairs: Pairs) -> list[Order]:
    present = pairs.series.sensors
    found: list[Order] = [{a: b, b: a} for a, b in itertools.combinations(present, 2)]
    for a, b, c in CHAINS.values():
        if {a, b, c} <= set(present):
            found += [{a: b, b: c, c: a}, {a: c, b: a, c: b}]
    return found


def _beats(pairs: Pairs, mine: Order, yours: Order) -> bool:
    gain, weight = _gain(pairs, yours, mine)
    return paired_test.p_value(gain, 0.0, weight) < OTHERS


def _touched(pairs: Pairs, order: Order) -> list[tuple[str, str]]:
    return [j for j in pairs.joints if set(j) & set(order)]


def _gain(pairs: Pairs, yours: Order, mine: Order) -> tuple[Array, Array]:
    """How much better (mean log ratio of the joints) `mine` explains the joints than `yours` in each window, and how much the window tells."""
    gain, weight = _compared(pairs, _touched(pairs, {**mine, **yours}), yours, mine)
    shows = _is_different(pairs, yours, mine) | (weight > BEYOND)
    turns = np.any([pairs.turns(*j) for j in _touched(pairs, {**mine, **yours})], axis=0)
    return gain, np.where(shows & turns, weight, 0.0)  # at rest scale errors alone differ


def _compared(
    pairs: Pairs, joints: list[tuple[str, str]], yours: Order, mine: Order
) -> tuple[Array, Array]:
    """The same of some joints."""
    seen = [[_rest(pairs, joint, order) for joint in joints] for order in (yours, mine)]
    (before, noise, use), (after, other, also) = (
        tuple(np.array(part) for part in zip(*each)) for each in seen
    )
    noise = np.maximum(noise, other)
    weight = paired_test.weight(before, after, noise).max(axis=0) * (use & also).all(axis=0)
    return np.asarray(
        (paired_test.log_rest(before, noise) - paired_test.log_rest(after, noise)).mean(axis=0)
    ), weight


def _is_different(pairs: Pairs, yours: Order, mine: Order) -> NDArray[np.bool_]:
    """In which windows (K,) sensors that change places turn at different rates: where they do not, skin would tell, and nothing is lost by an exchange."""
    found = np.zeros(len(pairs.by_skin), bool)
    for segment in set(mine) | set(yours):
        speed_difference = pairs.speed(yours.get(segment, segment)) - pairs.speed(
            mine.get(segment, segment)
        )
        found |= np.sqrt((speed_difference**2).mean(axis=1)) > pairs.by_skin
    return found


def _rest(
    pairs: Pairs, joint: tuple[str, str], order: Order
) -> tuple[Array, Array, NDArray[np.bool_]]:
    a, b = (order.get(s, s) for s in joint)
    found = pairs.joint(a, b, joint)
    return found.rest, found.noise, pairs.use(a, b)
